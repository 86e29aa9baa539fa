#include "skeleton/skeleton.h"

#include <cmath>
#include <set>
#include <stdexcept>
#include <utility>

namespace sinew::skeleton {

namespace {

[[noreturn]] void refuse(const Joint& joint, std::size_t index, const std::string& what) {
  const std::string name = joint.name.empty() ? "number " + std::to_string(index) : "'" + joint.name + "'";
  throw std::invalid_argument("joint " + name + ": " + what);
}

/// Invertible in floating point: the determinant is compared with the product of the column lengths, so that
/// the unit of the file (a scale of 1e-4, say) does not count as singular. 1e-12 is far above the rounding of
/// a 3x3 determinant (about 10 eps) and far below any axis an artist can tell from a plane.
bool invertible(const Eigen::Affine3d& m) {
  const Eigen::Matrix3d a = m.linear();
  const double lengths = a.col(0).norm() * a.col(1).norm() * a.col(2).norm();
  return lengths > 0.0 && std::abs(a.determinant()) > 1e-12 * lengths;
}

}  // namespace

Eigen::Affine3d LocalTransform::matrix() const {
  Eigen::Affine3d m;
  m.linear() = rotation.toRotationMatrix() * scale.asDiagonal();
  m.translation() = translation;
  m.makeAffine();
  return m;
}

Skeleton::Skeleton(std::vector<Joint> joints) : joints_(std::move(joints)) {
  std::set<std::string> names;
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const Joint& joint = joints_[i];
    if (joint.name.empty()) refuse(joint, i, "its name is empty");
    if (!names.insert(joint.name).second) refuse(joint, i, "its name is used twice");
    if (joint.parent < -1 || joint.parent >= static_cast<int>(i)) {
      refuse(joint, i, "its parent " + std::to_string(joint.parent) + " does not come before it");
    }
    if (!joint.parent_from_joint.matrix().allFinite()) refuse(joint, i, "its local transform is not finite");
    if (!joint.rest_from_joint.matrix().allFinite()) refuse(joint, i, "its rest transform is not finite");
    if (!invertible(joint.rest_from_joint)) refuse(joint, i, "its rest transform is not invertible");
  }
}

int Skeleton::find(const std::string& name) const {
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    if (joints_[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

Pose pose_from_local(const Skeleton& skeleton, const std::vector<Eigen::Affine3d>& parent_from_joint) {
  if (static_cast<int>(parent_from_joint.size()) != skeleton.num_joints()) {
    throw std::invalid_argument("pose_from_local: " + std::to_string(parent_from_joint.size()) +
                                " local transforms for " + std::to_string(skeleton.num_joints()) + " joints");
  }
  Pose pose;
  pose.world_from_joint.reserve(parent_from_joint.size());
  for (std::size_t i = 0; i < parent_from_joint.size(); ++i) {
    const int parent = skeleton.joints()[i].parent;
    pose.world_from_joint.push_back(parent < 0 ? parent_from_joint[i]
                                               : pose.world_from_joint[static_cast<std::size_t>(parent)] *
                                                     parent_from_joint[i]);
  }
  return pose;
}

Pose node_pose(const Skeleton& skeleton) {
  std::vector<Eigen::Affine3d> local;
  local.reserve(skeleton.joints().size());
  for (const Joint& joint : skeleton.joints()) local.push_back(joint.parent_from_joint);
  return pose_from_local(skeleton, local);
}

std::vector<Eigen::Affine3d> pose_from_rest(const Skeleton& skeleton, const Pose& pose) {
  if (static_cast<int>(pose.world_from_joint.size()) != skeleton.num_joints()) {
    throw std::invalid_argument("pose_from_rest: pose of " + std::to_string(pose.world_from_joint.size()) +
                                " joints for a skeleton of " + std::to_string(skeleton.num_joints()));
  }
  std::vector<Eigen::Affine3d> result;
  result.reserve(pose.world_from_joint.size());
  for (std::size_t i = 0; i < pose.world_from_joint.size(); ++i) {
    result.push_back(pose.world_from_joint[i] * skeleton.joints()[i].rest_from_joint.inverse());
  }
  return result;
}

}  // namespace sinew::skeleton
