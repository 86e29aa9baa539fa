#include "fem/body/frames.h"

#include <algorithm>
#include <map>
#include <stdexcept>

#include <Eigen/SVD>

namespace sinew::fem {

FrameTree frame_tree(const lattice::ControlLattice& lattice, const skeleton::Skeleton& skeleton,
                     const std::vector<int>& further) {
  const int num_joints = skeleton.num_joints();
  std::map<int, Frame> by_joint;  // ascending joint index: parents come first
  const auto frame_at = [&](int joint) -> Frame& {
    if (joint < 0 || joint >= num_joints) {
      throw std::invalid_argument("lattice bone names joint " + std::to_string(joint) + ", expected 0 to " +
                                  std::to_string(num_joints - 1));
    }
    return by_joint[joint];
  };
  for (const auto& bone : lattice.bones) {
    Frame& frame = frame_at(bone.frame);
    const Eigen::Vector3d span = bone.rest_end - bone.rest_start;
    if (frame.joint < 0) frame.origin_rest = bone.rest_start;
    frame.joint = bone.frame;
    if (span.norm() > frame.length) {
      frame.length = span.norm();
      frame.direction_rest = span.normalized();
    }
  }
  for (const auto& soft : lattice.soft_frames) {
    Frame& frame = frame_at(soft.frame);
    if (frame.joint < 0) frame.origin_rest = soft.position;
    frame.joint = soft.frame;
  }
  for (const int joint : further) {
    Frame& frame = frame_at(joint);
    if (frame.joint < 0) frame.origin_rest = skeleton.joint(joint).rest_from_joint.translation();
    frame.joint = joint;
  }
  if (by_joint.empty()) throw std::invalid_argument("the lattice has neither a bone nor a soft frame");

  FrameTree tree;
  std::vector<int> index(static_cast<std::size_t>(num_joints), -1);
  for (auto& [joint, frame] : by_joint) {
    frame.name = skeleton.joint(joint).name;
    int ancestor = skeleton.joint(joint).parent;
    while (ancestor >= 0 && index[static_cast<std::size_t>(ancestor)] < 0)
      ancestor = skeleton.joint(ancestor).parent;
    frame.parent = ancestor < 0 ? -1 : index[static_cast<std::size_t>(ancestor)];
    index[static_cast<std::size_t>(joint)] = tree.num_frames();
    tree.frames.push_back(frame);
  }
  tree.frame_of_joint.assign(static_cast<std::size_t>(num_joints), -1);
  for (int j = 0; j < num_joints; ++j) {
    const auto i = static_cast<std::size_t>(j);
    const int joint =
        i < lattice.frame_of_joint.size() && lattice.frame_of_joint[i] >= 0 ? lattice.frame_of_joint[i] : j;
    tree.frame_of_joint[i] = index[static_cast<std::size_t>(joint)];
  }
  return tree;
}

Eigen::Matrix3d polar_rotation(const Eigen::Matrix3d& matrix) {
  // Most joints only turn: what is a rotation to rounding is its own polar factor to rounding.
  constexpr double kRounding = 1e-13;
  const Eigen::Matrix3d error = matrix.transpose() * matrix - Eigen::Matrix3d::Identity();
  if (error.cwiseAbs().maxCoeff() < kRounding && matrix.determinant() > 0.0) return matrix;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0.0) u.col(2) *= -1.0;  // smallest singular value last
  return u * svd.matrixV().transpose();
}

PosedFrames pose_frames(const FrameTree& tree, std::vector<Eigen::Affine3d> pose_from_rest, double time) {
  PosedFrames posed;
  posed.time = time;
  posed.joints = std::move(pose_from_rest);
  for (const Frame& frame : tree.frames) {
    FrameTransform transform;
    transform.from_rest = posed.joints[static_cast<std::size_t>(frame.joint)];
    const Eigen::Matrix3d& linear = transform.from_rest.linear();
    const double scale = std::abs(linear.determinant());
    if (!transform.from_rest.matrix().allFinite() || !(scale > 1e-18)) {
      throw std::invalid_argument("joint '" + frame.name + "': its transform at " + std::to_string(time) +
                                  " s is not finite or has no volume");
    }
    transform.rotation = polar_rotation(linear);
    transform.to_rest = transform.from_rest.inverse();
    posed.frames.push_back(transform);
  }
  return posed;
}

std::optional<PosedFrames> mean_pose(const FrameTree& tree, const PosedFrames& a, const PosedFrames& b) {
  for (std::size_t f = 0; f < tree.frames.size(); ++f) {
    // tr R = 1 + 2 cos(angle).
    if ((a.frames[f].rotation.transpose() * b.frames[f].rotation).trace() < 1.0) return std::nullopt;
  }
  std::vector<Eigen::Affine3d> joints = a.joints;
  for (std::size_t j = 0; j < joints.size(); ++j)
    joints[j].matrix() = 0.5 * (a.joints[j].matrix() + b.joints[j].matrix());
  return pose_frames(tree, std::move(joints), 0.5 * (a.time + b.time));
}

}  // namespace sinew::fem
