#include "assets/detail/rig_builder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/detail/rest_pose.h"
#include "assets/detail/skin_weights.h"
#include "assets/detail/transforms.h"
#include "assets/detail/units.h"
#include "assets/error.h"

namespace sinew::assets::detail {
namespace {

using testing::HasSubstr;

/// 53 random bits in [-1, 1]; std::uniform_real_distribution differs between libraries.
class Random {
 public:
  explicit Random(std::uint64_t seed) : rng_(seed) {}
  double operator()() { return static_cast<double>(rng_() >> 11) * 0x1.0p-52 - 1.0; }
  Eigen::Vector3d vector() { return {(*this)(), (*this)(), (*this)()}; }
  Eigen::Quaterniond rotation() {
    return Eigen::Quaterniond((*this)(), (*this)(), (*this)(), (*this)()).normalized();
  }

 private:
  std::mt19937_64 rng_;
};

Eigen::Affine3d similarity(double scale, const Eigen::Quaterniond& rotation,
                           const Eigen::Vector3d& translation) {
  Eigen::Affine3d map = Eigen::Affine3d::Identity();
  map.linear() = scale * rotation.toRotationMatrix();
  map.translation() = translation;
  return map;
}

/// A worm of `num_joints` joints a metre apart along y with a point cloud of triangles round it, bound in
/// that pose; `armature` stands above its root joint and the mesh was modelled below the armature, too.
ImportedScene worm(int num_joints, const Eigen::Affine3d& armature, Random& random) {
  ImportedScene scene;
  scene.format = "test";
  ImportedNode root;
  root.name = "armature";
  root.parent_from_node = armature;
  root.local = decompose(armature);
  scene.nodes.push_back(root);
  ImportedSkin skin;
  Eigen::Affine3d mesh_from_joint = Eigen::Affine3d::Identity();
  for (int j = 0; j < num_joints; ++j) {
    ImportedNode node;
    node.name = "joint" + std::to_string(j);
    node.parent = j;
    node.local.translation = j == 0 ? Eigen::Vector3d(0, 0, 0) : Eigen::Vector3d(0, 1, 0);
    node.parent_from_node = node.local.matrix();
    mesh_from_joint = mesh_from_joint * node.parent_from_node;
    skin.joints.push_back(j + 1);
    skin.joint_from_mesh.push_back(mesh_from_joint.inverse());
    scene.nodes.push_back(node);
  }
  scene.skins.push_back(skin);
  ImportedMesh mesh;
  mesh.name = "worm";
  const int num_points = 30 * num_joints;
  mesh.points.resize(num_points, 3);
  mesh.triangles.resize(num_points - 2, 3);
  for (int v = 0; v < num_points; ++v) {
    const double y = (num_joints - 1) * static_cast<double>(v) / (num_points - 1);
    mesh.points.row(v) << 0.3 * random(), y, 0.3 * random();
    const int below = std::min(static_cast<int>(y), num_joints - 2);
    const double share = y - below;
    mesh.weights.push_back({{below, 1.0 - share}, {below + 1, share}});
    if (v >= 2) mesh.triangles.row(v - 2) << v - 2, v - 1, v;
  }
  scene.meshes.push_back(mesh);
  scene.instances.push_back({0, 0, 0});
  return scene;
}

/// Turns every joint of the node tree by up to `radians`: the nodes hold a pose, the bind matrices do not.
void pose_nodes(ImportedScene& scene, double radians, Random& random) {
  for (std::size_t n = 1; n < scene.nodes.size(); ++n) {
    ImportedNode& node = scene.nodes[n];
    node.local.rotation = Eigen::AngleAxisd(radians * random(), random.vector().normalized());
    node.parent_from_node = node.local.matrix();
  }
}

/// Plain skinning of the file itself in its node pose, in file world coordinates: what an
/// importer-independent viewer shows.
lattice::Points skinned_by_the_file(const ImportedScene& scene) {
  std::vector<Eigen::Affine3d> world;
  for (const ImportedNode& node : scene.nodes) {
    world.push_back(node.parent < 0 ? node.parent_from_node
                                    : world[static_cast<std::size_t>(node.parent)] * node.parent_from_node);
  }
  const ImportedMesh& mesh = scene.meshes[0];
  lattice::Points result = lattice::Points::Zero(mesh.points.rows(), 3);
  for (Eigen::Index v = 0; v < mesh.points.rows(); ++v) {
    for (const lattice::Influence& influence : mesh.weights[static_cast<std::size_t>(v)]) {
      const auto j = static_cast<std::size_t>(influence.frame);
      const Eigen::Vector3d p = world[static_cast<std::size_t>(scene.skins[0].joints[j])] *
                                (scene.skins[0].joint_from_mesh[j] * mesh.points.row(v).transpose());
      result.row(v) += influence.weight * p.transpose();
    }
  }
  return result;
}

lattice::Points in_file_space(const Rig& rig, const lattice::Points& points) {
  const Eigen::Affine3d back = rig.rig_from_file.inverse();
  return (points * back.linear().transpose()).rowwise() + back.translation().transpose();
}

TEST(BuildRig, PosesAsTheFileDoesWhateverStandsAboveTheSkeleton) {
  Random random(20021);
  for (int trial = 0; trial < 60; ++trial) {
    SCOPED_TRACE(trial);
    const double scale = std::pow(10.0, 3.0 * random());
    ImportedScene scene = worm(6, similarity(scale, random.rotation(), 5.0 * random.vector()), random);
    if (trial % 2 == 1) pose_nodes(scene, 0.5, random);
    const std::array<UpAxis, 3> axes{UpAxis::X, UpAxis::Y, UpAxis::Z};
    scene.up_axis = axes[static_cast<std::size_t>(trial) % 3];
    const Rig rig = build_rig("worm", scene, {});
    const auto maps = skeleton::pose_from_rest(rig.skeleton, skeleton::node_pose(rig.skeleton));
    const lattice::Points expected = skinned_by_the_file(scene);
    const lattice::Points got = in_file_space(rig, skin(rig, maps));
    const double size = (expected.colwise().maxCoeff() - expected.colwise().minCoeff()).norm();
    // A dozen matrix products and inverses, each good to a few eps times the size and the distance from the
    // origin.
    EXPECT_LT((got - expected).rowwise().norm().maxCoeff(), 1e-12 * (size + 20.0));
  }
}

TEST(BuildRig, GivesEveryJointAboutUnitScaleFromRestToPose) {
  Random random(20022);
  for (const double scale : {1e-3, 0.01, 1.0, 2.54, 100.0}) {
    ImportedScene scene = worm(6, similarity(scale, random.rotation(), {0, 0, 0}), random);
    pose_nodes(scene, 0.8, random);
    const Rig rig = build_rig("worm", scene, {});
    for (const auto& map : skeleton::pose_from_rest(rig.skeleton, skeleton::node_pose(rig.skeleton))) {
      EXPECT_NEAR(map.linear().determinant(), 1.0, 1e-12);
    }
  }
}

TEST(BuildRig, StandsUprightWhenTheNodesHoldAPose) {
  // Modelled along z and turned up by its armature, as Blender exports to FBX: 100 and a quarter turn.
  Random random(20023);
  Eigen::Affine3d armature = Eigen::Affine3d::Identity();
  armature.linear() =
      100.0 * Eigen::AngleAxisd(-std::numbers::pi / 2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  ImportedScene scene = worm(6, armature, random);
  // The worm lies along y below the armature; stand it along z there, so that the world sees it along y.
  const Eigen::Affine3d up = similarity(
      1.0, Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitX())), {0, 0, 0});
  scene.nodes[1].parent_from_node = up;
  scene.nodes[1].local = decompose(up);
  scene.meshes[0].points = (scene.meshes[0].points * up.linear().transpose()).eval();
  for (Eigen::Affine3d& bind : scene.skins[0].joint_from_mesh) bind = bind * up.inverse();
  Random pose(7);
  for (std::size_t n = 2; n < scene.nodes.size(); ++n) {
    scene.nodes[n].local.rotation = Eigen::AngleAxisd(0.6 * pose(), pose.vector().normalized());
    scene.nodes[n].parent_from_node = scene.nodes[n].local.matrix();
  }
  const Rig rig = build_rig("worm", scene, {});
  const Eigen::Vector3d size =
      (rig.parts[0].points.colwise().maxCoeff() - rig.parts[0].points.colwise().minCoeff());
  EXPECT_GT(size.y(), 5.0 * size.x());
  EXPECT_GT(size.y(), 5.0 * size.z());
  EXPECT_DOUBLE_EQ(rig.height, size.y());
}

TEST(BuildRig, TurnsTrianglesRoundWhereANodeMirrors) {
  Random random(20024);
  Eigen::Affine3d mirror = Eigen::Affine3d::Identity();
  mirror.linear()(0, 0) = -1.0;
  const ImportedScene plain = worm(3, Eigen::Affine3d::Identity(), random);
  ImportedScene mirrored = plain;
  mirrored.nodes[0].parent_from_node = mirror;
  mirrored.nodes[0].local = decompose(mirror);
  const Part a = build_rig("worm", plain, {}).parts[0];
  const Part b = build_rig("worm", mirrored, {}).parts[0];
  // The mirror image of an outward triangle, traversed the other way round, is outward again.
  EXPECT_EQ(a.triangles.col(1), b.triangles.col(2));
  EXPECT_EQ(a.triangles.col(2), b.triangles.col(1));
  EXPECT_LT((a.points.col(0) + b.points.col(0)).norm(), 1e-12);
}

TEST(BuildRig, ExportsBackWhereClipsMoveTheRoot) {
  // A clip on the root joint above which nothing stands, with Z up: tracks must be turned and scaled, too.
  Random random(20025);
  ImportedScene scene = worm(4, similarity(50.0, random.rotation(), {1, 2, 3}), random);
  scene.up_axis = UpAxis::Z;
  skeleton::Clip clip;
  clip.name = "go";
  skeleton::Channel channel;
  channel.joint = 0;
  channel.translation = {skeleton::Interpolation::Linear, {0, 2}, {{0, 0, 0}, {10, 20, -30}}, {}, {}};
  channel.rotation = {
      skeleton::Interpolation::Linear, {0, 2}, {random.rotation(), random.rotation()}, {}, {}};
  clip.channels.push_back(channel);
  scene.clips.push_back(clip);
  const Rig rig = build_rig("worm", scene, {});
  const lattice::Points got = in_file_space(
      rig, skin(rig, skeleton::pose_from_rest(rig.skeleton, sample(rig.skeleton, rig.clips[0], 1.25))));
  ImportedScene posed = scene;
  Eigen::Quaterniond from = channel.rotation->values[0], to = channel.rotation->values[1];
  if (from.dot(to) < 0.0) to.coeffs() *= -1.0;
  posed.nodes[0].local.translation = 0.625 * Eigen::Vector3d(10, 20, -30);
  posed.nodes[0].local.rotation = from.slerp(0.625, to);
  posed.nodes[0].parent_from_node = posed.nodes[0].local.matrix();
  const lattice::Points expected = skinned_by_the_file(posed);
  // Sizes of a few hundred file units; slerp keeps about half the digits' guard: 1e-12 of the size each.
  EXPECT_LT((got - expected).rowwise().norm().maxCoeff(), 1e-10);
}

TEST(BuildRig, SaysWhichClipScalesFleshToNothing) {
  Random random(20032);
  ImportedScene scene = worm(4, Eigen::Affine3d::Identity(), random);
  for (const double end : {0.5, 0.0}) {
    skeleton::Channel channel;
    channel.joint = 3;
    channel.scale = {skeleton::Interpolation::Linear, {2, 4}, {{1, 1, 1}, {1, end, 1}}, {}, {}};
    scene.clips.push_back({end > 0.0 ? "shrink" : "vanish", 0, 0, 0, {channel}});
  }
  const Rig rig = build_rig("worm", scene, {});
  std::vector<std::string> said;
  for (const Finding& finding : rig.findings)
    if (finding.code == "flesh-scaled-to-nothing") said.push_back(finding.where + ": " + finding.message);
  EXPECT_THAT(said,
              testing::ElementsAre("vanish: joint 'joint2' is scaled to nothing at 4 s; only frames before "
                                   "that can be simulated"));
}

TEST(BuildRig, RefusesSkinsThatWereBoundInDifferentPoses) {
  Random random(20026);
  ImportedScene scene = worm(4, Eigen::Affine3d::Identity(), random);
  ImportedSkin other = scene.skins[0];
  // The second skin says that joint2 stood 0.2 m elsewhere.
  other.joint_from_mesh[2].translation().x() += 0.2;
  scene.skins.push_back(other);
  ImportedMesh coat = scene.meshes[0];
  coat.name = "coat";
  scene.meshes.push_back(coat);
  scene.instances.push_back({0, 1, 1});
  try {
    build_rig("worm", scene, {});
    FAIL() << "accepted";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("worm: skin: the bind matrices do not agree"));
    EXPECT_THAT(e.what(), HasSubstr("worst joints 'joint2'"));
    EXPECT_THAT(e.what(), HasSubstr("worst parts 'coat'"));
  }
}

