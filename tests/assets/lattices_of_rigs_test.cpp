// Every skinned character and quadruped that other people made gets a lattice that can be simulated.
#include <filesystem>
#include <iostream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "assets/lattice_input.h"
#include "assets/rig.h"
#include "lattice/build.h"

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

class LatticesOfRigs : public testing::TestWithParam<int> {};

TEST_P(LatticesOfRigs, HoldTheSkinAndTheBones) {
  const std::vector<std::string> files = skinned_files();
  ASSERT_GE(files.size(), 15u);
  LoadOptions load;
  load.importer_executable = SINEW_IMPORTER;
  for (const std::string& file : files) {
    SCOPED_TRACE(file);
    const LatticeInput input = lattice_input(load_rig(file, load));
    const lattice::BuildResult result =
        lattice::build(input.skin.surface, input.joints, {.cells = GetParam()});
    const lattice::LatticeQuality& q = result.lattice.quality;
    const std::string name = std::filesystem::path(file).filename().string();
    std::cout << fmt::format("{:40} cells {:5} vertices {:5} dihedral {:5.1f} Jacobian {:.3f} retries {}\n",
                             name, result.lattice.complex.cells.size(), result.lattice.complex.points.rows(),
                             q.min_dihedral_degrees, q.min_scaled_jacobian, result.lattice.retries);
    for (const lattice::GateFailure& failure : result.failures) ADD_FAILURE() << failure.what;
    EXPECT_NO_THROW(lattice::validate(result.lattice));
    EXPECT_EQ(q.skin_vertices_outside, 0);
    EXPECT_EQ(q.skin_triangles_outside, 0);
    EXPECT_TRUE(q.exact_chains);
    // "Lands within about 10 %": measured -10 ... +6 % on these files.
    EXPECT_NEAR(static_cast<double>(result.lattice.complex.cells.size()), GetParam(), 0.12 * GetParam());
  }
}

INSTANTIATE_TEST_SUITE_P(Cells, LatticesOfRigs, testing::Values(200, 1000));

}  // namespace
}  // namespace sinew::assets
