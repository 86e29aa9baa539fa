#include "lattice/detail/skeleton_reduction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lattice/detail/rig_input.h"
#include "lattice/detail/skeleton_distance.h"
#include "tests/lattice/limbs.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;
using testing::ElementsAre;

/// A body from y = 0 to 2 whose longest side is 2, so that unit lengths are half of these.
tests::Character body() {
  tests::Character c;
  c.add_joint("hips", -1, {0, 0.3, 0});
  c.add_joint("chest", 0, {0, 1.0, 0});
  c.add_capsule(0, {0, 0.3, 0}, {0, 1.0, 0}, 0.3);
  c.add_capsule(1, {0, 1.0, 0}, {0, 1.7, 0}, 0.3);
  return c;
}

ReducedSkeleton reduce(const tests::Character& c, double h) {
  const RigInput input = make_rig_input(c.skin, c.joints);
  return reduce_skeleton(input.unit_skin, input.unit_joints, input.weights, h, {});
}

std::vector<std::string> changes(const ReducedSkeleton& skeleton) {
  std::vector<std::string> list;
  for (const SkeletonChange& change : skeleton.changes) list.push_back(change.joint + " " + change.what);
  return list;
}

std::vector<std::string> names(const ReducedSkeleton& skeleton) {
  std::vector<std::string> list;
  for (const ReducedBone& bone : skeleton.bones) list.push_back(bone.name);
  return list;
}

TEST(SkeletonReduction, GivesAWeightedLeafATipBoneOfFourFifthsOfItsReach) {
  const ReducedSkeleton skeleton = reduce(body(), 0.2);
  EXPECT_THAT(names(skeleton), ElementsAre("hips", "chest"));
  ASSERT_TRUE(skeleton.bones[1].tip);
  // The chest's skin reaches from y = 1 to 2: the tip is 0.8 long, 0.4 in unit coordinates.
  const double length =
      (skeleton.nodes[skeleton.bones[1].end].position - skeleton.nodes[skeleton.bones[1].start].position)
          .norm();
  EXPECT_NEAR(length, 0.4, 1e-3);  // the centroid's direction is within a few degrees of the axis
  EXPECT_THAT(changes(skeleton), ElementsAre("chest tip"));
}

TEST(SkeletonReduction, PrunesJointsWithoutSkin) {
  tests::Character c = body();
  c.add_joint("ik_target", 0, {3, 0, 0});
  c.add_joint("chest_end", 1, {0, 1.9, 0});
  const ReducedSkeleton skeleton = reduce(c, 0.2);
  EXPECT_THAT(names(skeleton), ElementsAre("hips", "chest"));
  EXPECT_THAT(changes(skeleton), ElementsAre("ik_target pruned", "chest_end pruned", "chest tip"));
}

TEST(SkeletonReduction, PrunesAWeightlessRootThatDoesNotBranch) {
  tests::Character c;
  c.add_joint("root", -1, {0, -5, 0});
  c.add_joint("hips", 0, {0, 0.3, 0});
  c.add_joint("chest", 1, {0, 1.0, 0});
  c.add_capsule(1, {0, 0.3, 0}, {0, 1.0, 0}, 0.3);
  c.add_capsule(2, {0, 1.0, 0}, {0, 1.7, 0}, 0.3);
  const ReducedSkeleton skeleton = reduce(c, 0.2);
  EXPECT_THAT(names(skeleton), ElementsAre("hips", "chest"));
  EXPECT_THAT(changes(skeleton), testing::Contains("root pruned"));
}

TEST(SkeletonReduction, CutsABoneThatRunsOutsideTheSkin) {
  tests::Character c = body();
  // A second body 2 to the right, hung on the first by a bone through the air.
  const int other = c.add_joint("far", 1, {2, 1.0, 0});
  c.add_capsule(other, {2, 1.0, 0}, {2, 1.7, 0}, 0.3);
  const ReducedSkeleton skeleton = reduce(c, 0.15);
  EXPECT_THAT(changes(skeleton), testing::Contains("far cut"));
  for (const ReducedBone& bone : skeleton.bones)
    EXPECT_LT((skeleton.nodes[bone.end].position - skeleton.nodes[bone.start].position).norm(), 0.6)
        << bone.name;
}

TEST(SkeletonReduction, ContractsShortBonesAndKeepsTheirFrames) {
  tests::Character c = body();
  const int shoulder = c.add_joint("shoulder", 1, {0.05, 1.0, 0});
  const int hand = c.add_joint("hand", shoulder, {0.9, 1.0, 0});
  c.add_capsule(shoulder, {0.05, 1.0, 0}, {0.9, 1.0, 0}, 0.12);
  c.add_capsule(hand, {0.9, 1.0, 0}, {1.1, 1.0, 0}, 0.12);
  const ReducedSkeleton skeleton = reduce(c, 0.2);
  EXPECT_THAT(changes(skeleton), testing::Contains("shoulder contracted"));
  const auto bone = std::find_if(skeleton.bones.begin(), skeleton.bones.end(),
                                 [&](const ReducedBone& b) { return b.frame == shoulder; });
  ASSERT_NE(bone, skeleton.bones.end());
  EXPECT_EQ(skeleton.nodes[bone->start].joint, 1);  // starts at the chest, moved by the chest
  EXPECT_EQ(skeleton.nodes[bone->end].joint, hand);
}

