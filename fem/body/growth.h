#pragma once

#include <vector>

#include "fem/body/body.h"

/// Flesh on joints that a clip scales (squash and stretch) grows with them: its shape free of strain, Y, is
/// what plain skinning shows with the joints' scales and places of the instant but all of them turned as at
/// rest, corrected so that Y of a vertex on a bone is where the clip puts it and that little of the
/// correction arrives at the skin. So a scale that all joints share costs no elastic energy, and no bone
/// stings. Only where body.grows.
namespace sinew::fem {

/// Y at one instant.
struct Growth {
  std::vector<Eigen::Matrix3d> stretch;  ///< S_f = R_f^T dT_f, symmetric, per frame.
  std::vector<Eigen::Vector3d> origin;   ///< Y_f of the frames' origins [m].
  lattice::Points shape;                 ///< Y of the leaf vertices, num_vertices x 3 [m].

  /// Y of a point that belongs to a frame alone.
  Eigen::Vector3d of(int frame, const Frame& rest, const Eigen::Vector3d& point) const {
    const auto f = static_cast<std::size_t>(frame);
    return origin[f] + stretch[f] * (point - rest.origin_rest);
  }
};

/// True where some frame's stretch is farther from 1 than the 1e-5 that single-precision files make of 1.
bool scales_joints(const PosedFrames& posed);

/// Y = sum_f s_f [Y_f + S_f (X - C_f)] + d. The origins follow each other down the tree, Y_f = Y_p + R_p^T
/// (c_f - c_p) with c their posed places, roots hung on the first root; d is what is missing at bone
/// vertices, spread by body.bone_extension.
Growth growth(const Body& body, const PosedFrames& posed);

/// Y at its place among the frames, x = sum_f s_f [c_f + R_f (Y - Y_f)], num_vertices x 3 [m].
lattice::Points grown_places(const Body& body, const PosedFrames& posed, const Growth& growth);

/// Where tie `tie` pulls flesh to: T_b. In a body that grows, along a bone stretched as the bone is, and
/// about a soft frame moved so that its middle is where the grown shape has it, turned with the frame: the
/// frame of flesh that follows several joints pulls no dent into it. `growth`: of `posed`; null where nothing
/// grows.
Eigen::Affine3d tie_target(const Body& body, const Tie& tie, const PosedFrames& posed, const Growth* growth);

}  // namespace sinew::fem