/// The worm once more, on a skeleton of its own that stands at `place`.
ImportedScene two_worms(const Eigen::Vector3d& place, Random& random) {
  ImportedScene scene = worm(4, Eigen::Affine3d::Identity(), random);
  const int first = static_cast<int>(scene.nodes.size());
  ImportedSkin skin = scene.skins[0];
  for (int n = 0; n < first; ++n) {
    ImportedNode node = scene.nodes[static_cast<std::size_t>(n)];
    node.name += "_b";
    if (node.parent >= 0) node.parent += first;
    if (node.parent < 0) node.local.translation = place;
    node.parent_from_node = node.local.matrix();
    scene.nodes.push_back(node);
  }
  for (int& joint : skin.joints) joint += first;
  scene.skins.push_back(skin);
  scene.instances.push_back({first, 0, 1});
  return scene;
}

TEST(BuildRig, MakesTwoBodiesOfOneMeshOnTwoSkeletons) {
  Random random(20030);
  const Eigen::Vector3d place(1.0, 0.0, 0.5);
  const Rig rig = build_rig("worms", two_worms(place, random), {});
  ASSERT_EQ(rig.parts.size(), 2u);
  EXPECT_LT(((rig.parts[0].points.rowwise() + place.transpose()) - rig.parts[1].points).norm(), 1e-12);
  for (const auto& map : skeleton::pose_from_rest(rig.skeleton, skeleton::node_pose(rig.skeleton)))
    EXPECT_TRUE(map.isApprox(Eigen::Affine3d::Identity(), 1e-12));
}

