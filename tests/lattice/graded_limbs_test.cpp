// Cells that follow the thickness of limbs by themselves.
#include <algorithm>
#include <cmath>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lattice/box.h"
#include "lattice/detail/rig_input.h"
#include "lattice/limb_thickness.h"
#include "tests/lattice/limbs.h"
#include "tests/lattice/mirrored.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

constexpr double kTrunk = 0.4, kLeg = 0.07;  ///< radii [m].
enum Joint { kHips, kChest, kLeft, kLeftFoot, kRight, kRightFoot };

/// A stout trunk on two thin legs, its own mirror image.
tests::Character stout() {
  tests::Character c;
  c.add_joint("hips", -1, {0, 1.0, 0});
  c.add_joint("chest", kHips, {0, 1.6, 0});
  c.add_capsule(kHips, {0, 1.0, 0}, {0, 1.6, 0}, kTrunk);
  for (const double side : {-1.0, 1.0}) {
    const int leg = c.add_joint(side < 0 ? "left" : "right", kHips, {0.2 * side, 0.8, 0});
    c.add_joint(side < 0 ? "left_foot" : "right_foot", leg, {0.2 * side, 0.0, 0});
    c.add_capsule(leg, {0.2 * side, 0.8, 0}, {0.2 * side, 0.0, 0}, kLeg);
  }
  return c;
}

double ratio_of(const ControlLattice& lattice, const Surface& skin, int joint) {
  for (const LimbThickness& limb : limb_thicknesses(lattice, skin))
    if (limb.joint == joint) return limb.ratio();
  ADD_FAILURE() << "joint " << joint << " has no limb";
  return 0.0;
}

TEST(GradedLimbs, GetEdgesOfTwiceTheirThickness) {
  const tests::Character c = stout();
  const detail::RigInput input = detail::make_rig_input(c.skin, c.joints);
  const double scale = input.unit_skin.scale;
  const auto at = [&](const Vector3d& p, double h) {
    return scale * input.sizes.edge_at(input.unit_skin.to_unit(p), h / scale);
  };
  const Vector3d shin(0.2, 0.1, 0.0), breast(0, 1.5, 0.0);
  // Thicknesses count in quarters of a doubling, downward. Legs are capsules of twelve rings: their skin is
  // no farther from the bone than kLeg.
  EXPECT_NEAR(at(shin, 0.5), 4.0 * kLeg, 0.2 * 4.0 * kLeg);
  EXPECT_LE(at(shin, 0.5), 4.0 * kLeg);
  // Thick enough; what the legs let edges grow to ends there (measured 0.489).
  EXPECT_NEAR(at(breast, 0.5), 0.5, 0.02);
  EXPECT_NEAR(at(shin, 1.4), 0.4 * 1.4, 1e-12) << "the finest there is";
  EXPECT_DOUBLE_EQ(at(shin, 0.2), 0.2) << "thick enough";
  EXPECT_TRUE(input.sizes.is_uniform(0.2 / scale));
  EXPECT_FALSE(input.sizes.is_uniform(0.5 / scale));
}

TEST(GradedLimbs, YieldToTheUsersSizes) {
  const tests::Character c = stout();
  const detail::RigInput input = detail::make_rig_input(
      c.skin, c.joints, {.size_factors = {{kLeft, 1.0}, {kRight, 2.0}}, .symmetry = Symmetry::Off});
  const double scale = input.unit_skin.scale, h = 0.5 / scale;
  const auto at = [&](const Vector3d& p) { return input.sizes.edge_at(input.unit_skin.to_unit(p), h); };
  EXPECT_DOUBLE_EQ(at({-0.2, 0.1, 0.0}), h);
  EXPECT_GT(at({0.2, 0.05, 0.0}), 1.01 * h) << "twice h, as far as h at the other leg lets it grow";
}

TEST(GradedLimbs, AreThickerInCellsThanWithoutGradingAndMirrored) {
  const tests::Character c = stout();
  BuildOptions options{.cells = 300};
  const BuildResult graded = build(c.skin, c.joints, options);
  options.grade = Grade::Off;
  const BuildResult plain = build(c.skin, c.joints, options);
  EXPECT_THAT(graded.failures, testing::IsEmpty());
  EXPECT_NEAR(static_cast<double>(graded.lattice.complex.cells.size()), 300, 0.12 * 300);
  ASSERT_TRUE(graded.mirror) << graded.no_mirror;
  tests::expect_mirrored(graded.lattice, *graded.mirror);
  for (const int leg : {kLeft, kRight})
    EXPECT_GT(ratio_of(graded.lattice, c.skin, leg), 1.05 * ratio_of(plain.lattice, c.skin, leg));  // 1.11
  EXPECT_LT(ratio_of(graded.lattice, c.skin, kHips), ratio_of(plain.lattice, c.skin, kHips))
      << "where the cells come from";
}

/// A box lattice of cubes of the given side round the stout one, with its bones.
ControlLattice cubes(const tests::Character& c, double side) {
  BoxOptions box;
  box.min = Vector3d(-0.6, -0.2, -0.6);
  box.max = Vector3d(0.6, 2.4, 0.6);
  box.blocks = ((box.max - box.min) / side).array().round().cast<int>();
  ControlLattice lattice;
  lattice.complex = box_lattice(box);
  const auto add = [&](int frame, int end) {
    LatticeBone bone;
    bone.frame = frame;
    bone.rest_start = c.joints.positions.row(frame).transpose();
    bone.rest_end = c.joints.positions.row(end).transpose();
    lattice.bones.push_back(bone);
  };
  add(kHips, kChest);
  add(kLeft, kLeftFoot);
  add(kRight, kRightFoot);
  lattice.frame_of_joint = {kHips, kHips, kLeft, kLeft, kRight, kRight};
  return lattice;
}

TEST(LimbThickness, IsTwiceTheRadiusOverTheEdge) {
  tests::Character c = stout();
  const ControlLattice lattice = cubes(c, 0.2);
  for (const LimbThickness& limb : limb_thicknesses(lattice, c.skin)) {
    EXPECT_NEAR(limb.edge, 0.2, 1e-12);
    // Corners of the capsules are their radius away from the bone.
    EXPECT_NEAR(limb.thickness, limb.joint == kHips ? 2.0 * kTrunk : 2.0 * kLeg, 1e-9);
  }
  const std::optional<LimbThickness> thinnest = thinnest_limb(limb_thicknesses(lattice, c.skin));
  ASSERT_TRUE(thinnest);
  EXPECT_NEAR(thinnest->ratio(), 2.0 * kLeg / 0.2, 1e-9);
  EXPECT_THAT((std::array{kLeft, kRight}), testing::Contains(static_cast<Joint>(thinnest->joint)));
}

TEST(LimbThickness, PassesDetailsOver) {
  tests::Character c = stout();
  const int eye = c.add_joint("eye", kChest, {0, 1.9, 0.3});
  c.add_capsule(eye, {0, 1.9, 0.3}, {0, 1.9, 0.31}, 0.01);
  ControlLattice lattice = cubes(c, 0.2);
  lattice.frame_of_joint.push_back(eye);
  lattice.soft_frames.push_back({eye, {0, 1.9, 0.3}});
  const std::vector<LimbThickness> limbs = limb_thicknesses(lattice, c.skin);
  ASSERT_EQ(limbs.size(), 4u);
  EXPECT_LT(limbs.back().ratio(), 0.2);
  EXPECT_NE(thinnest_limb(limbs)->joint, eye);
}

}  // namespace
}  // namespace sinew::lattice
