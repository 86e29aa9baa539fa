#pragma once

#include <utility>
#include <vector>

#include "lattice/control_lattice.h"
#include "lattice/detail/unit_skin.h"

namespace sinew::lattice::detail {

/// Joints with less than this share of the skin's area count as weightless: stray weights of exporters.
inline constexpr double kWeightless = 1e-6;

/// How the skin hangs on the joints; independent of h.
struct JointWeights {
  std::vector<double> area;          ///< skin area (unit coordinates) times weight of each joint.
  std::vector<double> subtree_area;  ///< the same with all descendants.
  /// Vertices of each joint with their weights.
  std::vector<std::vector<std::pair<int, double>>> vertices;
  std::vector<bool> excluded;  ///< joints that the user left out: no weight, no parent, no child.
};

/// `stand_in` says for every joint which one its weight counts for.
JointWeights joint_weights(const UnitSkin& skin, const JointTree& joints, const std::vector<int>& stand_in);

/// For every joint the frame its weight counts for: itself if it owns a bone or a soft frame, else the
/// nearest ancestor that does, else the nearest descendant, else the first frame there is; -1 where there is
/// none.
std::vector<int> frame_of_joint(const std::vector<int>& parents, const std::vector<int>& frames);

}  // namespace sinew::lattice::detail