TEST(BuildRig, RefusesTwoSkeletonsOfOneMeshInOnePlace) {
  Random random(20031);
  try {
    build_rig("worms", two_worms({0, 0, 0}, random), {});
    FAIL() << "accepted";
  } catch (const InputError& e) {
    EXPECT_STREQ(
        e.what(),
        "worms: mesh 'worm': is bound to the skeletons of 'joint0' and 'joint0_b', which rest in one "
        "place, expected one; hint: export every character to a file of its own");
  }
}

TEST(BuildRig, HangsRigidPartsOnTheJointAboveThem) {
  Random random(20027);
  ImportedScene scene = worm(3, Eigen::Affine3d::Identity(), random);
  ImportedNode hat;
  hat.name = "hat";
  hat.parent = 3;
  hat.local.translation << 0, 0.5, 0;
  hat.local.scale << -1, 1, 1;
  hat.parent_from_node = hat.local.matrix();
  scene.nodes.push_back(hat);
  ImportedMesh mesh;
  mesh.name = "cone";
  mesh.points = lattice::Points::Identity(3, 3);
  mesh.triangles.resize(1, 3);
  mesh.triangles << 0, 1, 2;
  scene.meshes.push_back(mesh);
  scene.instances.push_back({4, 1, -1});
  const Rig rig = build_rig("worm", scene, {});
  ASSERT_EQ(rig.parts.size(), 2u);
  EXPECT_EQ(rig.parts[1].role, PartRole::Rigid);
  EXPECT_EQ(rig.skeleton.joint(rig.parts[1].joint).name, "joint2");
  // joint2 is at height 2, the hat 0.5 above it, mirrored in x.
  EXPECT_EQ(rig.parts[1].points.row(0), Eigen::RowVector3d(-1, 2.5, 0));
  EXPECT_EQ(rig.parts[1].triangles.row(0), Eigen::RowVector3i(0, 2, 1));
}

