#pragma once

#include <string>
#include <vector>

#include "lattice/build.h"
#include "lattice/detail/skeleton_reduction.h"
#include "lattice/detail/unit_skin.h"

namespace sinew::lattice::detail {

/// How far the mirror image of a vertex or joint may lie from its partner, as a share of the longest side of
/// the skin's box: files hold single precision, and programs round once or twice on the way.
inline constexpr double kMirrorTolerance = 1e-5;

/// A rig that is its own mirror image.
struct RigMirror {
  Eigen::Vector3d normal{1, 0, 0};  ///< of the plane, unit coordinates.
  double offset = 0.0;              ///< normal . p on the plane, unit coordinates.
  std::vector<int> joint;  ///< per joint its partner, itself on the plane; -1 where it carries no skin.
};

struct MirrorSearch {
  bool found = false;
  RigMirror mirror;
  std::string why_not;  ///< of the best plane, where none was found.
};

/// Looks for a plane in which the skin's vertices, the joints that carry skin, their tree and their shares of
/// the skin are mirrored: normal to the axes, then to the principal axes.
MirrorSearch find_mirror(const UnitSkin& skin, const JointTree& unit_joints, const JointWeights& weights);

/// The frame whose first axis is the normal: unit coordinates in which the plane is x = 0.
MirrorFrame mirror_frame(const UnitSkin& skin, const RigMirror& mirror);

/// Moves the joints by at most the tolerance, so that they are exact mirror images in x = 0.
void symmetrise(const RigMirror& mirror, JointTree& joints);

/// The mirror image in x = 0.
inline Eigen::Vector3d reflected(const Eigen::Vector3d& p) { return {-p.x(), p.y(), p.z()}; }

}  // namespace sinew::lattice::detail
