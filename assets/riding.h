#pragma once

#include <map>
#include <vector>

#include <Eigen/Geometry>

#include "assets/rig.h"

/// How props move: by the rig's skinning, as their joint turns, or on the flesh round them.
namespace sinew::assets {

/// What would carry a prop.
struct Hold {
  std::vector<Anchor> anchors;  ///< vertices of flesh; weights sum to 1; empty where none is near.
  bool touches = false;         ///< the flesh is closer than 2 % of its own diagonal.
  /// Distance of the prop's farthest vertex from the middle of its anchors, in their mean radii [-].
  double lever = 0.0;
};

/// The flesh round every prop, in order: the closer, the heavier, up to twice the prop's mean radius away, of
/// what hangs on the prop's joint or, where nothing near does, on the next one above that has flesh there.
/// Flesh is what is Simulated and of none of `props`. Those of one joint that touch count as one prop.
std::vector<Hold> hold_props(const Rig& rig, const std::vector<Prop>& props);

/// Fills the anchors of the rig's riding props. Throws ConfigError naming the prop that has no flesh near.
void hang_riders(Rig& rig);

/// The rotation that takes the points `from` closest to `to` (both by rig vertex, num_vertices x 3 [m]),
/// by weighted least squares about their middles ([Umeyama91]); what the anchors leave free does not turn.
Eigen::Matrix3d best_turn(const std::vector<Anchor>& anchors, const lattice::Points& from,
                          const lattice::Points& to);

/// Moves the props of a rig.
///
/// Skinned props get the rig's own skinning. Rigid ones turn as their joint does and take neither scale nor
/// shear. Riding ones are skinned, then moved as flesh was moved away from its skinning: turned as all that
/// hangs on the joint of their anchors did, so that both eyes of a head look the same way whatever ripples
/// past one of them, less the first 5 degrees, so that gaze is the artist's, and carried to where their
/// anchors went.
class PropMotion {
 public:
  /// The rig must outlive it.
  explicit PropMotion(const Rig& rig);

  /// `skinned`: the plain skinning of every vertex in the pose; `frame`: what is shown, with the flesh in
  /// place and the props to be filled in; both num_vertices x 3 [m].
  void place(const std::vector<Eigen::Affine3d>& pose_from_rest, const lattice::Points& skinned,
             lattice::Points& frame) const;

 private:
  const Rig& rig_;
  lattice::Points rest_;
  std::vector<int> joint_of_prop_;                     ///< of its anchors; -1 where it does not ride.
  std::map<int, std::vector<Anchor>> flesh_of_joint_;  ///< all of it.
};

}  // namespace sinew::assets
