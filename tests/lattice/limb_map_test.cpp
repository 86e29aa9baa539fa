#include "lattice/detail/limb_map.h"

#include <gtest/gtest.h>

#include "lattice/detail/symmetry.h"
#include "tests/lattice/limbs.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// An arm at either side of a trunk, of skew quads: the vertices are mirror images of each other, the quads'
/// diagonals are not.
tests::Character two_arms() {
  tests::Character c;
  const int trunk = c.add_joint("trunk", -1, {0, 0, 0});
  c.add_joint("head", trunk, {0, 0.6, 0});
  c.add_capsule(trunk, {0, 0, 0}, {0, 0.6, 0}, 0.2);
  for (const double side : {-1.0, 1.0}) {
    const int shoulder = c.add_joint(side < 0 ? "left" : "right", trunk, {0.2 * side, 0.3, 0});
    c.add_joint(side < 0 ? "left_tip" : "right_tip", shoulder, {1.0 * side, 0.3, 0});
    c.add_capsule(shoulder, {0.2 * side, 0.3, 0}, {1.0 * side, 0.3, 0}, 0.12);
  }
  for (Eigen::Index v = 0; v < c.skin.points.rows(); ++v)
    c.skin.points(v, 1) += 0.03 * std::sin(8.0 * std::abs(c.skin.points(v, 0)) + 9.0 * c.skin.points(v, 2));
  return c;
}

// Between two diagonals of one quad there is flesh at one side alone: it counts at both, and in the image's
// frames.
TEST(LimbMap, SeesFleshOfAMirroredRigAtBothSides) {
  const tests::Character arms = two_arms();
  const RigInput input = make_rig_input(arms.skin, arms.joints);
  ASSERT_TRUE(input.mirror) << input.no_mirror;
  const ReducedSkeleton skeleton =
      reduce_skeleton(input.unit_skin, input.unit_joints, input.weights, 0.2, {}, input.mirror_joint());
  const ControlLattice lattice = build(arms.skin, arms.joints, {.cells = 100}).lattice;
  const LimbMap map(input, skeleton, lattice, faces_of(lattice.complex));
  const UnitSkin& skin = input.unit_skin;
  int at_one_side = 0;
  for (Eigen::Index t = 0; t < skin.triangles.rows(); ++t) {
    const auto corner = [&](int k) -> Vector3d {
      return skin.points.row(skin.triangles(t, k % 3)).transpose();
    };
    const Vector3d normal = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
    for (int k = 0; k < 3; ++k) {
      const Vector3d a = corner(k), b = corner(k + 1);
      // Into the skin by a thousandth of an edge.
      const Vector3d p = 0.5 * (a + b) - 1e-3 * (b - a).norm() * normal;
      if (skin.is_inside(p) == skin.is_inside(reflected(p))) continue;
      ++at_one_side;
      const std::vector<Limb> here = map.flesh_at(p), there = map.flesh_at(reflected(p));
      ASSERT_EQ(here.size(), 1u) << p.transpose();
      ASSERT_EQ(there.size(), 1u) << p.transpose();
      ASSERT_EQ(here[0].size(), there[0].size());
      for (std::size_t i = 0; i < here[0].size(); ++i)
        EXPECT_EQ(here[0][i].frame, input.mirror->joint[static_cast<std::size_t>(there[0][i].frame)]);
    }
  }
  EXPECT_GE(at_one_side, 10);
}

}  // namespace
}  // namespace sinew::lattice::detail
