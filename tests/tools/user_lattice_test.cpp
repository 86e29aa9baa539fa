// Lattices of the user's: written, read and simulated in every format, refused in one line, kept and found
// again.

#include <fstream>

#include <gmock/gmock.h>

#include "assets/lattice_files.h"
#include "tests/tools/simulate_run.h"

namespace sinew::tests {
namespace {

using testing::HasSubstr;

class UserLattice : public Simulate {
 protected:
  const fs::path rig_ = fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb";

  Outcome lattice(const std::string& name, const std::string& flags) const {
    return run(command_line("lattice " + quoted(rig_) + " -o " + quoted(out(name)) + " " + flags));
  }
  std::string frames_with(const std::string& name, const std::string& flags) const {
    simulate("arm", name, "--frames 0-1 --settle 0 " + flags);
    return read(out(name) / "skin.pc2");
  }
};

TEST_F(UserLattice, GivesTheSameFramesFromEveryFormat) {
  const Outcome built = lattice("arm.vtu", "--cells 100 --preview off");
  ASSERT_EQ(built.exit_code, 0) << built.text;
  const std::string expected = frames_with("vtu", "--lattice " + quoted(out("arm.vtu")));
  ASSERT_GT(expected.size(), 1000u);
  const std::pair<const char*, const char*> formats[] = {
      {"a.vtk", "vtk"},          {"b.vtk", "vtk-binary"}, {"a.msh", "msh41"},
      {"b.msh", "msh41-binary"}, {"c.msh", "msh22"},      {"d.msh", "msh22-binary"},
      {"a.mesh", "mesh"},        {"a.node", "tetgen"},    {"a.veg", "veg"}};
  for (const auto& [file, format] : formats) {
    SCOPED_TRACE(format);
    const Outcome written =
        lattice(file, "--preview off --lattice " + quoted(out("arm.vtu")) + " --format " + format);
    ASSERT_EQ(written.exit_code, 0) << written.text;
    EXPECT_TRUE(frames_with(format, "--lattice " + quoted(out(file))) == expected);
  }
}

/// A mesh as another program would hand it over: the bare cells of a built lattice, in the rig file's units.
TEST_F(UserLattice, IsTakenFromOtherProgramsAndRefusedInOneLine) {
  ASSERT_EQ(lattice("own.mesh", "--cells 100 --preview off").exit_code, 0);
  const std::string own = read(out("own.mesh"));
  const std::string bare = own.substr(0, own.find("\nEdges")) + "\nEnd\n";
  std::ofstream(out("bare.mesh")) << bare;
  // The same cells and bones; the target edge is lost and with it the exact share of flesh in every cell: the
  // frames differ, but by far less than a hundredth of the arm's 1.7 m.
  frames_with("bare", "--lattice " + quoted(out("bare.mesh")));
  frames_with("own", "--lattice " + quoted(out("own.mesh")));
  const assets::Pc2Reader with_bare((out("bare") / "skin.pc2").string()),
      with_own((out("own") / "skin.pc2").string());
  EXPECT_LT((with_bare.read(1) - with_own.read(1)).rowwise().norm().maxCoeff(), 0.017F);

  std::ofstream(out("empty.mesh")) << "";
  std::ofstream(out("broken.mesh")) << bare.substr(0, bare.size() / 2);
  std::string doubled = bare;
  const std::size_t cells = doubled.find("Tetrahedra\n") + 11, line = doubled.find('\n', cells) + 1;
  const std::string first = doubled.substr(line, doubled.find('\n', line) + 1 - line);
  doubled.replace(cells, line - cells, std::to_string(std::stoi(doubled.substr(cells)) + 1) + "\n" + first);
  std::ofstream(out("doubled.mesh")) << doubled;
  const std::pair<const char*, const char*> rows[] = {
      {"empty.mesh", "is empty, expected a lattice"},
      {"broken.mesh", "broken.mesh:"},
      {"doubled.mesh", "cell 2: has the vertices of cell 1; hint: remove the doubled cells"}};
  for (const auto& [file, text] : rows) {
    const Outcome outcome = run(command_line("simulate " + quoted(rig_) + " -o " + quoted(out("none")) +
                                             " --lattice " + quoted(out(file))));
    EXPECT_EQ(outcome.exit_code, 3) << file << outcome.text;
    EXPECT_THAT(outcome.text, HasSubstr(text));
    EXPECT_EQ(std::count(outcome.text.begin(), outcome.text.end(), '\n'), 1) << outcome.text;
    EXPECT_FALSE(fs::exists(out("none")));
  }
}

TEST_F(UserLattice, ShowsRegionsMaterialsAndFillInTheRunsLattice) {
  simulate("arm", "run", "--frames 0-0 --settle 0 --cells 150 --density 1100");
  const assets::VtuGrid grid = assets::parse_vtu("lattice.vtu", read(out("run") / "lattice.vtu"));
  const auto cells = [&](const std::string& name) {
    for (const assets::VtuArray& array : grid.cell_arrays)
      if (array.name == name) return std::get<std::vector<double>>(array.values);
    ADD_FAILURE() << "no cell array " << name;
    return std::vector<double>{};
  };
  const std::size_t n = grid.cells.size();
  for (const char* name : {"young", "poisson", "density", "fill"}) ASSERT_GE(cells(name).size(), n) << name;
  double most = 0.0;
  for (std::size_t c = 0; c < n; ++c) {
    if (cells("fill")[c] == 0.0) continue;
    // Means of equal numbers: eight or fewer summands, each rounded once.
    EXPECT_NEAR(cells("density")[c], 1100.0, 1e-9);
    EXPECT_NEAR(cells("poisson")[c], 0.45, 1e-12);
    EXPECT_GT(cells("young")[c], 0.0);
    EXPECT_GE(cells("fill")[c], 0.0);
    EXPECT_LE(cells("fill")[c], 1.0 + 1e-12);
    most = std::max(most, cells("fill")[c]);
  }
  EXPECT_GT(most, 0.3);
  // The weights of all regions sum to 1 at every vertex that has flesh round it.
  std::vector<double> sum(static_cast<std::size_t>(grid.points.rows()), 0.0);
  int regions = 0;
  for (const assets::VtuArray& array : grid.point_arrays) {
    if (!array.name.starts_with("region ")) continue;
    ++regions;
    const auto& values = std::get<std::vector<double>>(array.values);
    for (std::size_t v = 0; v < sum.size(); ++v) sum[v] += values[v];
  }
  EXPECT_GE(regions, 2);
  for (double s : sum) EXPECT_TRUE(std::abs(s - 1.0) < 1e-9 || s == 0.0) << s;
}

TEST_F(UserLattice, IsKeptBesideTheOutputAndTakenAgain) {
  const std::string flags = "--frames 0-1 --settle 0 --cells 150";
  simulate("arm", "one", flags);
  ASSERT_TRUE(fs::is_directory(out(".sinew-cache")));
  const Outcome second =
      run(command_line("simulate " + quoted(rig_) + " -o " + quoted(out("two")) + " " + flags));
  EXPECT_EQ(second.exit_code, 0) << second.text;
  EXPECT_THAT(second.text, HasSubstr("lattice: nothing changed, taken from "));
  EXPECT_TRUE(read(out("one") / "skin.pc2") == read(out("two") / "skin.pc2"));
  EXPECT_TRUE(read(out("one") / "lattice.vtu") == read(out("two") / "lattice.vtu"));
  const Outcome other = run(command_line("simulate " + quoted(rig_) + " -o " + quoted(out("three")) +
                                         " --frames 0-1 --settle 0 --cells 160"));
  EXPECT_EQ(other.text.find("nothing changed"), std::string::npos) << other.text;
  const Outcome off =
      run(command_line("simulate " + quoted(rig_) + " -o " + quoted(out("four")) + " --cache off " + flags));
  EXPECT_EQ(off.text.find("nothing changed"), std::string::npos) << off.text;
  EXPECT_TRUE(read(out("one") / "skin.pc2") == read(out("four") / "skin.pc2"));
}

}  // namespace
}  // namespace sinew::tests
