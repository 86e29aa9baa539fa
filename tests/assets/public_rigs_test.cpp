// Every rig that other people made gives a rig that stands and moves, or one true line.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "assets/rig.h"

namespace sinew::assets {
namespace {

using testing::HasSubstr;

std::string shared(const std::string& path) { return std::string(SINEW_SHARED_DIR) + "/data/public/" + path; }

/// What load_rig must make of a file: "" for a rig that can be simulated; "!code" for a rig with that finding
/// of severity Error; otherwise text that the error holds.
const std::map<std::string, std::string>& expectations() {
  static const std::map<std::string, std::string> table{
      {"characters/CesiumMan.dae", ""},
      {"characters/CesiumMan.glb", ""},
      {"characters/RiggedSimple.dae", ""},
      {"characters/RiggedSimple.gltf", ""},
      {"characters/RiggedSimple0.bin", "importer: cannot be read: No suitable reader found"},
      {"characters/kaykit_Knight.glb", ""},
      {"characters/maya_kenney_character_7700_binary.fbx", ""},
      {"characters/maya_slime_7500_binary.fbx", ""},
      {"characters/momentum_blender_simple_armature.glb", "!no-clip"},
      {"characters/pab_arnaud.fbx", "!no-clip"},
      {"characters/quaternius_Male_Casual.fbx", ""},
      {"characters/quaternius_Zombie.fbx", ""},
      {"quadrupeds/Fox.glb", ""},
      {"quadrupeds/quaternius_Dog.fbx", ""},
      {"quadrupeds/quaternius_Horse.fbx", ""},
      {"quadrupeds/quaternius_Wolf.glb", ""},
      {"motion/Boxing_Toes.bvh", "!no-skin"},
      {"motion/cmu_12_01_walk.bvh", "!no-skin"},
      {"motion/fair1_dab.bvh", "!no-skin"},
      {"motion/fair1_zombie.bvh", "!no-skin"},
      {"motion/makehuman_walk1.bvh", "!no-skin"},
      {"motion/maya_human_ik_7400_binary.fbx", "!no-skin"},
      {"motion/pab_run.fbx", "!no-skin"},
      {"motion/pab_walk.dae", "!no-skin"},
      {"motion/pab_walk.fbx", "!no-skin"},
      {"motion/pybvh_bvh_example.bvh", "!no-skin"},
      {"motion/pybvh_rotation_first_root.bvh", "!no-skin"},
      {"motion/pybvh_standard_skeleton.bvh", "!no-skin"},
      {"nasty/BoxWithInfinites.glb",
       "mesh 'Mesh': vertex 0: x coordinate, got -inf, expected a finite number"},
      {"nasty/MissingBin_BoxTextured.gltf", "/buffers/0/uri: buffer 'BoxTextured0.bin' is missing"},
      {"nasty/RecursiveNodes.gltf", "a node is its own ancestor, got /nodes/0 -> /nodes/1 -> /nodes/0"},
      {"nasty/blender_293_half_skinned_7400_binary.fbx", "!no-clip"},
      {"nasty/cubes_with_mirroring_and_pivot.fbx", "!no-skin"},
      {"nasty/huesitos.fbx", ""},
      {"nasty/hull-body.obj", "!no-skin"},
      {"nasty/malformed_skinweights_oob.x", "importer: crashed on this file, got signal 11"},
      {"nasty/max2009_blob_6100_binary.fbx",
       "importer: cannot be read: FBX-DOM unsupported, old format version"},
      {"nasty/max_geometry_transform_7700_ascii.fbx", "!no-skin"},
      {"nasty/maya_instanced_skin_7700_ascii.fbx",
       "mesh 'pCube1': is skinned and yet moved by keys of its own"},
      {"nasty/maya_scale_no_inherit_7700_ascii.fbx", "!no-skin"},
      {"nasty/maya_transformed_skin_7700_ascii.fbx",
       "mesh 'pCube1': is skinned and yet moved by keys of its own"},
      {"nasty/maya_zero_scale_pivot_7700_ascii.fbx", "!no-skin"},
      {"nasty/momentum_skeleton_non_joint_root.glb", "!no-clip"},
      {"nasty/motionbuilder_sausage_rrss_7700_binary.fbx", ""},
      {"nasty/openscad-nonmanifold-crash.obj", "!no-skin"},
      {"nasty/simple_skin.gltf", "!flat-skin"},
      {"nasty/spider.fbx", "!no-skin"},
      {"nasty/synthetic_broken_cluster_7500_ascii.fbx", "!no-clip"},
      {"nasty/synthetic_cube_nan_7400_ascii.fbx", "!no-skin"},
      {"nasty/synthetic_node_cycle_fail_7700_ascii.fbx", "!no-skin"},
      {"nasty/synthetic_sausage_wiggle_no_bind_7500_ascii.fbx", ""},
      {"reference/maya_game_sausage_7500_ascii_combined.fbx", ""},
  };
  return table;
}

bool has_error(const Rig& rig, const std::string& code) {
  return std::any_of(rig.findings.begin(), rig.findings.end(), [&](const Finding& finding) {
    return finding.severity == Finding::Severity::Error && (code.empty() || finding.code == code);
  });
}

std::string outcome(const std::string& file) {
  try {
    const Rig rig = load_rig(shared(file), {0.0, SINEW_IMPORTER});
    return has_error(rig, "") ? "a rig with an error" : "";
  } catch (const InputError& e) {
    return e.what();
  }
}

TEST(PublicRigs, AreAllInTheTableOfOutcomes) {
  std::set<std::string> found;
  for (const char* folder : {"characters", "quadrupeds", "motion", "nasty", "reference"}) {
    for (const auto& entry : std::filesystem::directory_iterator(shared(folder))) {
      // The frames in reference are results, not rigs.
      if (std::string(folder) == "reference" && entry.path().extension() == ".obj") continue;
      found.insert(std::string(folder) + "/" + entry.path().filename().string());
    }
  }
  std::set<std::string> listed;
  for (const auto& [file, expected] : expectations()) listed.insert(file);
  EXPECT_EQ(found, listed);
}

TEST(PublicRigs, LoadOrEndWithOneTrueLine) {
  for (const auto& [file, expected] : expectations()) {
    SCOPED_TRACE(file);
    if (!expected.empty() && expected.front() == '!') {
      const Rig rig = load_rig(shared(file), {0.0, SINEW_IMPORTER});
      EXPECT_TRUE(has_error(rig, expected.substr(1)));
    } else if (expected.empty()) {
      EXPECT_EQ(outcome(file), "");
    } else {
      const std::string line = outcome(file);
      EXPECT_THAT(line, HasSubstr(expected));
      EXPECT_THAT(line, HasSubstr("; hint: "));
      EXPECT_EQ(line.find('\n'), std::string::npos);
      EXPECT_EQ(line.rfind(shared(file) + ": ", 0), 0u) << line;
    }
  }
}

Eigen::AlignedBox3d flesh_box(const Rig& rig, const lattice::Points& points) {
  Eigen::AlignedBox3d box;
  Eigen::Index row = 0;
  for (const Part& part : rig.parts) {
    for (Eigen::Index v = 0; v < part.points.rows(); ++v, ++row) {
      if (part.role == PartRole::Simulated) box.extend(points.row(row).transpose());
    }
  }
  return box;
}

/// Median over weighted joints of the cube root of |det T_J|, weighted by skin weight.
double median_scale(const Rig& rig, const std::vector<Eigen::Affine3d>& maps) {
  std::vector<double> weight(maps.size(), 0.0);
  double total = 0.0;
  for (const Part& part : rig.parts) {
    for (const auto& influences : part.weights) {
      for (const lattice::Influence& influence : influences) {
        weight[static_cast<std::size_t>(influence.frame)] += influence.weight;
        total += influence.weight;
      }
    }
  }
  std::vector<std::pair<double, double>> scales;
  for (std::size_t j = 0; j < maps.size(); ++j) {
    if (weight[j] > 0.0) scales.emplace_back(std::cbrt(std::abs(maps[j].linear().determinant())), weight[j]);
  }
  std::sort(scales.begin(), scales.end());
  double below = 0.0;
  for (const auto& [scale, w] : scales) {
    below += w;
    if (below >= 0.5 * total) return scale;
  }
  return 0.0;
}

TEST(PublicRigs, CarryTheirRestPoseWithoutAGlobalScaleAndStayUpright) {
  for (const auto& [file, expected] : expectations()) {
    if (!expected.empty()) continue;
    SCOPED_TRACE(file);
    const Rig rig = load_rig(shared(file), {0.0, SINEW_IMPORTER});
    const skeleton::Clip& clip = rig.clips[static_cast<std::size_t>(choose_clip(rig, ""))];
    const auto maps =
        skeleton::pose_from_rest(rig.skeleton, skeleton::sample(rig.skeleton, clip, clip.start));
    // maya_slime squashes and the last sausage stretches by up to 1.7; a unit mistake would be 2.54 at least.
    EXPECT_GT(median_scale(rig, maps), 0.55);
    EXPECT_LT(median_scale(rig, maps), 1.8);
    const lattice::Points rest =
        skin(rig, std::vector<Eigen::Affine3d>(maps.size(), Eigen::Affine3d::Identity()));
    const Eigen::Vector3d rest_size = flesh_box(rig, rest).sizes();
    // The metres of glTF are those of the file; other units are guessed where they make no usual character.
    EXPECT_GE(rest_size.maxCoeff(), rig.format == "glTF 2.0" ? 0.01 : 0.2);
    EXPECT_LE(rest_size.maxCoeff(), rig.format == "glTF 2.0" ? 100.0 : 4.0);
    const Eigen::Vector3d size = flesh_box(rig, skin(rig, maps)).sizes();
    // A character that lies where it should stand changes its height for its width: for the upright ones here
    // that is a factor of 2 or more. The rubber hose of MotionBuilder lies in its bind pose and stands in its
    // clip.
    if (file.find("motionbuilder") != std::string::npos) continue;
    EXPECT_GT(size.y() / rest_size.y(), 0.7);
    EXPECT_LT(size.y() / rest_size.y(), 1.4);
  }
}

TEST(CesiumMan, IsTheSameFromGltfAndFromCollada) {
  // The same character, exported twice by different programs: same height, same joint places.
  const Rig glb = load_rig(shared("characters/CesiumMan.glb"), {0.0, SINEW_IMPORTER});
  const Rig dae = load_rig(shared("characters/CesiumMan.dae"), {0.0, SINEW_IMPORTER});
  EXPECT_EQ(glb.up_axis, UpAxis::Y);
  EXPECT_EQ(dae.up_axis, UpAxis::Z);
  // The two hold decimal and binary copies of single precision numbers of order 1.
  EXPECT_NEAR(glb.height, dae.height, 1e-5);
  const Eigen::AlignedBox3d a = flesh_box(
      glb,
      skin(glb, skeleton::pose_from_rest(glb.skeleton, skeleton::sample(glb.skeleton, glb.clips[0], 1.0))));
  const Eigen::AlignedBox3d b = flesh_box(
      dae,
      skin(dae, skeleton::pose_from_rest(dae.skeleton, skeleton::sample(dae.skeleton, dae.clips[0], 1.0))));
  // glTF keeps four influences of the up to eight: a millimetre or two.
  EXPECT_LT((a.min() - b.min()).norm(), 0.01);
  EXPECT_LT((a.max() - b.max()).norm(), 0.01);
}

TEST(MayaSlime, MovesItsFineBodyWithTheSkinnedOne) {
  const Rig rig = load_rig(shared("characters/maya_slime_7500_binary.fbx"), {0.0, SINEW_IMPORTER});
  ASSERT_EQ(rig.parts.size(), 2u);
  for (const Part& part : rig.parts) EXPECT_EQ(part.role, PartRole::Simulated) << part.name;
  const auto finding = std::find_if(rig.findings.begin(), rig.findings.end(),
                                    [](const Finding& f) { return f.code == "part-follows-skin"; });
  ASSERT_NE(finding, rig.findings.end());
  EXPECT_EQ(finding->where, "Slime_002:Slime_Body_high");
}

}  // namespace
}  // namespace sinew::assets