TEST(BuildRig, InventsAndCorrectsNames) {
  Random random(20028);
  ImportedScene scene = worm(4, Eigen::Affine3d::Identity(), random);
  scene.nodes[2].name = "";
  scene.nodes[3].name = "joint0";
  scene.nodes[4].name = "two\nlines";
  const Rig rig = build_rig("worm", scene, {});
  EXPECT_EQ(rig.skeleton.joint(2).name, "joint_2");
  EXPECT_EQ(rig.skeleton.joint(3).name, "joint0_2");
  EXPECT_EQ(rig.skeleton.joint(4).name, "two\\x0alines");
}

ImportedScene weights_scene(std::vector<std::vector<lattice::Influence>> weights) {
  ImportedScene scene;
  ImportedMesh mesh;
  mesh.name = "m";
  mesh.points.resize(static_cast<Eigen::Index>(weights.size()), 3);
  for (Eigen::Index v = 0; v < mesh.points.rows(); ++v) mesh.points.row(v) << static_cast<double>(v), 0, 0;
  mesh.triangles.resize(0, 3);
  mesh.weights = std::move(weights);
  scene.meshes.push_back(mesh);
  scene.instances.push_back({0, 0, 0});
  return scene;
}

TEST(Weights, AreAddedUpPerJointAndDividedByTheirSum) {
  ImportedScene scene = weights_scene({{{1, 0.25}, {0, 0.25}, {1, 0.5}}, {{0, 1.0}}});
  normalise_weights(scene);
  EXPECT_EQ(scene.meshes[0].weights[0].size(), 2u);
  EXPECT_DOUBLE_EQ(scene.meshes[0].weights[0][1].weight, 0.75);
  EXPECT_TRUE(scene.findings.empty());
}

