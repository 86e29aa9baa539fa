#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

/// Joints, poses and clips: plain values, no files, no lattice.
namespace sinew::skeleton {

/// A local transform in parts: x_parent = translation + rotation * (scale .* x).
struct LocalTransform {
  Eigen::Vector3d translation{0, 0, 0};                          ///< [m].
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< unit.
  Eigen::Vector3d scale{1, 1, 1};                                ///< [-]; may be negative, not zero.

  /// parent_from_joint.
  Eigen::Affine3d matrix() const;
};

/// One joint: a frame in a tree. Control joints, helpers and plain nodes are joints too; which of them carry
/// bones is decided elsewhere.
struct Joint {
  std::string name;  ///< unique in the skeleton, never empty.
  int parent = -1;   ///< index of the parent, smaller than the joint's own; -1 for a root.
  /// parent_from_joint where no clip animates the joint. Kept as a matrix: a file may store a shear.
  Eigen::Affine3d parent_from_joint = Eigen::Affine3d::Identity();
  /// The same in parts, for channels that animate only some of them.
  LocalTransform local;
  /// world_from_joint in the rest pose, that is the pose the skin was bound in; not necessarily the pose of
  /// the node tree. Invertible.
  Eigen::Affine3d rest_from_joint = Eigen::Affine3d::Identity();
};

/// The joint tree, parents before children. Does not change after construction.
class Skeleton {
 public:
  Skeleton() = default;
  /// Throws std::invalid_argument naming the joint when a parent does not come before its child, a name is
  /// empty or used twice, or a rest transform is not finite or not invertible.
  explicit Skeleton(std::vector<Joint> joints);

  int num_joints() const { return static_cast<int>(joints_.size()); }
  const Joint& joint(int i) const { return joints_[static_cast<std::size_t>(i)]; }
  const std::vector<Joint>& joints() const { return joints_; }
  /// Index of the joint of that name or -1.
  int find(const std::string& name) const;

 private:
  std::vector<Joint> joints_;
};

/// Where every joint is at one instant.
struct Pose {
  std::vector<Eigen::Affine3d> world_from_joint;  ///< one per joint [m].
};

/// Forward kinematics of local transforms (one parent_from_joint per joint).
Pose pose_from_local(const Skeleton& skeleton, const std::vector<Eigen::Affine3d>& parent_from_joint);

/// The pose of the node tree, where nothing is animated.
Pose node_pose(const Skeleton& skeleton);

/// T_J for every joint: world_from_joint * joint_from_rest, the affine map that carries rest points to the
/// pose.
std::vector<Eigen::Affine3d> pose_from_rest(const Skeleton& skeleton, const Pose& pose);

}  // namespace sinew::skeleton
