// Frames that another tool wrote for the same files: our skinning must give them back.
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "assets/error.h"
#include "assets/rig.h"

namespace sinew::assets {
namespace {

/// Vertices of an OBJ file.
lattice::Points read_obj_points(const std::string& file) {
  std::ifstream in(file);
  EXPECT_TRUE(in) << file;
  std::vector<Eigen::Vector3d> points;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string key;
    Eigen::Vector3d p;
    if (words >> key >> p.x() >> p.y() >> p.z() && key == "v") points.push_back(p);
  }
  lattice::Points result(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) result.row(static_cast<Eigen::Index>(i)) = points[i];
  return result;
}

double largest_gap(const lattice::Points& from, const lattice::Points& to) {
  double largest = 0.0;
  for (Eigen::Index i = 0; i < from.rows(); ++i) {
    largest = std::max(largest, (to.rowwise() - from.row(i)).rowwise().norm().minCoeff());
  }
  return largest;
}

struct Frame {
  const char* rig;   ///< below the public data.
  const char* clip;  ///< empty: the one that is taken.
  double seconds;    ///< after the start of the take.
  const char* obj;   ///< below reference/.
};

std::string shared(const std::string& path) { return std::string(SINEW_SHARED_DIR) + "/data/public/" + path; }

/// Largest distance, either way, between our skin and the frame, as a share of the frame's diagonal. Vertex
/// order differs between the tools, so that every vertex is compared with the nearest.
double compare(const Frame& frame) {
  const Rig rig = load_rig(shared(frame.rig), {0.0, SINEW_IMPORTER});
  const skeleton::Clip& clip = rig.clips.at(static_cast<std::size_t>(choose_clip(rig, frame.clip)));
  const skeleton::Pose pose = skeleton::sample(rig.skeleton, clip, frame.seconds);
  lattice::Points skinned = skin(rig, skeleton::pose_from_rest(rig.skeleton, pose));
  const Eigen::Affine3d file_from_rig = rig.rig_from_file.inverse();
  skinned =
      ((skinned * file_from_rig.linear().transpose()).rowwise() + file_from_rig.translation().transpose())
          .eval();
  const lattice::Points expected = read_obj_points(shared(std::string("reference/") + frame.obj));
  const double diagonal = (expected.colwise().maxCoeff() - expected.colwise().minCoeff()).norm();
  return std::max(largest_gap(skinned, expected), largest_gap(expected, skinned)) / diagonal;
}

class ReferenceFrame : public testing::TestWithParam<Frame> {};

TEST_P(ReferenceFrame, IsMatchedWithinATenThousandthOfItsDiagonal) {
  EXPECT_LT(compare(GetParam()), 1e-4) << GetParam().obj;
}

constexpr const char* kSausage = "reference/maya_game_sausage_7500_ascii_combined.fbx";

constexpr const char* kRrss = "nasty/motionbuilder_sausage_rrss_7700_binary.fbx";

// File frames are at 24 per second; the importer moves each take to 0, and "wiggle" begins at frame 1.
// "deform" animates scales that children do not inherit (Rrs), the last two gather scales apart from
// rotations (RrSs).
INSTANTIATE_TEST_SUITE_P(
    OfAnotherTool, ReferenceFrame,
    testing::Values(Frame{kSausage, "wiggle", 9.0 / 24.0, "maya_game_sausage_wiggle_10.obj"},
                    Frame{kSausage, "spin", 7.0 / 24.0, "maya_game_sausage_spin_7.obj"},
                    Frame{kSausage, "deform", 8.0 / 24.0, "maya_game_sausage_deform_8.obj"},
                    Frame{"characters/maya_kenney_character_7700_binary.fbx", "", 4.0 / 24.0,
                          "maya_kenney_character_4.obj"},
                    Frame{kRrss, "", 12.0 / 24.0, "motionbuilder_sausage_rrss_12.obj"},
                    Frame{kRrss, "", 36.0 / 24.0, "motionbuilder_sausage_rrss_36.obj"}));

std::string refusal(const std::string& file) {
  try {
    load_rig(shared(file), {0.0, SINEW_IMPORTER});
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

// The frames of these two show the mesh's own motion on top of its skin, which other programs leave out.
TEST(MeshMovedByItsOwnKeys, IsRefusedByName) {
  for (const char* file :
       {"nasty/maya_transformed_skin_7700_ascii.fbx", "nasty/maya_instanced_skin_7700_ascii.fbx"}) {
    EXPECT_EQ(refusal(file), shared(file) +
                                 ": mesh 'pCube1': is skinned and yet moved by keys of its own in clip "
                                 "'Take 001', expected only its joints to move; hint: delete the keys of "
                                 "the mesh, or bake it and export as .glb");
  }
}

}  // namespace
}  // namespace sinew::assets
