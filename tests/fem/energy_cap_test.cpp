#include "fem/time/energy_cap.h"

#include <cmath>

#include <gtest/gtest.h>

#include "fem/body/placement.h"
#include "fem/report/measures.h"
#include "fem/time/simulation.h"
#include "tests/fem/arm.h"

namespace sinew::fem {
namespace {

using lattice::Points;

const Eigen::Vector3d kWeight(0.0, -9.81, 0.0);

/// An arm bent by 60 degrees, as skinned, and again with all of its flesh off by some millimetres.
struct BentArm {
  Body body =
      tests::arm_body(tests::make_arm(lattice::CellType::Hexahedron, 0, 6, 2), 60.0 * tests::kDegree, {});
  PosedFrames pose = pose_frames(body.tree, tests::arm_pose(60.0 * tests::kDegree), 0.0);
  State at, off;

  BentArm() {
    at.x = skinned_positions(body, pose);
    at.v = Points::Zero(at.x.rows(), 3);
    off = at;
    for (Eigen::Index a = 0; a < at.x.rows(); ++a)
      off.x.row(a) += 5e-3 * Eigen::RowVector3d(std::sin(3.0 * a), std::sin(5.0 * a), std::sin(7.0 * a));
    place_bones(body, pose, off.x);
  }
  double energy(const State& state) const {
    return kinetic_energy(body, state.v) + StoredEnergy(body, pose, kWeight).of(state.x);
  }
};

TEST(StoredEnergy, IsWhatAFrameReports) {
  const BentArm arm;
  const Measures m = measure(arm.body, arm.off.x, arm.off.v, arm.pose, kWeight);
  EXPECT_GT(m.ties, 0.0);
  // Sums of some thousand terms, in another order.
  EXPECT_NEAR(StoredEnergy(arm.body, arm.pose, kWeight).of(arm.off.x),
              m.elastic + m.ties + m.ghost + m.potential,
              1e-12 * (m.elastic + m.ties + std::abs(m.potential)));
}

TEST(EnergyCap, TakesWhatIsTooMuchFromTheVelocity) {
  const BentArm arm;
  EnergyCap cap(arm.body, kWeight);
  State before = arm.off, after = arm.at;
  after.v.setConstant(10.0);
  const double wanted = arm.energy(after);
  ASSERT_GT(wanted, arm.energy(before));
  cap.limit(before, arm.pose, arm.pose, nullptr, after);
  EXPECT_EQ(after.x, arm.at.x);
  EXPECT_EQ(cap.taken().steps, 1);
  EXPECT_NEAR(cap.taken().energy, wanted - arm.energy(after), 1e-12 * wanted);
  // The root of a ratio, squared again.
  EXPECT_NEAR(arm.energy(after), arm.energy(before), 1e-12 * arm.energy(before));
  EXPECT_NEAR(after.v.maxCoeff(), after.v.minCoeff(), 1e-15);  // in proportion
}

TEST(EnergyCap, StopsFleshOnItsWayWhereTheVelocityHasTooLittle) {
  const BentArm arm;
  EnergyCap cap(arm.body, kWeight);
  State before = arm.at, after = arm.off;
  before.v.setConstant(0.1);
  after.v.setConstant(0.1);
  const double most = arm.energy(before), wanted = arm.energy(after);
  ASSERT_GT(StoredEnergy(arm.body, arm.pose, kWeight).of(after.x), most);
  cap.limit(before, arm.pose, arm.pose, nullptr, after);
  EXPECT_EQ(after.v.norm(), 0.0);
  EXPECT_LE(arm.energy(after), most * (1.0 + 1e-14));
  EXPECT_NEAR(cap.taken().energy, wanted - arm.energy(after), 1e-12 * wanted);
  // On the way, neither at its begin nor at its end.
  EXPECT_GT((after.x - arm.at.x).norm(), 0.0);
  EXPECT_LT((after.x - arm.at.x).norm(), (arm.off.x - arm.at.x).norm());
}

TEST(EnergyCap, RemembersTheEnergyWithWhichTheBonesStopped) {
  const BentArm arm;
  EnergyCap cap(arm.body, kWeight);
  State rest = arm.at, first = arm.off;
  State low = rest, again = arm.at;
  cap.limit(first, arm.pose, arm.pose, nullptr, low);  // falls below what it had
  EXPECT_EQ(low.x, rest.x);
  EXPECT_EQ(cap.taken().steps, 0);
  again.v.setConstant(10.0);
  cap.limit(low, arm.pose, arm.pose, nullptr, again);  // and may come back to it
  EXPECT_NEAR(arm.energy(again), arm.energy(first), 1e-12 * arm.energy(first));
}

TEST(EnergyCap, ForgetsItWhereABoneMoves) {
  const BentArm arm;
  const PosedFrames earlier = pose_frames(arm.body.tree, tests::arm_pose(59.9 * tests::kDegree), 0.0);
  EnergyCap cap(arm.body, kWeight);
  State low = arm.at, again = arm.at;
  cap.limit(arm.off, arm.pose, arm.pose, nullptr, low);  // much energy
  cap.limit(low, earlier, arm.pose, nullptr, low);
  again.v.setConstant(10.0);
  cap.limit(low, arm.pose, arm.pose, nullptr, again);
  EXPECT_NEAR(arm.energy(again), arm.energy(low), 1e-12 * arm.energy(arm.off));
}

TEST(EnergyCap, LeavesWhatForcesAndBonesPutIn) {
  const BentArm arm;
  State before = arm.at, after = arm.off;
  after.v.setConstant(0.3);
  const State wanted = after;
  // A force that does twice the work that the flesh gains.
  const Points moved = after.x - before.x;
  const Points force = moved * (2.0 * (arm.energy(after) - arm.energy(before)) / moved.squaredNorm());
  EnergyCap pushed(arm.body, kWeight);
  pushed.limit(before, arm.pose, arm.pose, &force, after);
  EXPECT_EQ(after.v, wanted.v);

  const PosedFrames earlier = pose_frames(arm.body.tree, tests::arm_pose(59.9 * tests::kDegree), 0.0);
  EnergyCap carried(arm.body, kWeight);
  carried.limit(before, earlier, arm.pose, nullptr, after);
  EXPECT_EQ(after.v, wanted.v);
  carried.limit(before, arm.pose, arm.pose, nullptr, after);
  EXPECT_NE(after.v, wanted.v);
}

// One region is passive, and so is every other rung: nobody pays for the cap there, or feels it.
TEST(EnergyCap, IsForBlendedFleshOfSeveralRegions) {
  const BentArm arm;
  for (const ModelInfo& model : models())
    EXPECT_EQ(model.make(arm.body, {})->may_gain_energy(), model.name == "blended") << model.name;
}

}  // namespace
}  // namespace sinew::fem
