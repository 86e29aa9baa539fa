// Joints on which no flesh hangs, with bind matrices right and wrong.
#include <numbers>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/detail/rig_builder.h"
#include "assets/detail/transforms.h"
#include "skeleton/clip.h"

namespace sinew::assets::detail {
namespace {

using testing::HasSubstr;

/// A limb 90 units long below an armature of 0.01, on three joints 30 units apart: "upper" and "lower" carry
/// it, "control" between them carries nothing. `leftover` is the bind matrix of "control".
struct Limb {
  ImportedScene scene;
  enum Node { kArmature, kUpper, kControl, kLower };

  Limb() {
    scene.format = "test";
    scene.metres_per_unit = 1.0;
    add("armature", -1, Eigen::Vector3d::Zero());
    scene.nodes[kArmature].local.scale.setConstant(0.01);
    add("upper", kArmature, Eigen::Vector3d::Zero());
    add("control", kUpper, {0, 30, 0});
    add("lower", kControl, {0, 30, 0});
    ImportedSkin skin;
    for (int j = 0; j < 3; ++j) {
      skin.joints.push_back(kUpper + j);
      Eigen::Affine3d bind = Eigen::Affine3d::Identity();
      bind.translation().y() = -30.0 * j;
      skin.joint_from_mesh.push_back(bind);
    }
    scene.skins.push_back(skin);
    ImportedMesh mesh;
    mesh.name = "limb";
    mesh.points.resize(4, 3);
    mesh.points << -5, 0, -5, 5, 0, -5, 0, 0, 5, 0, 90, 0;
    mesh.triangles.resize(4, 3);
    mesh.triangles << 0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0;
    mesh.weights = {{{0, 1.0}}, {{0, 1.0}}, {{0, 1.0}}, {{2, 1.0}}};
    scene.meshes.push_back(mesh);
    scene.instances.push_back({kArmature, 0, 0});
    settle();
  }

  void add(const std::string& name, int parent, const Eigen::Vector3d& translation) {
    ImportedNode node;
    node.name = name;
    node.parent = parent;
    node.local.translation = translation;
    scene.nodes.push_back(node);
  }

  /// The nodes' matrices follow their parts.
  void settle() {
    for (ImportedNode& node : scene.nodes) node.parent_from_node = node.local.matrix();
  }

  Eigen::Affine3d& bind_of_control() { return scene.skins[0].joint_from_mesh[1]; }

  /// A clip that turns one joint to a quarter turn and back.
  void bend(int node) {
    skeleton::Channel channel;
    channel.joint = node;
    const Eigen::Quaterniond turned(Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitX()));
    const Eigen::Quaterniond& still = scene.nodes[static_cast<std::size_t>(node)].local.rotation;
    channel.rotation = {skeleton::Interpolation::Linear, {0, 1, 2}, {still, turned, still}, {}, {}};
    scene.clips.push_back({"bend", 0, 0, 0, {channel}});
  }
};

std::vector<Eigen::Affine3d> node_maps(const Rig& rig) {
  return skeleton::pose_from_rest(rig.skeleton, skeleton::node_pose(rig.skeleton));
}

std::string rehung(const Rig& rig) {
  for (const Finding& finding : rig.findings)
    if (finding.code == "bind-matrix-ignored") return finding.message;
  return "";
}

/// A few products and inverses of numbers near 1.
constexpr double kRounding = 1e-12;

TEST(LooseJoints, RestWhereTheNodesHaveThemWhateverTheirBindMatrix) {
  Limb limb;
  Eigen::Affine3d shifted = limb.bind_of_control();
  shifted.translation().x() += 4.0;  // 4 % of the limb's length
  Eigen::Affine3d turned = limb.bind_of_control();
  turned.prerotate(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ()));
  Eigen::Affine3d large = limb.bind_of_control();
  large.prescale(1.1);
  for (const Eigen::Affine3d& leftover : {Eigen::Affine3d::Identity(), shifted, turned, large}) {
    limb.bind_of_control() = leftover;
    const Rig rig = build_rig("limb", limb.scene, {});
    // The file stands in its bind pose: nothing moves from rest to the nodes.
    for (const Eigen::Affine3d& map : node_maps(rig))
      EXPECT_TRUE(map.isApprox(Eigen::Affine3d::Identity(), kRounding));
    EXPECT_NEAR(rig.skeleton.joint(Limb::kControl).rest_from_joint.translation().y(), 0.3, kRounding);
    EXPECT_THAT(rehung(rig), HasSubstr("('control')"));
  }
}

TEST(LooseJoints, KeepABindMatrixThatAgrees) {
  const Limb limb;
  const Rig rig = build_rig("limb", limb.scene, {});
  EXPECT_EQ(rehung(rig), "");
  for (const Eigen::Affine3d& map : node_maps(rig))
    EXPECT_TRUE(map.isApprox(Eigen::Affine3d::Identity(), kRounding));
}

