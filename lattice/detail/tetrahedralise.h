#pragma once

#include <array>
#include <vector>

#include "lattice/detail/lattice_points.h"
#include "lattice/detail/skin_samples.h"

namespace sinew::lattice::detail {

/// Tetrahedra over LatticePoints, positively oriented.
using Tetrahedra = std::vector<std::array<int, 4>>;

struct TetrahedraResult {
  Tetrahedra cells;             ///< those that hold a sample or an edge of a bone.
  std::vector<int> unfinished;  ///< bones with a piece that is still no edge; normally none.
  int splits = 0;               ///< bone pieces that were split at their midpoint.
};

/// Delaunay tetrahedra of the points [CGAL], bone pieces that are missing split at
/// their midpoints (added to `points`), free points near bones relaxed, then cells without a sample dropped.
TetrahedraResult tetrahedralise(LatticePoints& points, const ReducedSkeleton& skeleton,
                                const SkinSamples& samples, double h, const PointOptions& options);

}  // namespace sinew::lattice::detail
