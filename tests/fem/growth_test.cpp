#include "fem/body/growth.h"

#include <gtest/gtest.h>

#include "fem/time/simulation.h"
#include "tests/fem/arm.h"

namespace sinew::fem {
namespace {

using lattice::Points;
using tests::kDegree;

/// The arm's pose with the forearm scaled about the elbow, after everything has been moved by `base`.
std::vector<Eigen::Affine3d> scaled_pose(double forearm, const Eigen::Affine3d& base, double bend = 0.0) {
  std::vector<Eigen::Affine3d> pose = tests::arm_pose(bend, base);
  const Eigen::Vector3d elbow(0.5, 0.0, 0.0);
  const Eigen::Affine3d scale =
      Eigen::Translation3d(elbow) * Eigen::Scaling(forearm) * Eigen::Translation3d(-elbow);
  pose[1] = pose[1] * scale;
  pose[2] = pose[2] * scale;
  return pose;
}

/// The arm's body, told that its joints scale.
Body growing_body(const tests::Arm& arm) {
  BodyOptions options;
  options.material.young = 5e4;
  const std::vector<std::vector<Eigen::Affine3d>> poses{tests::arm_pose(0.0), tests::arm_pose(120 * kDegree),
                                                        scaled_pose(1.5, Eigen::Affine3d::Identity())};
  return make_body({arm.lattice, arm.skin, arm.skeleton, poses}, options);
}

Eigen::Affine3d turned_and_scaled(double scale) {
  Eigen::Affine3d base(Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.6, 0.0, 0.8)));
  base.pretranslate(Eigen::Vector3d(0.3, -0.2, 0.5));
  base.scale(scale);
  return base;
}

SimulationReport held(const Body& body, const std::vector<Eigen::Affine3d>& pose, double seconds, Points& x,
                      Measures& measures) {
  SimulationOptions options;
  options.model = "blended";
  options.gravity.setZero();
  Simulation simulation(
      body, [&](double) { return pose; }, 0.0, options);
  const SimulationReport report = simulation.advance_to(seconds);
  x = simulation.flesh().x;
  measures = simulation.measures_at(simulation.flesh().time);
  return report;
}

TEST(Growth, LeavesACharacterScaledAsAWholeFreeOfEnergy) {
  const Body body = growing_body(tests::make_arm());
  for (double scale : {0.5, 1.7}) {
    const Eigen::Affine3d base = turned_and_scaled(scale);
    Points x;
    Measures measures;
    ASSERT_EQ(held(body, scaled_pose(1.0, base), 0.5, x, measures).status, SimulationStatus::Ok);
    const Points expected =
        (body.mesh.points * base.linear().transpose()).rowwise() + base.translation().transpose();
    // Rounding over 60 damped steps; without growth the flesh would shrink or swell by decimetres.
    EXPECT_LE((x - expected).cwiseAbs().maxCoeff(), 1e-12);
    // E V (1e-13)^2, against some 100 J that the scale would cost.
    EXPECT_LE(measures.elastic, 1e-20);
    EXPECT_LE(measures.largest_strain, 1e-7);
  }
}

// On a bone the grown shape is the pose without its turns: what the clip itself gives for a straight arm, on
// every level.
TEST(Growth, AgreesWithTheBones) {
  const Body body = growing_body(tests::make_arm());
  // The elbow also slides off the upper arm, which stretches that bone and no other.
  const auto slid = [](std::vector<Eigen::Affine3d> pose, const Eigen::Affine3d& base) {
    for (std::size_t j : {1, 2}) pose[j].pretranslate(base.linear() * Eigen::Vector3d(0.1, 0.02, 0.0));
    return pose;
  };
  const auto straight = slid(scaled_pose(1.4, Eigen::Affine3d::Identity()), Eigen::Affine3d::Identity());
  const auto bent = slid(scaled_pose(1.4, turned_and_scaled(1.0), 60 * kDegree), turned_and_scaled(1.0));
  const Growth grown = growth(body, pose_frames(body.tree, bent, 0.0));
  for (const BoneVertex& bone : body.bones.vertices) {
    // Rounding of positions near 1 m, turned there and back.
    EXPECT_LE((grown.shape.row(bone.vertex).transpose() - bone_position(bone, straight)).norm(), 1e-14);
  }
}

/// Linear blend skinning of the skin's own vertices by their own weights.
Points skinned(const lattice::Surface& skin, const std::vector<Eigen::Affine3d>& pose) {
  Points x = Points::Zero(skin.points.rows(), 3);
  for (Eigen::Index k = 0; k < x.rows(); ++k)
    for (const auto& [joint, weight] : skin.weights[static_cast<std::size_t>(k)])
      x.row(k) +=
          weight * (pose[static_cast<std::size_t>(joint)] * skin.points.row(k).transpose()).transpose();
  return x;
}

