#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "lattice/control_lattice.h"
#include "skeleton/skeleton.h"

/// Frames: the joints that flesh follows, and how they stand at one instant.
namespace sinew::fem {

/// A joint that owns lattice bones or a soft frame.
struct Frame {
  int joint = -1;                        ///< joint of the skeleton.
  int parent = -1;                       ///< nearest ancestor that is a frame too; -1 where there is none.
  Eigen::Vector3d origin_rest{0, 0, 0};  ///< start of its first bone, or its position [m].
  Eigen::Vector3d direction_rest{0, 0,
                                 0};  ///< unit direction of its longest bone; zero for a frame without bones.
  double length = 0.0;                ///< of that bone [m].
  std::string name;                   ///< of the joint.
};

/// The frames of a lattice, parents before children, and the frame of every joint.
struct FrameTree {
  std::vector<Frame> frames;
  /// Joint of the skeleton -> frame index that its skin weight counts for, or -1.
  std::vector<int> frame_of_joint;

  int num_frames() const { return static_cast<int>(frames.size()); }
};

/// `further`: joints that are frames whatever the lattice says. Throws std::invalid_argument where the
/// lattice has neither a bone nor a soft frame and there is no further one, or a joint is named that the
/// skeleton does not have.
FrameTree frame_tree(const lattice::ControlLattice& lattice, const skeleton::Skeleton& skeleton,
                     const std::vector<int>& further = {});

/// T_f and R_f of one frame at one instant.
struct FrameTransform {
  Eigen::Affine3d from_rest = Eigen::Affine3d::Identity();  ///< T_f: rest to now, animated scale kept.
  Eigen::Affine3d to_rest = Eigen::Affine3d::Identity();    ///< its inverse.
  Eigen::Matrix3d rotation =
      Eigen::Matrix3d::Identity();  ///< R_f: rotation of the polar decomposition of T_f.
};

/// The instant's transforms: of all joints (for bone vertices) and of all frames.
struct PosedFrames {
  double time = 0.0;                    ///< [s].
  std::vector<Eigen::Affine3d> joints;  ///< pose_from_rest of every joint.
  std::vector<FrameTransform> frames;
};

/// Throws std::invalid_argument naming the joint and the time where a frame's transform is not finite or
/// squashes space flat (scale below 1e-6), so that it cannot be inverted.
PosedFrames pose_frames(const FrameTree& tree, std::vector<Eigen::Affine3d> pose_from_rest, double time);

/// Halfway between two poses along the chord: the mean of the joints' maps, in which every point that moves
/// with a joint stands at the mean of its two places. Nothing where a frame turns by more than a right angle
/// between the two, as a mean of opposite rotations has no volume.
std::optional<PosedFrames> mean_pose(const FrameTree& tree, const PosedFrames& a, const PosedFrames& b);

/// Rotation of the polar decomposition; for a mirroring matrix the nearest proper rotation.
Eigen::Matrix3d polar_rotation(const Eigen::Matrix3d& matrix);

}  // namespace sinew::fem
