#pragma once

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "assets/detail/imported_scene.h"

namespace sinew::assets::detail {

/// parent_from_node with what is scaled to nothing in the node pose kept at unit size: a rest frame must be
/// invertible, and only nodes without weight get theirs from here.
Eigen::Affine3d invertible_local(const ImportedNode& node);

/// A joint of a skin on which nothing hangs, so that no vertex contradicts a wrong bind matrix.
struct LooseJoint {
  int node = -1;
  Eigen::Affine3d bound;    ///< rest_from_node by its bind matrix.
  bool is_unbound = false;  ///< the matrix is the identity: what exporters write where they have none.
  bool same_pose = false;   ///< the nodes hold the pose in which its skin was bound.
};

/// Where loose joints rest.
struct LooseRest {
  std::vector<Eigen::Affine3d> rest_from_node;  ///< one per loose joint; invertible.
  std::vector<int> rehung;                      ///< nodes whose bind matrix did not count.
};

/// Finds where loose joints rest. `rest_from_node` holds the frames of the joints that carry
/// weight, nothing for all other nodes; `size` is the diagonal of the skin at rest.
/// A loose joint is hung on its relatives by the nodes' transforms, along the way through the tree on which
/// the clips move least; what its bind matrix says counts where it agrees with that. In the pose of binding
/// it must agree to the last per mille. Where the nodes hold another pose they know no more than sizes and
/// rough places, so that then only a matrix is left out that contradicts these; or is the identity, and the
/// joint stands elsewhere than a root does.
LooseRest hang_loose_joints(const ImportedScene& scene,
                            const std::vector<std::optional<Eigen::Affine3d>>& rest_from_node,
                            const std::vector<LooseJoint>& loose, double size);

}  // namespace sinew::assets::detail