double rms(const Points& difference) {
  return std::sqrt(difference.squaredNorm() / static_cast<double>(difference.rows()));
}

// A joint that slides takes the bone above it along, and the skin only as far as its weights say.
TEST(Growth, LeavesTheSkinToItsWeightsWhereABoneStrays) {
  const tests::Arm arm = tests::make_arm();
  const Body body = growing_body(arm);
  std::vector<Eigen::Affine3d> pose = scaled_pose(1.4, Eigen::Affine3d::Identity());
  for (std::size_t j : {1, 2}) pose[j].pretranslate(Eigen::Vector3d(0.0, 0.0, 0.1));
  const Growth grown = growth(body, pose_frames(body.tree, pose, 0.0));
  const Points plain = skinned(arm.skin, scaled_pose(1.4, Eigen::Affine3d::Identity()));
  const double drawn = rms(body.skin.weights * grown.shape - skinned(arm.skin, pose));
  const double moved = rms(skinned(arm.skin, pose) - plain);
  // 0.15: the lattice's own weights are coarser than the skin's. A harmonic spread from the bones alone:
  // 0.43.
  EXPECT_LE(drawn, 0.25 * moved);
}

// The ball of a soft frame holds flesh that other joints have a share in: it must not draw a dent into it.
TEST(Growth, HoldsASoftFrameWhereItsFleshHasGrownTo) {
  tests::Arm arm = tests::make_arm();
  arm.lattice.soft_frames.push_back({2, {0.85, 0.06, 0.0}});
  arm.lattice.frame_of_joint[2] = 2;
  for (Eigen::Index k = 0; k < arm.skin.points.rows(); ++k)
    if (arm.skin.points(k, 0) > 0.7) arm.skin.weights[static_cast<std::size_t>(k)] = {{1, 0.7}, {2, 0.3}};
  std::vector<Eigen::Affine3d> pose = scaled_pose(1.01, Eigen::Affine3d::Identity());
  pose[2].pretranslate(Eigen::Vector3d(0.0, 0.0, 0.1));
  BodyOptions options;
  options.material.young = 5e4;
  const Body body = make_body({arm.lattice, arm.skin, arm.skeleton, {pose}}, options);
  Points x;
  Measures measures;
  ASSERT_EQ(held(body, pose, 2.0, x, measures).status, SimulationStatus::Ok);
  // 14 mm, most of it what the lattice's own weights leave; held at the frame's own place it is 38 mm.
  EXPECT_LE(rms(body.skin.weights * x - skinned(arm.skin, pose)), 0.02);
}

TEST(Growth, IsLeftOutWhereJointsOnlyTurn) {
  const Body body = tests::arm_body(tests::make_arm(), 120 * kDegree);
  EXPECT_FALSE(body.grows);
  EXPECT_TRUE(growing_body(tests::make_arm()).grows);
  EXPECT_FALSE(scales_joints(pose_frames(body.tree, tests::arm_pose(1.2, turned_and_scaled(1.0), 0.4), 0.0)));
  EXPECT_FALSE(scales_joints(pose_frames(body.tree, scaled_pose(1.0 + 1e-7, turned_and_scaled(1.0)), 0.0)));
  EXPECT_TRUE(scales_joints(pose_frames(body.tree, scaled_pose(1.001, turned_and_scaled(1.0)), 0.0)));
}

/// Mean distance of the skin from the axis of the forearm, between x = 0.7 and 0.8 at rest.
double girth(const tests::Arm& arm, const Body& body, const Points& x) {
  const Points skin = body.skin.weights * x;
  double sum = 0.0;
  int count = 0;
  for (Eigen::Index k = 0; k < skin.rows(); ++k) {
    if (std::abs(arm.skin.points(k, 0) - 0.75) > 0.051) continue;
    sum += skin.row(k).tail<2>().norm();
    ++count;
  }
  return sum / count;
}

TEST(Growth, ThickensALimbWithItsJoint) {
  const tests::Arm arm = tests::make_arm();
  const Body body = growing_body(arm);
  Points rest, scaled;
  Measures measures;
  ASSERT_EQ(held(body, tests::arm_pose(0.0), 0.1, rest, measures).status, SimulationStatus::Ok);
  ASSERT_EQ(held(body, scaled_pose(1.4, Eigen::Affine3d::Identity()), 2.0, scaled, measures).status,
            SimulationStatus::Ok);
  // The middle of the forearm is half its length away from flesh that did not grow: all but 2 % of 1.4.
  EXPECT_NEAR(girth(arm, body, scaled) / girth(arm, body, rest), 1.4, 0.03);
  EXPECT_EQ(measures.inverted_cells, 0);
}

}  // namespace
}  // namespace sinew::fem