TEST(Weights, OffTheirSumAreReportedWithTheWorstVertex) {
  ImportedScene scene = weights_scene({{{0, 0.5}}, {{0, 0.98}}, {{0, 1.005}}});
  normalise_weights(scene);
  for (const auto& influences : scene.meshes[0].weights) EXPECT_DOUBLE_EQ(influences[0].weight, 1.0);
  ASSERT_EQ(scene.findings.size(), 1u);
  EXPECT_EQ(scene.findings[0].code, "weights-normalised");
  EXPECT_THAT(scene.findings[0].message, HasSubstr("2 of 3 vertices"));
  EXPECT_THAT(scene.findings[0].message, HasSubstr("worst: 0.5 at vertex 0"));
}

TEST(Weights, MissingOnesComeFromNeighboursAlongTheMeshThenFromTheNearest) {
  // 0 - 1 - 2 hang together; 3 lies alone, nearest to 4, which is weighted; 2 is nearer to 3 but starts
  // without.
  ImportedScene scene = weights_scene({{{7, 1.0}}, {}, {}, {}, {{9, 1.0}}});
  scene.meshes[0].triangles.resize(1, 3);
  scene.meshes[0].triangles << 0, 1, 2;
  scene.meshes[0].points(3, 0) = 3.6;
  normalise_weights(scene);
  EXPECT_EQ(scene.meshes[0].weights[1][0].frame, 7);
  EXPECT_EQ(scene.meshes[0].weights[2][0].frame, 7);
  EXPECT_EQ(scene.meshes[0].weights[3][0].frame, 9);
  EXPECT_EQ(scene.findings[0].code, "weights-missing");
  EXPECT_THAT(scene.findings[0].message, HasSubstr("3 of 5 vertices"));
}