TEST(LooseJoints, HangOnTheRelativeThatMovesLeastAgainstThem) {
  // The nodes hold another pose, so that the two relatives place the joint differently; it moves with the one
  // that no clip turns against it.
  for (const int bent : {static_cast<int>(Limb::kControl), static_cast<int>(Limb::kLower)}) {
    Limb limb;
    limb.bind_of_control().setIdentity();
    limb.scene.nodes[static_cast<std::size_t>(bent)].local.rotation =
        Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX());
    limb.settle();
    limb.bend(bent);
    const Rig rig = build_rig("limb", limb.scene, {});
    EXPECT_THAT(rehung(rig), HasSubstr("('control')"));
    const int relative = bent == Limb::kControl ? Limb::kLower : Limb::kUpper;
    for (const double time : {0.0, 0.3, 1.0}) {
      const auto maps =
          skeleton::pose_from_rest(rig.skeleton, skeleton::sample(rig.skeleton, rig.clips[0], time));
      EXPECT_TRUE(maps[Limb::kControl].isApprox(maps[static_cast<std::size_t>(relative)], kRounding)) << time;
    }
  }
}

TEST(LooseJoints, KeepTheirMatrixWhereTheNodesHoldAnotherPose) {
  // Another pose turns joints, but says nothing against a matrix of the right size and about the right place.
  Limb limb;
  for (const int node : {Limb::kControl, Limb::kLower})
    limb.scene.nodes[static_cast<std::size_t>(node)].local.rotation =
        Eigen::AngleAxisd(1.2, Eigen::Vector3d::UnitX());
  limb.settle();
  const Rig rig = build_rig("limb", limb.scene, {});
  EXPECT_EQ(rehung(rig), "");
  EXPECT_NEAR(rig.skeleton.joint(Limb::kControl).rest_from_joint.translation().y(), 0.3, kRounding);
  // A matrix of another unit does not count.
  limb.bind_of_control() = limb.bind_of_control() * Eigen::Scaling(0.01);
  EXPECT_THAT(rehung(build_rig("limb", limb.scene, {})), HasSubstr("('control')"));
}

TEST(LooseJoints, CountOnlyInTheSkinThatTheyCarry) {
  // The heavier skin names a joint that it does not use, with a leftover; the lighter one hangs on it.
  Limb limb;
  ImportedSkin other = limb.scene.skins[0];
  limb.bind_of_control().setIdentity();
  limb.scene.skins.push_back(other);
  ImportedMesh sleeve = limb.scene.meshes[0];
  sleeve.name = "sleeve";
  sleeve.weights.assign(4, {{1, 0.5}, {0, 0.5}});
  limb.scene.meshes.push_back(sleeve);
  limb.scene.instances.push_back({Limb::kArmature, 1, 1});
  limb.scene.meshes[0].points.conservativeResize(5, 3);  // a vertex more makes the first skin the heavier one
  limb.scene.meshes[0].points.row(4) << 0, 45, 0;
  limb.scene.meshes[0].weights.push_back({{0, 1.0}});
  const Rig rig = build_rig("limb", limb.scene, {});
  EXPECT_EQ(rehung(rig), "");
  for (const Eigen::Affine3d& map : node_maps(rig))
    EXPECT_TRUE(map.isApprox(Eigen::Affine3d::Identity(), kRounding));
}

TEST(LooseJoints, ArePlacedWhereTheSkinHasNoExtent) {
  Limb limb;
  limb.scene.meshes[0].points.setZero();
  skeleton::Channel channel;
  channel.joint = Limb::kControl;
  channel.translation = {skeleton::Interpolation::Linear, {0, 1}, {{0, 30, 0}, {0, 40, 0}}, {}, {}};
  limb.scene.clips.push_back({"slide", 0, 0, 0, {channel}});
  const Rig rig = build_rig("limb", limb.scene, {});
  for (const skeleton::Joint& joint : rig.skeleton.joints())
    EXPECT_TRUE(joint.rest_from_joint.matrix().allFinite()) << joint.name;
}

TEST(LooseJoints, AreNamedByThreeAndCounted) {
  Limb limb;
  for (int i = 0; i < 6; ++i) {
    limb.add("helper" + std::to_string(i), Limb::kUpper, {0, 3.0 + i, 0});
    limb.scene.skins[0].joints.push_back(Limb::kLower + 1 + i);
    limb.scene.skins[0].joint_from_mesh.push_back(Eigen::Affine3d::Identity());
  }
  limb.settle();
  EXPECT_THAT(rehung(build_rig("limb", limb.scene, {})),
              HasSubstr("('helper0', 'helper1', 'helper2' and 3 more)"));
}

}  // namespace
}  // namespace sinew::assets::detail
