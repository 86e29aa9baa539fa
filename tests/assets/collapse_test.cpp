#include "assets/collapse.h"

#include <gtest/gtest.h>

namespace sinew::assets {
namespace {

skeleton::Joint joint(const std::string& name, int parent) {
  skeleton::Joint j;
  j.name = name;
  j.parent = parent;
  return j;
}

/// A root, a limb on it that carries flesh, and a hidden prop beside it that carries none.
Rig make_rig() {
  Rig rig;
  rig.skeleton = skeleton::Skeleton({joint("root", -1), joint("limb", 0), joint("prop", 0)});
  Part part;
  part.name = "skin";
  part.role = PartRole::Simulated;
  part.points = lattice::Points::Zero(1, 3);
  part.weights = {{{1, 1.0}}};
  rig.parts = {part};
  return rig;
}

skeleton::Clip scaled(int joint, const std::vector<double>& times, const std::vector<double>& scales,
                      skeleton::Interpolation interpolation = skeleton::Interpolation::Linear) {
  skeleton::VectorTrack track;
  track.interpolation = interpolation;
  track.times = times;
  for (const double s : scales) {
    track.values.emplace_back(1.0, s, 1.0);
    if (interpolation != skeleton::Interpolation::CubicSpline) continue;
    track.in_tangents.emplace_back(0, 0, 0);
    track.out_tangents.emplace_back(0, 0, 0);
  }
  skeleton::Clip clip;
  clip.end = times.back();
  clip.channels = {{joint, std::nullopt, std::nullopt, track}};
  return clip;
}

TEST(FirstCollapse, IsFoundWhereTheScaleReachesZero) {
  const Rig rig = make_rig();
  // 1 - t reaches 0 at 1 s and is mirrored afterwards.
  const auto through = first_collapse(rig, scaled(1, {0, 2}, {1, -1}), 0.0, 2.0);
  ASSERT_TRUE(through);
  EXPECT_EQ(through->joint, 1);
  EXPECT_NEAR(through->time, 1.0, 2e-6);  // two bisection widths
  EXPECT_EQ(collapse_text(rig, *through), "joint 'limb' is scaled to nothing at 1 s");
  // A step falls to 0 at its key.
  const auto step =
      first_collapse(rig, scaled(1, {0, 0.7, 2}, {1, 0, 1}, skeleton::Interpolation::Step), 0, 2);
  ASSERT_TRUE(step);
  EXPECT_NEAR(step->time, 0.7, 2e-6);
  // From 0 on, it is there at once, and gone afterwards.
  const skeleton::Clip grows = scaled(1, {0, 1}, {0, 1});
  ASSERT_TRUE(first_collapse(rig, grows, 0.0, 1.0));
  EXPECT_EQ(first_collapse(rig, grows, 0.0, 1.0)->time, 0.0);
  EXPECT_FALSE(first_collapse(rig, grows, 0.01, 1.0));
}

TEST(FirstCollapse, OfAJointAboveTakesTheFleshAlong) {
  const auto found = first_collapse(make_rig(), scaled(0, {0, 1}, {1, 0}), 0.0, 1.0);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->joint, 0);
}

TEST(FirstCollapse, IsNoneWhereNoFleshHangsOrNothingIsScaledAway) {
  const Rig rig = make_rig();
  EXPECT_FALSE(first_collapse(rig, scaled(2, {0, 1}, {1, 0}), 0.0, 1.0));
  EXPECT_FALSE(first_collapse(rig, scaled(1, {0, 1}, {1, 0.01}), 0.0, 1.0));
  EXPECT_FALSE(first_collapse(rig, scaled(1, {0, 1}, {1, 0}), 0.0, 0.9));
  // A spline that stays between its ends.
  EXPECT_FALSE(
      first_collapse(rig, scaled(1, {0, 1, 2}, {1, 0.2, 1}, skeleton::Interpolation::CubicSpline), 0.0, 2.0));
}

}  // namespace
}  // namespace sinew::assets
