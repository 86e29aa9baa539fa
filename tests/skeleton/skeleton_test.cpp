#include "skeleton/skeleton.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sinew::skeleton {
namespace {

using testing::HasSubstr;

constexpr double kEps = std::numeric_limits<double>::epsilon();

Joint joint(const std::string& name, int parent, const Eigen::Vector3d& offset) {
  Joint j;
  j.name = name;
  j.parent = parent;
  j.local.translation = offset;
  j.parent_from_joint = j.local.matrix();
  return j;
}

/// Upper arm from the origin, elbow 2 m along x, hand 1 m further; rest = node pose.
Skeleton arm() {
  std::vector<Joint> joints{joint("shoulder", -1, {0, 0, 0}), joint("elbow", 0, {2, 0, 0}),
                            joint("hand", 1, {1, 0, 0})};
  joints[1].rest_from_joint.translation() << 2, 0, 0;
  joints[2].rest_from_joint.translation() << 3, 0, 0;
  return Skeleton(joints);
}

std::string message_of(std::vector<Joint> joints) {
  try {
    Skeleton unused(std::move(joints));
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "accepted";
}

TEST(LocalTransform, ScalesThenRotatesThenMoves) {
  LocalTransform t;
  t.translation << 10, 0, 0;
  t.rotation = Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ());
  t.scale << 2, 3, 4;
  // (1,1,1) -> scaled (2,3,4) -> turned a quarter about z (-3,2,4) -> moved (7,2,4).
  const Eigen::Vector3d expected(7, 2, 4);
  EXPECT_LT((t.matrix() * Eigen::Vector3d(1, 1, 1) - expected).norm(), 20 * kEps * expected.norm());
}

TEST(TwoBonePose, BendsTheForearmAboutTheElbow) {
  const Skeleton skeleton = arm();
  std::vector<Eigen::Affine3d> local;
  for (const Joint& j : skeleton.joints()) local.push_back(j.parent_from_joint);
  local[1].rotate(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ()));
  const Pose pose = pose_from_local(skeleton, local);
  // The elbow stays at (2,0,0); the hand, 1 m along the turned x axis, is at (2,1,0).
  EXPECT_LT((pose.world_from_joint[1].translation() - Eigen::Vector3d(2, 0, 0)).norm(), 10 * kEps);
  EXPECT_LT((pose.world_from_joint[2].translation() - Eigen::Vector3d(2, 1, 0)).norm(), 10 * kEps);
  // Flesh at (2.5, 0.1, 0) hangs on the elbow: 0.5 along and 0.1 beside the forearm -> (1.9, 0.5, 0).
  const Eigen::Vector3d flesh = pose_from_rest(skeleton, pose)[1] * Eigen::Vector3d(2.5, 0.1, 0);
  EXPECT_LT((flesh - Eigen::Vector3d(1.9, 0.5, 0)).norm(), 20 * kEps);
}

TEST(NodePose, IsTheRestPoseWhereTheFileAgrees) {
  const Skeleton skeleton = arm();
  for (const Eigen::Affine3d& t : pose_from_rest(skeleton, node_pose(skeleton))) {
    EXPECT_LT((t.matrix() - Eigen::Matrix4d::Identity()).norm(), 10 * kEps);
  }
}

TEST(ForwardKinematics, EqualsTheProductAlongThePathToTheRoot) {
  std::mt19937_64 rng(20021);
  const auto uniform = [&rng] { return static_cast<double>(rng() >> 11) * 0x1.0p-53 * 2.0 - 1.0; };
  std::vector<Joint> joints;
  for (int i = 0; i < 40; ++i) {
    Joint j = joint(std::string("j").append(std::to_string(i)),
                    i == 0 ? -1 : static_cast<int>(rng() % static_cast<unsigned>(i)),
                    {uniform(), uniform(), uniform()});
    j.local.rotation = Eigen::Quaterniond(uniform(), uniform(), uniform(), uniform()).normalized();
    j.local.scale << 1.5, 0.75, -1.25;
    j.parent_from_joint = j.local.matrix();
    joints.push_back(j);
  }
  const Skeleton skeleton(joints);
  const Pose pose = node_pose(skeleton);
  for (int i = 0; i < skeleton.num_joints(); ++i) {
    // Independent: carry one point up the chain, joint by joint, instead of multiplying matrices downwards.
    Eigen::Vector3d p(0.3, -0.2, 0.7);
    double growth = 1.0;
    for (int at = i; at >= 0; at = skeleton.joint(at).parent) {
      const LocalTransform& local = skeleton.joint(at).local;
      p = local.rotation * local.scale.cwiseProduct(p).eval() + local.translation;
      growth = std::max(growth, p.norm());
    }
    // At most 40 maps of about 10 rounded operations on coordinates no larger than `growth` times the largest
    // later scale (1.5 a map is included, as the path grows p itself).
    const Eigen::Vector3d q =
        pose.world_from_joint[static_cast<std::size_t>(i)] * Eigen::Vector3d(0.3, -0.2, 0.7);
    EXPECT_LT((q - p).norm(), 400 * kEps * growth) << "joint " << i;
  }
}

TEST(Skeleton, FindsJointsByName) {
  EXPECT_EQ(arm().find("elbow"), 1);
  EXPECT_EQ(arm().find("Elbow"), -1);
}

TEST(Skeleton, RefusesAParentThatComesLater) {
  EXPECT_THAT(message_of({joint("a", 1, {0, 0, 0}), joint("b", -1, {0, 0, 0})}),
              HasSubstr("joint 'a': its parent 1 does not come before it"));
  EXPECT_THAT(message_of({joint("a", 0, {0, 0, 0})}), HasSubstr("does not come before it"));
  EXPECT_THAT(message_of({joint("a", -2, {0, 0, 0})}), HasSubstr("does not come before it"));
}

TEST(Skeleton, RefusesNamesThatAreEmptyOrUsedTwice) {
  EXPECT_THAT(message_of({joint("", -1, {0, 0, 0})}), HasSubstr("joint number 0: its name is empty"));
  EXPECT_THAT(message_of({joint("a", -1, {0, 0, 0}), joint("a", 0, {0, 0, 0})}),
              HasSubstr("joint 'a': its name is used twice"));
}

TEST(Skeleton, RefusesRestTransformsThatCannotBeInverted) {
  std::vector<Joint> flat{joint("flat", -1, {0, 0, 0})};
  flat[0].rest_from_joint.linear().col(1) = flat[0].rest_from_joint.linear().col(0);
  EXPECT_THAT(message_of(flat), HasSubstr("joint 'flat': its rest transform is not invertible"));
  std::vector<Joint> broken{joint("broken", -1, {0, 0, 0})};
  broken[0].rest_from_joint.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message_of(broken), HasSubstr("joint 'broken': its rest transform is not finite"));
  // A small unit is not a flat frame.
  std::vector<Joint> small{joint("small", -1, {0, 0, 0})};
  small[0].rest_from_joint.linear() *= 1e-6;
  EXPECT_EQ(message_of(small), "accepted");
}

TEST(PoseFromLocal, RefusesTheWrongNumberOfTransforms) {
  EXPECT_THROW(pose_from_local(arm(), {}), std::invalid_argument);
  EXPECT_THROW(pose_from_rest(arm(), Pose{}), std::invalid_argument);
}

}  // namespace
}  // namespace sinew::skeleton