TEST(Weights, MissingEverywhereMakeTheMeshFollowItsNode) {
  ImportedScene scene = weights_scene({{}, {}});
  normalise_weights(scene);
  EXPECT_EQ(scene.instances[0].skin, -1);
  EXPECT_EQ(scene.findings[0].code, "weights-missing");
}

TEST(Units, AreTheFirstFactorThatMakesTheLongestSidePlausible) {
  const auto guess = [](double longest, double declared) {
    std::vector<Finding> findings;
    const double metres = metres_per_unit({0.5 * longest, longest}, {declared, false}, 0.0, findings);
    // A word wherever the file's own is not taken.
    EXPECT_EQ(findings.empty(), metres == declared) << longest;
    return metres;
  };
  EXPECT_EQ(guess(1.8, 1.0), 1.0);
  EXPECT_EQ(guess(180.0, 0.01), 0.01);
  EXPECT_EQ(guess(1.8, 0.01), 1.0);     // says centimetres, but is in metres
  EXPECT_EQ(guess(79.0, 1.0), 0.01);    // says metres, but is in centimetres
  EXPECT_EQ(guess(9.15, 0.0), 0.0254);  // 0.01 would make it 9 cm
  EXPECT_EQ(guess(1800.0, 0.0), 1e-3);
  EXPECT_EQ(guess(0.04, 0.0), 10.0);
  EXPECT_EQ(guess(6.9e5, 0.0), 1e-6);  // 0.69 m; 1e-5 would make it 6.9 m
  std::vector<Finding> findings;
  EXPECT_EQ(metres_per_unit({50.0, 80.0}, {1.0, false}, 2.0, findings), 0.04);
  EXPECT_EQ(metres_per_unit({0.0, 0.0}, {0.01, false}, 0.0, findings), 0.01);
}

TEST(Units, OfAStandardAreBelievedFromABeeToAGiant) {
  const auto metres = [](double longest) {
    std::vector<Finding> findings;
    // A wing that lies is hardly tall.
    return metres_per_unit({0.05 * longest, longest}, {1.0, true}, 0.0, findings);
  };
  for (const double longest : {0.011, 0.2, 1.0, 12.0, 99.0}) EXPECT_EQ(metres(longest), 1.0) << longest;
  EXPECT_EQ(metres(0.009), 100.0);
  EXPECT_EQ(metres(155.0), 0.01);
}

TEST(Units, TurnsKeepTheFrameRightHanded) {
  for (const UpAxis up : {UpAxis::X, UpAxis::Y, UpAxis::Z}) {
    const Eigen::Matrix3d turn = y_up_from(up);
    EXPECT_EQ(turn.determinant(), 1.0);
    EXPECT_EQ(turn * Eigen::Vector3d::Unit(static_cast<int>(up)), Eigen::Vector3d::UnitY());
  }
}

TEST(Decompose, GivesBackTheMapUnlessItShears) {
  Random random(20029);
  for (int trial = 0; trial < 200; ++trial) {
    skeleton::LocalTransform parts;
    parts.translation = random.vector();
    parts.rotation = random.rotation();
    parts.scale = Eigen::Vector3d(1.5 + random(), 1.5 + random(), 1.5 + random());
    if (trial % 3 == 0) parts.scale.x() *= -1.0;
    const Eigen::Affine3d map = parts.matrix();
    // An SVD of a matrix with condition below 5, then two products.
    EXPECT_LT((decompose(map).matrix().matrix() - map.matrix()).norm(),
              200 * std::numeric_limits<double>::epsilon())
        << trial;
  }
}

}  // namespace
}  // namespace sinew::assets::detail
