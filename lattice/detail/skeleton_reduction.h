#pragma once

#include <string>
#include <vector>

#include "lattice/build.h"
#include "lattice/control_lattice.h"
#include "lattice/detail/joint_weights.h"

namespace sinew::lattice::detail {

class CellSizes;

/// A bone that shall be soft whatever the geometry says.
struct SoftBone {
  int frame = -1;      ///< joint.
  int end_joint = -1;  ///< the joint at its end.
  bool tip = false;
  std::string reason;  ///< for the report.
};

/// Thresholds of the reduction; lengths in units of h, the target edge of the place.
struct ReductionOptions {
  double smallest_bone = 0.5;  ///< shorter bones are contracted.
  double cut_distance = 0.25;  ///< a bone farther than this outside the skin may be cut.
  double cut_length = 0.5;     ///< so long a bone may be cut.
  /// Siblings within this angle are chained: in a cell between two bones that are an angle apart the scaled
  /// Jacobian is below its sine, and a third direction halves it.
  double chain_degrees = 20.0;
  double too_close = 0.15;  ///< bones nearer than this cannot both be edges.
  TipBones tip_bones = TipBones::On;
  std::vector<SoftBone> soft_bones;
  const CellSizes* sizes = nullptr;  ///< h of every place; null: the same everywhere.
};

/// A point of the reduced skeleton: several joints may share it after contraction.
struct SkeletonNode {
  int joint = -1;                     ///< the joint that carries it.
  Eigen::Vector3d position{0, 0, 0};  ///< unit coordinates.
};

/// A straight piece of the reduced skeleton between two nodes.
struct ReducedBone {
  std::string name;
  int frame = -1;  ///< joint.
  int start = -1;  ///< node.
  int end = -1;    ///< node.
  bool tip = false;
  bool soft = false;
};

/// The skeleton at size h.
struct ReducedSkeleton {
  std::vector<SkeletonNode> nodes;
  std::vector<ReducedBone> bones;
  std::vector<SoftFrame> soft_frames;  ///< positions in unit coordinates.
  std::vector<SkeletonChange> changes;
  /// Per bone its mirror image in x = 0, itself in the plane; empty where the rig is not symmetric. Nodes of
  /// partners are exact mirror images.
  std::vector<int> mirror_bone;
};

/// Reduces the joint tree at target edge `h` (unit coordinates, like the positions of `joints`). With
/// `mirror_joint` (per joint its exact mirror image in x = 0, -1 for joints without skin) only the half x >=
/// 0 is reduced and then mirrored; bones too close to their own image become soft.
ReducedSkeleton reduce_skeleton(const UnitSkin& skin, const JointTree& joints, const JointWeights& weights,
                                double h, const ReductionOptions& options,
                                const std::vector<int>* mirror_joint = nullptr);

}  // namespace sinew::lattice::detail
