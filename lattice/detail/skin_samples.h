#pragma once

#include <vector>

#include "lattice/detail/cell_sizes.h"
#include "lattice/detail/triangle_grid.h"
#include "lattice/detail/unit_skin.h"

namespace sinew::lattice::detail {

/// What every lattice must hold, unit coordinates: the skin's vertices, the same pushed out
/// by 0.03 h, voxel centres inside, and the skin's triangles. All later tests use these, so holes, open
/// sheets, self-intersections and many parts cannot break the build. Triangles are tested exactly: they may
/// not cross the boundary of the lattice.
struct SkinSamples {
  std::vector<Eigen::Vector3d> points;
  TriangleGrid triangles;
};

/// Whether a lattice has two halves, of which one is built.
enum class Halves { Both, OneMirrored };

/// Samples for target edge `h` (unit coordinates), denser where `sizes` make it smaller. With OneMirrored,
/// those with x < 0 are mirrored to the other side.
SkinSamples sample_skin(const UnitSkin& skin, double h, Halves halves, const CellSizes& sizes = {},
                        const Poll& poll = {});

}  // namespace sinew::lattice::detail
