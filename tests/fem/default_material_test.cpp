#include "fem/material/default_material.h"

#include <cmath>

#include <gtest/gtest.h>

#include "fem/material/joint_flesh.h"

namespace sinew::fem {
namespace {

using Eigen::Vector3d;

/// A round limb of radius r along x from 0 to `length`, `rings` rings of 24 vertices and a cap at each end;
/// each vertex follows the joint before it. Joints stand at equal distances from 0 on, the last one `free`
/// before the end.
struct Limb {
  lattice::Surface skin;
  skeleton::Skeleton skeleton;
};

Limb round_limb(double r, double length, int num_joints, double free = 0.0) {
  constexpr int kAround = 24, kRings = 97;
  Limb limb;
  std::vector<skeleton::Joint> joints(static_cast<std::size_t>(num_joints));
  const double spacing = (length - free) / num_joints;
  for (int j = 0; j < num_joints; ++j) {
    skeleton::Joint& joint = joints[static_cast<std::size_t>(j)];
    joint.name = "joint" + std::to_string(j);
    joint.parent = j - 1;
    joint.rest_from_joint.translation() = Vector3d(spacing * j, 0, 0);
    joint.parent_from_joint.translation() = Vector3d(j > 0 ? spacing : 0.0, 0, 0);
    joint.local.translation = joint.parent_from_joint.translation();
  }
  limb.skeleton = skeleton::Skeleton(joints);
  limb.skin.points.resize(kAround * kRings, 3);
  limb.skin.triangles.resize(2 * kAround * (kRings - 1), 3);
  Eigen::Index t = 0;
  for (int i = 0; i < kRings; ++i) {
    const double x = length * i / (kRings - 1);
    const int joint = std::min(num_joints - 1, static_cast<int>(x / spacing));
    for (int k = 0; k < kAround; ++k) {
      const double angle = 2.0 * M_PI * k / kAround;
      limb.skin.points.row(i * kAround + k) << x, r * std::cos(angle), r * std::sin(angle);
      limb.skin.weights.push_back({{joint, 1.0}});
      if (i + 1 == kRings) continue;
      const int a = i * kAround + k, b = i * kAround + (k + 1) % kAround;
      limb.skin.triangles.row(t++) << a, b, a + kAround;
      limb.skin.triangles.row(t++) << b, b + kAround, a + kAround;
    }
  }
  return limb;
}

DefaultMaterials materials_of(const Limb& limb) {
  const std::vector<std::vector<Eigen::Affine3d>> still{std::vector<Eigen::Affine3d>(
      static_cast<std::size_t>(limb.skeleton.num_joints()), Eigen::Affine3d::Identity())};
  return default_materials({limb.skin, limb.skeleton, still});
}

// t = 0.1 m, f = 8 Hz: mu = max(16 * 1000 * 64 * 0.01, 1000 * 9.81 * 0.1 / 0.12) = max(10240, 8175) Pa; E = 2
// * 1.45 * mu. t = 0.01 m: max(102.4, 817.5). With bones thrown about at 100 m/s^2: 2 * 1000 * 100 * 0.1 =
// 20000.
TEST(DefaultYoung, SwingsOrSagsByTheRule) {
  FleshLoad load{.thickness = 0.1, .motion = 100.0};
  EXPECT_NEAR(default_young(load), 2.9 * 20000.0, 1e-8);
  load.motion = 0.0;
  EXPECT_NEAR(default_young(load), 2.9 * 10240.0, 1e-8);
  load.thickness = 0.01;
  EXPECT_NEAR(default_young(load), 2.9 * 817.5, 1e-9);
}

// A cantilever 0.5 m long and 0.2 m thick (half: 0.1): 5 * 1000 * 9.81 * 0.125 / 0.01 Pa; at 40 m/s^2 2 *
// 1000 * 40
// * 12.5. A sheet of 1 mm counts as 0.15 of its length: 5 * 1000 * 9.81 * 0.5 / 0.0225.
TEST(DefaultYoung, HoldsWhatStandsOutFromTheBone) {
  FleshLoad load{.thickness = 0.05, .half_thickness = 0.1, .overhang = 0.5};
  EXPECT_NEAR(default_young(load), 613125.0, 1e-3);
  load.motion = 40.0;
  EXPECT_NEAR(default_young(load), 1000000.0, 1e-3);
  load.motion = 0.0;
  load.half_thickness = 0.0005;
  EXPECT_NEAR(default_young(load), 1090000.0, 1e-3);
}

// 17 * 1000 * 9.81 * 0.12^3 / 0.05^2 Pa; at 40 m/s^2 7 * 1000 * 40 * 0.6912.
TEST(DefaultYoung, HoldsWhatGoesOnBeyondTheLastBone) {
  FleshLoad load{.thickness = 0.05, .half_thickness = 0.05, .tip = 0.12};
  EXPECT_NEAR(default_young(load), 115271.424, 1e-3);
  load.motion = 40.0;
  EXPECT_NEAR(default_young(load), 193536.0, 1e-3);
}

TEST(DefaultFrequency, FallsLikeTheRootOfTheSize) {
  EXPECT_NEAR(default_frequency(1.8, 30.0), 7.0, 1e-12);
  EXPECT_NEAR(default_frequency(28.8, 30.0), 1.75, 1e-12);  // 16 times as large
  EXPECT_EQ(default_frequency(0.01, 7.5), 7.5);
}

TEST(JointFlesh, MeasuresARoundLimb) {
  const Limb limb = round_limb(0.1, 2.0, 2);
  for (const JointFlesh& flesh : joint_flesh(limb.skin, limb.skeleton)) {
    // A prism of 24 sides: its vertices lie on the circle, their normals point straight outwards.
    EXPECT_NEAR(flesh.radius, 0.1, 1e-12);
    EXPECT_NEAR(flesh.half_thickness, 0.1, 2e-3);  // the tip bone ends before the end, where arms slant
    EXPECT_LE(flesh.overhang,
              0.1);  // the end, 0.2 m beyond the tip, but for a twentieth of the skin and a radius
  }
}

// The same limb has the same flesh, with however many joints: within a percent, which the tip bone takes.
TEST(DefaultMaterials, DoNotDependOnTheNumberOfJoints) {
  const double young = materials_of(round_limb(0.1, 2.0, 3)).base.young;
  for (const int joints : {2, 8, 32, 64})
    EXPECT_NEAR(materials_of(round_limb(0.1, 2.0, joints)).base.young, young, 0.01 * young) << joints;
}

TEST(DefaultMaterials, StiffenFleshThatStandsOut) {
  // A joint in the middle of the limb's first tenth holds all of it: its tip bone ends at 0.8 of the way.
  const Limb held = round_limb(0.05, 1.0, 1);
  const DefaultMaterials of_held = materials_of(held);
  ASSERT_EQ(of_held.of_joints.size(), 1u);
  const JointFlesh flesh = joint_flesh(held.skin, held.skeleton)[0];
  EXPECT_NEAR(flesh.overhang, 0.1,
              0.06);  // 0.15 m beyond the bone at 95 % of the skin, less half a thickness
  EXPECT_GT(of_held.of_joints[0].young, of_held.base.young);
}

}  // namespace
}  // namespace sinew::fem
