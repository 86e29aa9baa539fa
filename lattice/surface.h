#pragma once

#include <string>
#include <vector>

#include "lattice/points.h"

namespace sinew::lattice {

/// Influence of one frame on one surface vertex (linear blend skinning).
struct Influence {
  /// Index of the frame (for a rig: of the joint); >= 0.
  int frame = 0;
  /// Weight [-]; in [0, 1]; the influences of one vertex sum to 1 (or there are none).
  double weight = 0.0;
};

/// A triangle surface with skinning weights: the skin that the lattice must hold.
/// Not necessarily closed, manifold or free of self-intersections.
struct Surface {
  Points points;        ///< num_vertices x 3 [m], rest.
  Triangles triangles;  ///< num_triangles x 3.
  /// Influences per vertex; either empty or num_vertices long.
  std::vector<std::vector<Influence>> weights;
};

/// One candidate bone for the lattice: the segment from joint `parent` to joint `child` of a joint tree.
/// The builder takes the whole tree of joints as plain points (below) and decides itself.
struct JointTree {
  Points positions;                ///< num_joints x 3 [m], rest.
  std::vector<int> parents;        ///< parent joint or -1; parents come before children.
  std::vector<std::string> names;  ///< for reports.
};

}  // namespace sinew::lattice
