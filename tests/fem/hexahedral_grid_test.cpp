// A rig on the plain grid of cubes: soft bones hold the flesh without one vertex that is known.
#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "fem/time/simulation.h"
#include "lattice/build.h"
#include "tests/fem/arm.h"
#include "tests/lattice/shapes.h"

namespace sinew::fem {
namespace {

using Eigen::Vector3d;
using lattice::Points;

/// The arm of arm.h in a grid that the builder makes of its skin.
struct GridArm {
  tests::Arm arm = tests::make_arm();
  Body body = [this] {
    lattice::JointTree joints;
    joints.positions.resize(3, 3);
    for (int j = 0; j < 3; ++j) {
      joints.positions.row(j) = arm.skeleton.joint(j).rest_from_joint.translation().transpose();
      joints.parents.push_back(j - 1);
      joints.names.push_back(arm.skeleton.joint(j).name);
    }
    lattice::BuildOptions options;
    options.cells = 100;
    options.construction = lattice::Construction::Grid;
    const lattice::BuildResult result = lattice::build(arm.skin, joints, options);
    EXPECT_TRUE(result.failures.empty());
    arm.lattice = result.lattice;
    return tests::arm_body(arm, 60 * tests::kDegree);
  }();

  /// Points on the bones, 0.05 apart.
  Points bone_points() const {
    Points points(19, 3);
    for (int i = 0; i < 19; ++i) points.row(i) << 0.05 * (i + 1), 0.0, 0.0;
    return points;
  }
};

TEST(GridOfCubes, SoftBonesCarryABendingArm) {
  const GridArm grid;
  for (const lattice::LatticeBone& bone : grid.body.lattice.bones) EXPECT_TRUE(bone.soft);
  const auto motion = [](double time) {
    return tests::arm_pose(60 * tests::kDegree * tests::smooth_step(time / 0.5));
  };
  Simulation simulation(grid.body, motion, 0.0, {});
  ASSERT_EQ(simulation.settle().status, SimulationStatus::Ok);
  const lattice::Embedding bones = lattice::embed(grid.body.mesh, grid.bone_points());
  double farthest = 0.0;
  for (int frame = 1; frame <= 24; ++frame) {
    const double time = frame / 24.0;
    ASSERT_EQ(simulation.advance_to(time).status, SimulationStatus::Ok);
    const Points x = bones.weights * simulation.positions_at(time);
    for (int i = 0; i < x.rows(); ++i) {
      const double r = 0.05 * (i + 1);
      const Eigen::Affine3d joint = motion(time)[r < 0.5 ? 0 : 1];
      farthest = std::max(farthest, (x.row(i).transpose() - joint * Vector3d(r, 0.0, 0.0)).norm());
    }
  }
  // Measured 0.013, a seventh of the arm's half thickness: the flesh cannot follow the kink at the elbow.
  EXPECT_LT(farthest, 0.02);
}

TEST(GridOfCubes, HoldsStillAtRestWithoutGravity) {
  const GridArm grid;
  SimulationOptions options;
  options.model = "blended";
  options.gravity.setZero();
  Simulation simulation(
      grid.body, [](double) { return tests::arm_pose(0.0); }, 0.0, options);
  ASSERT_EQ(simulation.settle().status, SimulationStatus::Ok);
  ASSERT_EQ(simulation.advance_to(1.0).status, SimulationStatus::Ok);
  // Rounding of 120 steps on positions of size 1.
  EXPECT_LE((simulation.positions_at(1.0) - grid.body.mesh.points).rowwise().norm().maxCoeff(), 1e-12);
}

}  // namespace
}  // namespace sinew::fem
