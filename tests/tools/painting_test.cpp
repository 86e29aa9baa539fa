// What a scene says of bones and of regions of the lattice, seen in the lattice's own file.

#include <fstream>
#include <sstream>

#include <gmock/gmock.h>

#include "assets/vtu.h"
#include "tests/tools/simulate_run.h"

namespace sinew::tests {
namespace {

using testing::HasSubstr;

class Painted : public Simulate {
 protected:
  const fs::path rig_ = fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb";

  /// `sinew lattice` of a scene with these tables.
  Outcome lattice(const std::string& name, const std::string& tables, const std::string& flags = {}) const {
    const fs::path scene = out(name + ".toml");
    std::ofstream(scene) << "rig = \"" << rig_.string() << "\"\ncells = 120\n" << tables;
    return run(command_line("lattice " + quoted(scene) + " --preview off --cache off -o " +
                            quoted(out(name)) + " " + flags));
  }
  assets::VtuGrid grid(const std::string& name, const std::string& tables,
                       const std::string& flags = {}) const {
    const Outcome done = lattice(name, tables, flags);
    EXPECT_EQ(done.exit_code, 0) << done.text;
    return assets::parse_vtu(name, read(out(name)));
  }
  static std::vector<double> values(const std::vector<assets::VtuArray>& arrays, const std::string& name) {
    for (const assets::VtuArray& array : arrays)
      if (array.name == name) return std::get<std::vector<double>>(array.values);
    return {};
  }
  static int num_regions(const assets::VtuGrid& grid) {
    int regions = 0;
    for (const assets::VtuArray& array : grid.point_arrays) regions += array.name.starts_with("region ");
    return regions;
  }
};

TEST_F(Painted, ShowsMaterialsAndWeightsOfRegionsInTheLattice) {
  const assets::VtuGrid plain = grid("plain.vtu", "");
  EXPECT_GE(num_regions(plain), 2);
  std::vector<double> sum(static_cast<std::size_t>(plain.points.rows()), 0.0);
  for (const assets::VtuArray& array : plain.point_arrays) {
    if (!array.name.starts_with("region ")) continue;
    const std::vector<double>& weights = std::get<std::vector<double>>(array.values);
    for (std::size_t v = 0; v < sum.size(); ++v) sum[v] += weights[v];
  }
  for (const double s : sum) EXPECT_TRUE(std::abs(s - 1.0) < 1e-9 || s == 0.0) << s;

  const assets::VtuGrid painted = grid("painted.vtu",
                                       "[[material]]\nbones = [\"*\"]\nyoung = 7000\nregion = "
                                       "\"all\"\n[[material]]\nbones = [\"*\"]\ndensity = 1300\n");
  EXPECT_EQ(num_regions(painted), 1);
  int with_flesh = 0;
  const std::vector<double> young = values(painted.cell_arrays, "young"),
                            density = values(painted.cell_arrays, "density");
  ASSERT_GE(young.size(), painted.cells.size());  // edges of bones come after the cells
  ASSERT_EQ(density.size(), young.size());
  for (std::size_t c = 0; c < painted.cells.size(); ++c) {
    if (std::isnan(young[c])) continue;  // no flesh there
    ++with_flesh;
    // Means of up to 32 equal numbers; the second material does not take back what the first said.
    EXPECT_NEAR(young[c], 7000.0, 1e-9);
    EXPECT_NEAR(density[c], 1300.0, 1e-9);
  }
  EXPECT_GT(with_flesh, 50);
}

TEST_F(Painted, TakesMaterialsByTheRegionsOfALattice) {
  ASSERT_EQ(lattice("own.mesh", "").exit_code, 0);
  const std::string own = read(out("own.mesh"));
  // As another program would write it: the bare cells, every other one in region 3.
  std::istringstream lines(own.substr(0, own.find("\nEdges")));
  std::ofstream bare(out("bare.mesh"));
  std::string line;
  bool in_cells = false;
  int cell = -2;  // the key word's line and the count
  std::vector<bool> in_three;
  while (std::getline(lines, line)) {
    in_cells = in_cells || line == "Tetrahedra";
    if (in_cells && ++cell > 0) {
      in_three.push_back(cell % 2 == 0);
      line = line.substr(0, line.rfind(' ')) + (cell % 2 == 0 ? " 3" : " 8");
    }
    bare << line << '\n';
  }
  bare << "End\n";
  bare.close();
  const std::string flags = "--lattice " + quoted(out("bare.mesh"));
  const assets::VtuGrid painted = grid("regions.vtu", "[[material]]\nregions = [3]\nyoung = 12345\n", flags);
  const std::vector<double> young = values(painted.cell_arrays, "young");
  ASSERT_EQ(painted.cells.size(), in_three.size());
  ASSERT_GE(young.size(), in_three.size());
  for (std::size_t c = 0; c < in_three.size(); ++c) {
    if (std::isnan(young[c])) continue;
    EXPECT_EQ(std::abs(young[c] - 12345.0) < 1e-6, bool(in_three[c])) << c;
  }

  const Outcome wrong = lattice("wrong.vtu", "[[material]]\nregions = [\"belly\"]\nyoung = 1\n", flags);
  EXPECT_EQ(wrong.exit_code, 3);
  EXPECT_THAT(wrong.text,
              HasSubstr("bare.mesh: material 1: no region is named 'belly', expected one of 3, 8\n"));
  EXPECT_FALSE(fs::exists(out("wrong.vtu")));
}

TEST_F(Painted, RefusesPullsAndRegionsThatCannotBe) {
  EXPECT_THAT(lattice("thin.vtu", "[[material]]\nbones = [\"*\"]\nradius = 1e-5\n").text,
              HasSubstr("material 1: radius: got 1e-05, expected at least "));
  const Outcome apart = lattice("apart.vtu", "[[material]]\nbones = [\"*\"]\nradius = 2000\n");
  EXPECT_EQ(apart.exit_code, 2);
  EXPECT_THAT(apart.text, HasSubstr("material 1: radius: got 2000, expected 1e-06 <= r <= 1000 m"));
}

}  // namespace
}  // namespace sinew::tests
