// Every skinned character and quadruped that other people made gets a lattice that passes the whole gate,
// without an option, in three sizes.
#include <algorithm>
#include <ctime>
#include <filesystem>
#include <iostream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "assets/lattice_input.h"
#include "assets/rig.h"
#include "lattice/build.h"
#include "lattice/quality.h"

namespace sinew::assets {
namespace {

std::vector<std::string> skinned_files() {
  std::vector<std::string> files;
  for (const char* folder : {"characters", "quadrupeds"})
    for (const auto& entry :
         std::filesystem::directory_iterator(std::string(SINEW_SHARED_DIR) + "/data/public/" + folder))
      if (entry.path().extension() != ".bin") files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  return files;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
}

class LatticesOfRigs : public testing::TestWithParam<int> {};  // wanted number of cells

TEST_P(LatticesOfRigs, PassTheWholeGate) {
  const std::vector<std::string> files = skinned_files();
  ASSERT_GE(files.size(), 15u);
  LoadOptions load;
  load.importer_executable = SINEW_IMPORTER;
  std::vector<double> dihedral, jacobian, seconds;
  for (const std::string& file : files) {
    SCOPED_TRACE(file);
    const LatticeInput input = lattice_input(load_rig(file, load));
    const std::clock_t start = std::clock();
    const lattice::BuildResult result =
        lattice::build(input.skin.surface, input.joints, {.cells = GetParam()});
    seconds.push_back(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    const lattice::LatticeQuality& q = result.lattice.quality;
    for (const lattice::GateFailure& failure : result.failures) ADD_FAILURE() << failure.what;
    EXPECT_NO_THROW(lattice::validate(result.lattice));
    EXPECT_EQ(q.skin_vertices_outside, 0);
    EXPECT_EQ(q.skin_triangles_outside, 0);
    EXPECT_TRUE(q.exact_chains);
    EXPECT_GT(q.min_volume, 0.0);
    EXPECT_GE(q.min_dihedral_degrees, 10.0);
    EXPECT_GE(q.min_scaled_jacobian, 0.10);
    for (const lattice::Cell& cell : result.lattice.complex.cells)
      EXPECT_GE(lattice::min_corner_jacobian(result.lattice.complex, cell), 0.10);
    // "Lands within about 10 %": measured -9 ... +5 % on these files.
    EXPECT_NEAR(static_cast<double>(result.lattice.complex.cells.size()), GetParam(), 0.15 * GetParam());
    dihedral.push_back(q.min_dihedral_degrees);
    jacobian.push_back(q.min_scaled_jacobian);
  }
  // Measured 26.8 and more.
  EXPECT_GE(median(dihedral), 25.0);
  EXPECT_GE(median(jacobian), 0.27);
  std::cout << fmt::format("medians: dihedral {:.1f} degrees, Jacobian {:.3f}, {:.2f} s\n", median(dihedral),
                           median(jacobian), median(seconds));
}

INSTANTIATE_TEST_SUITE_P(Cells, LatticesOfRigs, testing::Values(200, 1000, 5000));

}  // namespace
}  // namespace sinew::assets
