// A finer belly and a coarser head on rigs that other people made, and on a sample of ours.
#include <algorithm>
#include <map>

#include <gtest/gtest.h>

#include "assets/lattice_input.h"
#include "assets/rig.h"
#include "lattice/build.h"
#include "lattice/limb_copies.h"

namespace sinew::assets {
namespace {

struct Sized {
  const char* file;
  std::vector<const char*> belly;
  const char* head;
};

/// Median edge of a regular tetrahedron with a cell's volume, over the cells with a corner nearest to skin of
/// the joints.
double median_edge(const lattice::ControlLattice& lattice, const LatticeInput& input,
                   const std::vector<int>& joints) {
  std::vector<int> itself(input.joints.names.size());
  for (std::size_t j = 0; j < itself.size(); ++j) itself[j] = static_cast<int>(j);
  const lattice::Surface& skin = input.skin.surface;
  std::vector<double> edges;
  for (const lattice::Cell& cell : lattice.complex.cells) {
    Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
    for (int k = 0; k < 4; ++k) middle += 0.25 * lattice.complex.points.row(cell.vertices[k]);
    Eigen::Index nearest = 0;
    (skin.points.rowwise() - middle).rowwise().squaredNorm().minCoeff(&nearest);
    const int joint = lattice::skin_frame(skin.weights[static_cast<std::size_t>(nearest)], itself);
    if (std::find(joints.begin(), joints.end(), joint) == joints.end()) continue;
    edges.push_back(std::cbrt(6.0 * std::sqrt(2.0) * lattice::cell_volume(lattice.complex, cell)));
  }
  EXPECT_GE(edges.size(), 5u);
  if (edges.empty()) return 0.0;
  std::sort(edges.begin(), edges.end());
  return edges[edges.size() / 2];
}

void expect_sized(const Sized& sized, const std::string& file) {
  SCOPED_TRACE(file);
  LoadOptions load;
  load.importer_executable = SINEW_IMPORTER;
  const LatticeInput input = lattice_input(load_rig(file, load));
  const auto joint = [&](const char* name) {
    const auto found = std::find(input.joints.names.begin(), input.joints.names.end(), name);
    EXPECT_NE(found, input.joints.names.end()) << name;
    return static_cast<int>(found - input.joints.names.begin());
  };
  std::vector<int> belly;
  lattice::BuildOptions options, alike;
  options.grade = alike.grade = lattice::Grade::Off;  // what sizes do, not what limbs do
  for (const char* name : sized.belly) {
    belly.push_back(joint(name));
    options.size_factors.push_back({belly.back(), 0.5});
  }
  const std::vector<int> head{joint(sized.head)};
  options.size_factors.push_back({head[0], 2.0});
  const lattice::BuildResult plain = lattice::build(input.skin.surface, input.joints, alike),
                             result = lattice::build(input.skin.surface, input.joints, options);
  for (const lattice::GateFailure& failure : result.failures) ADD_FAILURE() << failure.what;
  EXPECT_FALSE(result.lattice.is_grid);
  EXPECT_NO_THROW(lattice::validate(result.lattice));
  EXPECT_NEAR(static_cast<double>(result.lattice.complex.cells.size()), 1000, 120);
  EXPECT_EQ(plain.mirror.has_value(), result.mirror.has_value()) << result.no_mirror;
  // The belly gets its cells from the head: both change against a lattice of as many cells of one size.
  EXPECT_LT(median_edge(result.lattice, input, belly), 0.9 * median_edge(plain.lattice, input, belly));
  EXPECT_GT(median_edge(result.lattice, input, head), 1.1 * median_edge(plain.lattice, input, head));
}

TEST(SizedRigs, PassTheGateWithAFinerBellyAndACoarserHead) {
  const std::string folder = std::string(SINEW_SHARED_DIR) + "/data/public/";
  const std::vector<Sized> rigs{
      {"quadrupeds/Fox.glb", {"b_Hip_01", "b_Spine01_02", "b_Spine02_03"}, "b_Head_05"},
      {"quadrupeds/quaternius_Horse.fbx", {"Body", "Hips", "Torso"}, "Head"},
      {"characters/kaykit_Knight.glb", {"hips", "spine"}, "head"},
      {"characters/quaternius_Male_Casual.fbx", {"Hips", "Abdomen"}, "Head"}};
  for (const Sized& sized : rigs) expect_sized(sized, folder + sized.file);
}

TEST(SizedRigs, KeepTheHopperMirrored) {
  expect_sized({"", {"hips", "spine"}, "head"}, std::string(SINEW_SOURCE_DIR) + "/assets/samples/hopper.glb");
}

}  // namespace
}  // namespace sinew::assets
