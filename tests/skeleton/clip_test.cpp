#include "skeleton/clip.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

namespace sinew::skeleton {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

Eigen::Quaterniond about_y(double angle) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()));
}

VectorTrack ramp(Interpolation interpolation) {
  VectorTrack track;
  track.interpolation = interpolation;
  track.times = {1.0, 3.0};
  track.values = {{0, 0, 0}, {4, 8, -2}};
  return track;
}

TEST(VectorTrack, HoldsItsEndsAndIsLinearBetween) {
  const VectorTrack track = ramp(Interpolation::Linear);
  EXPECT_EQ(sample(track, 0.0), Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(sample(track, 1.0), Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(sample(track, 1.5), Eigen::Vector3d(1, 2, -0.5));
  EXPECT_EQ(sample(track, 3.0), Eigen::Vector3d(4, 8, -2));
  EXPECT_EQ(sample(track, 99.0), Eigen::Vector3d(4, 8, -2));
}

TEST(VectorTrack, StepHoldsUntilTheNextKey) {
  const VectorTrack track = ramp(Interpolation::Step);
  EXPECT_EQ(sample(track, std::nextafter(3.0, 0.0)), Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(sample(track, 3.0), Eigen::Vector3d(4, 8, -2));
}

TEST(VectorTrack, OneKeyIsAConstant) {
  VectorTrack track;
  track.times = {5.0};
  track.values = {{1, 2, 3}};
  for (const double t : {-1.0, 5.0, 6.0}) EXPECT_EQ(sample(track, t), Eigen::Vector3d(1, 2, 3));
}

TEST(Clip, MovesEvenlyBetweenItsKeyTimes) {
  Clip clip;
  clip.channels.resize(2);
  clip.channels[0].joint = 0;
  clip.channels[0].translation = ramp(Interpolation::Linear);  // keys at 1 and 3
  clip.channels[1].joint = 1;
  clip.channels[1].scale = ramp(Interpolation::Step);
  clip.channels[1].scale->times = {1.0, 1.5};
  const std::vector<double> times = key_times(clip);
  ASSERT_EQ(times.size(), 4U);
  EXPECT_EQ(times[0], 1.0);
  // A track of steps is constant until just before its key, and jumps between that and the key.
  EXPECT_EQ(sample(*clip.channels[1].scale, times[1]), clip.channels[1].scale->values[0]);
  EXPECT_NEAR(times[1], 1.5, 1e-5);
  EXPECT_LT(times[1], 1.5);
  EXPECT_EQ(times[2], 1.5);
  EXPECT_EQ(times[3], 3.0);
  EXPECT_TRUE(key_times({}).empty());
}

TEST(Clip, HasItsKeysAsFarApartAsMostOfThem) {
  Clip clip;
  EXPECT_EQ(key_interval(clip), 0.0);
  clip.channels.resize(2);
  clip.channels[0].translation = ramp(Interpolation::Linear);
  EXPECT_EQ(key_interval(clip), 2.0);
  clip.channels[1].scale = ramp(Interpolation::Linear);
  clip.channels[1].scale->times = {0.0, 0.25, 0.5, 1.5};
  EXPECT_EQ(key_interval(clip), 1.0);  // of 0.25, 0.25, 1 and 2 the larger one in the middle
}

TEST(VectorTrack, CubicSplineReproducesACubic) {
  // p(t) = t^3 - 2 t^2 + 3 t - 1 has tangents 3 t^2 - 4 t + 3: the Hermite spline through its keys is itself.
  const auto p = [](double t) { return ((t - 2) * t + 3) * t - 1; };
  const auto slope = [](double t) { return (3 * t - 4) * t + 3; };
  VectorTrack track;
  track.interpolation = Interpolation::CubicSpline;
  track.times = {-1.0, 0.5, 2.5};
  for (const double t : track.times) {
    track.values.emplace_back(p(t), 0, 0);
    track.in_tangents.emplace_back(slope(t), 0, 0);
    track.out_tangents.emplace_back(slope(t), 0, 0);
  }
  for (double t = -1.0; t <= 2.5; t += 0.125) {
    // About 20 rounded operations on terms no larger than 10.
    EXPECT_NEAR(sample(track, t).x(), p(t), 200 * kEps) << "t = " << t;
  }
}

TEST(RotationTrack, TurnsAtConstantSpeedAboutTheAxisBetweenItsKeys) {
  std::mt19937_64 rng(20021);
  const auto uniform = [&rng] { return static_cast<double>(rng() >> 11) * 0x1.0p-53 * 2.0 - 1.0; };
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector3d axis = Eigen::Vector3d(uniform(), uniform(), uniform()).normalized();
    const double angle = 3.0 * uniform();
    const Eigen::Quaterniond base =
        Eigen::Quaterniond(uniform(), uniform(), uniform(), uniform()).normalized();
    RotationTrack track;
    track.times = {0.0, 2.0};
    track.values = {base, Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)) * base};
    if (track.values[0].dot(track.values[1]) < 0) track.values[1].coeffs() *= -1;
    const double u = 0.5 * (uniform() + 1.0);
    // Independent: Rodrigues' rotation by a share of the angle, as matrices.
    const Eigen::Matrix3d expected =
        Eigen::AngleAxisd(u * angle, axis).toRotationMatrix() * base.toRotationMatrix();
    const Eigen::Matrix3d got = sample(track, 2.0 * u).toRotationMatrix();
    // acos near 1 loses half the digits for small angles: its error times the angle stays below 1e-12.
    EXPECT_LT((got - expected).norm(), 1e-12) << "trial " << trial;
  }
}

