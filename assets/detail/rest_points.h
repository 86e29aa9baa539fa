#pragma once

#include "assets/rig.h"

namespace sinew::assets::detail {

/// Rest positions of all vertices, part by part, num_vertices(rig) x 3 [m].
inline lattice::Points rest_points(const Rig& rig) {
  lattice::Points all(num_vertices(rig), 3);
  Eigen::Index next = 0;
  for (const Part& part : rig.parts) {
    all.middleRows(next, part.points.rows()) = part.points;
    next += part.points.rows();
  }
  return all;
}

}  // namespace sinew::assets::detail
