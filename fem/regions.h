#pragma once

#include <vector>

#include "fem/frame_weights.h"
#include "fem/limb_radius.h"

/// Regions in which the flesh is linearised: one per frame and one (or two) per joint (DESIGN section 6).
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

/// Angle [rad] by which each frame turns against its parent's, largest over `poses`; 0 for frames without
/// parent.
std::vector<double> largest_bends(const FrameTree& tree, const std::vector<PosedFrames>& poses);

struct RegionOptions {
  /// Joint regions between parent and child frames; without them the error at a 120-degree elbow grows
  /// from 2.8 to 7.1 % of the length.
  bool joints = true;
};

/// Regions with at least one vertex. `bends`: per frame, from largest_bends, judged once per run.
std::vector<Region> make_regions(const lattice::ControlLattice& lattice, const FrameTree& tree,
                                 const LimbRadii& radii, const lattice::LeafMesh& mesh,
                                 const FrameWeights& weights, const std::vector<double>& bends,
                                 const RegionOptions& options = {});

RegionTransform transform_of(const Region& region, const PosedFrames& posed);

}  // namespace sinew::fem
