#pragma once

#include <numbers>
#include <vector>

#include "fem/body/frame_weights.h"
#include "fem/body/limb_radius.h"

/// Regions in which the flesh is linearised: one per frame and one (or two) per joint. A
/// scene pays only for what it models: frames that move as one share a region, and joints that hardly bend
/// have none.
namespace sinew::fem {

/// A region: its frame is slerp(R_first, R_second, t) about its origin; a frame's own region has first ==
/// second.
struct Region {
  int first = -1;   ///< frame index (of a joint region: the parent's).
  int second = -1;  ///< frame index (of a joint region: the child's).
  double t = 0.0;   ///< slerp parameter [-]; 1/2, or 1/3 and 2/3 where the joint bends beyond 90 degrees.
  Eigen::Vector3d origin_rest{0, 0, 0};  ///< C [m].
  std::vector<int> vertices;             ///< leaf vertices with w > 0, ascending.
  std::vector<double> weights;           ///< w_i there; over all regions they sum to 1 at every vertex.
};

/// Rotation, origin and affine map of a region at one instant.
struct RegionTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();   ///< R_i.
  Eigen::Vector3d origin{0, 0, 0};                          ///< c [m].
  Eigen::Affine3d from_rest = Eigen::Affine3d::Identity();  ///< T_i; its linear part carries animated scale.
};

struct RegionOptions {
  /// Joint regions between parent and child frames; without them the error at a 120-degree elbow grows
  /// from 2.8 to 7.1 % of the length.
  bool joints = true;
  /// A frame that never turns more than this against the leader of its parent's flesh shares the leader's
  /// region [rad];
  /// >= 0. A linear body that is off by 10 degrees strains by 1 - cos(10 deg) = 1.5 % at most.
  double merge_angle = 10.0 * std::numbers::pi / 180.0;
  /// Two regions that never bend more than this against each other need no joint region [rad]: the same angle
  /// lies between neighbouring frames of a 60-degree bend that has one.
  double joint_angle = 30.0 * std::numbers::pi / 180.0;
  /// Joints of the skeleton whose frames share one region, however they turn, and share it with no other:
  /// each but the first hangs on another one of its group. A group of one has a region of its own.
  std::vector<std::vector<int>> groups = {};
};

/// How frames turn against each other over a run: judged once, so that weights never jump.
struct FrameBends {
  /// Frame in whose rotation the flesh of a frame is linearised: itself, or an ancestor that it hardly turns
  /// against.
  std::vector<int> leader;
  /// Largest angle between the leaders of a frame and of its parent [rad]; 0 for frames without parent.
  std::vector<double> bend;
};
FrameBends judge_bends(const FrameTree& tree, const std::vector<PosedFrames>& poses,
                       const RegionOptions& options = {});

/// Regions with at least one vertex.
std::vector<Region> make_regions(const lattice::ControlLattice& lattice, const FrameTree& tree,
                                 const LimbRadii& radii, const lattice::LeafMesh& mesh,
                                 const FrameWeights& weights, const FrameBends& bends,
                                 const RegionOptions& options = {});

RegionTransform transform_of(const Region& region, const PosedFrames& posed);

}  // namespace sinew::fem