TEST(SkeletonReduction, ChainsSiblingsThatNearlyCoincide) {
  tests::Character c = body();
  const int near = c.add_joint("near", 0, {0.7, 0.3, 0});
  const int far = c.add_joint("far", 0, {1.4, 0.32, 0});
  c.add_capsule(near, {0.1, 0.3, 0}, {0.8, 0.3, 0}, 0.2);
  c.add_capsule(far, {1.4, 0.32, 0}, {1.9, 0.32, 0}, 0.2);
  c.add_capsule(0, {0.1, 0.3, 0}, {1.4, 0.3, 0}, 0.2);
  const ReducedSkeleton skeleton = reduce(c, 0.15);
  EXPECT_THAT(changes(skeleton), testing::Contains("far chained"));
  const auto bone = std::find_if(skeleton.bones.begin(), skeleton.bones.end(), [&](const ReducedBone& b) {
    return !b.tip && skeleton.nodes[b.end].joint == far;
  });
  ASSERT_NE(bone, skeleton.bones.end());
  EXPECT_EQ(skeleton.nodes[bone->start].joint, near);
  EXPECT_EQ(bone->frame, 0);
}

TEST(SkeletonReduction, ChainsNoLegBehindTheOther) {
  // At edges of 0.55 the hips are one node with the pelvis, and the thighs leave it 18 degrees apart: a thigh
  // cannot go on from the knee of the other leg.
  const tests::Character legs = tests::two_legs();
  const RigInput input = make_rig_input(legs.skin, legs.joints, {.symmetry = Symmetry::Off});
  const ReducedSkeleton skeleton =
      reduce_skeleton(input.unit_skin, input.unit_joints, input.weights, 0.55 / input.unit_skin.scale, {});
  EXPECT_THAT(changes(skeleton), testing::Contains("right_hip contracted"));
  EXPECT_THAT(changes(skeleton), testing::Not(testing::Contains(testing::HasSubstr("chained"))));
  int soft = 0;
  for (const ReducedBone& bone : skeleton.bones) {
    soft += bone.soft;
    const Vector3d from = skeleton.nodes[bone.start].position, to = skeleton.nodes[bone.end].position;
    EXPECT_GE(from.x() * to.x(), 0.0) << bone.name << " runs from leg to leg";
  }
  EXPECT_EQ(soft, 1);
}

TEST(SkeletonReduction, SoftensOneOfTwoBonesThatCross) {
  tests::Character c = body();
  const int a = c.add_joint("strut_a", -1, {-0.25, 0.6, 0});
  const int b = c.add_joint("strut_b", a, {0.25, 0.62, 0});
  c.add_capsule(a, {-0.2, 0.6, 0}, {0.2, 0.62, 0}, 0.1);
  c.add_capsule(b, {0.2, 0.62, 0}, {0.21, 0.62, 0}, 0.1);
  const ReducedSkeleton skeleton = reduce(c, 0.2);
  EXPECT_THAT(changes(skeleton), testing::Contains("strut_a soft"));
  const auto bone = std::find_if(skeleton.bones.begin(), skeleton.bones.end(),
                                 [&](const ReducedBone& x) { return x.frame == a && !x.tip; });
  ASSERT_NE(bone, skeleton.bones.end());
  EXPECT_TRUE(bone->soft);
}

TEST(FrameOfJoint, IsTheNearestAncestorElseTheNearestDescendantElseAny) {
  //        0 - 1 - 2(frame) - 3      4 - 5
  const std::vector<int> parents{-1, 0, 1, 2, -1, 4};
  EXPECT_THAT(frame_of_joint(parents, {2}), ElementsAre(2, 2, 2, 2, 2, 2));
  EXPECT_THAT(frame_of_joint(parents, {1, 2, 5}), ElementsAre(1, 1, 2, 2, 5, 5));
  EXPECT_THAT(frame_of_joint(parents, {}), ElementsAre(-1, -1, -1, -1, -1, -1));
}

TEST(SkeletonDistance, RunsAlongTheBones) {
  // A T: node 0 in the middle, bones of length 1, 2 and 3.
  ReducedSkeleton skeleton;
  skeleton.nodes = {{0, {0, 0, 0}}, {1, {1, 0, 0}}, {2, {-2, 0, 0}}, {3, {0, 3, 0}}};
  for (int end = 1; end <= 3; ++end) {
    ReducedBone bone;
    bone.start = 0;
    bone.end = end;
    skeleton.bones.push_back(bone);
  }
  const SkeletonDistance distance(skeleton);
  EXPECT_NEAR(distance.between({0, 0.5, 1.0}, {1, 0.25, 0.5}), 0.5 + 0.5, 1e-15);
  EXPECT_NEAR(distance.between({2, 0.0, 0.1}, {2, 0.4, 0.6}), 0.9, 1e-15);
  EXPECT_EQ(distance.between({2, 0.0, 0.5}, {2, 0.4, 0.6}), 0.0);
}

}  // namespace
}  // namespace sinew::lattice::detail