// Two keys say where a turn ends and not how often it goes round: half-way stands half of what is left of
// whole turns, the shorter way, and at half a turn the way of the keys' quaternions.
TEST(RotationTrack, GoesTheShorterWayFromKeyToKey) {
  for (const double degrees : {1.0, 30.0, 90.0, 179.0, 180.0, 181.0, 270.0, 359.0, 720.0}) {
    const double turn = degrees * std::numbers::pi / 180.0;
    RotationTrack track;
    track.times = {0.0, 1.0 / 30.0};
    track.values = {about_y(0.0), about_y(turn)};
    const double half = 0.5 * (degrees - 360.0 * std::ceil(degrees / 360.0 - 0.5)) * std::numbers::pi / 180.0;
    Eigen::Matrix3d expected = Eigen::Matrix3d::Identity();
    expected(0, 0) = expected(2, 2) = std::cos(half);
    expected(0, 2) = std::sin(half);
    expected(2, 0) = -std::sin(half);
    EXPECT_LT((sample(track, 1.0 / 60.0).toRotationMatrix() - expected).norm(), 1e-12) << degrees;
  }
  // The other sign of a quaternion is the same key; at half a turn alone it is the other way.
  RotationTrack back;
  back.times = {0.0, 1.0};
  back.values = {about_y(0.0), about_y(-std::numbers::pi)};
  EXPECT_LT((sample(back, 0.5) * Eigen::Vector3d::UnitZ() + Eigen::Vector3d::UnitX()).norm(), 1e-12);
}

TEST(RotationTrack, CubicSplineIsUnitAndMeetsItsKeys) {
  RotationTrack track;
  track.interpolation = Interpolation::CubicSpline;
  track.times = {0.0, 1.0};
  track.values = {about_y(0.0), about_y(2.0)};
  track.in_tangents = track.out_tangents = {Eigen::Vector4d(0, 1, 0, 0), Eigen::Vector4d(0, 1, 0, 0)};
  for (double t = 0.0; t <= 1.0; t += 0.1) EXPECT_NEAR(sample(track, t).norm(), 1.0, 10 * kEps);
  EXPECT_LT(sample(track, 0.0).angularDistance(track.values[0]), 1e-7);
  EXPECT_LT(sample(track, 1.0).angularDistance(track.values[1]), 1e-7);
}

TEST(RotationTrack, WithoutKeysIsRefused) {
  EXPECT_THROW(sample(RotationTrack{}, 0.0), std::invalid_argument);
}

Skeleton two_joints() {
  Joint root;
  root.name = "root";
  root.local.translation << 0, 1, 0;
  root.parent_from_joint = root.local.matrix();
  Joint tip;
  tip.name = "tip";
  tip.parent = 0;
  tip.local.translation << 1, 0, 0;
  tip.local.scale << 2, 2, 2;
  tip.parent_from_joint = tip.local.matrix();
  return Skeleton({root, tip});
}

TEST(Clip, LeavesWhatItDoesNotAnimateAtTheJointsOwnValue) {
  Clip clip;
  clip.name = "turn";
  clip.end = 1.0;
  RotationTrack turn;
  turn.times = {0.0, 1.0};
  turn.values = {about_y(0.0), about_y(std::numbers::pi / 2)};
  clip.channels.push_back({0, std::nullopt, turn, std::nullopt});
  const Pose pose = sample(two_joints(), clip, 1.0);
  // The root keeps its height; the tip, 1 m along x, is carried to -z; its own scale of 2 remains.
  EXPECT_LT((pose.world_from_joint[0].translation() - Eigen::Vector3d(0, 1, 0)).norm(), 10 * kEps);
  EXPECT_LT((pose.world_from_joint[1].translation() - Eigen::Vector3d(0, 1, -1)).norm(), 10 * kEps);
  EXPECT_NEAR(pose.world_from_joint[1].linear().determinant(), 8.0, 100 * kEps);
}

TEST(Clip, KeepsTheShearOfJointsThatNoChannelMoves) {
  Joint sheared;
  sheared.name = "sheared";
  sheared.parent_from_joint.linear()(0, 1) = 0.5;
  const Skeleton skeleton({sheared});
  EXPECT_EQ(sample(skeleton, Clip{}, 0.0).world_from_joint[0].linear()(0, 1), 0.5);
  Clip empty_channel;
  empty_channel.channels.push_back({0, std::nullopt, std::nullopt, std::nullopt});
  EXPECT_EQ(sample(skeleton, empty_channel, 0.0).world_from_joint[0].linear()(0, 1), 0.5);
}

TEST(Clip, RefusesAChannelForAJointThatIsNotThere) {
  Clip clip;
  clip.channels.push_back({2, std::nullopt, std::nullopt, std::nullopt});
  EXPECT_THROW(sample(two_joints(), clip, 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace sinew::skeleton
