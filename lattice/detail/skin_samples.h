#pragma once

#include <vector>

#include "lattice/detail/unit_skin.h"

namespace sinew::lattice::detail {

/// Points that every lattice must hold (LATTICE step 2), unit coordinates: the skin's vertices, points on its
/// triangles, both also pushed out by 0.03 h, and voxel centres inside. All later tests use these points, so
/// holes, open sheets, self-intersections and many parts cannot break the build.
struct SkinSamples {
  std::vector<Eigen::Vector3d> points;
};

/// How densely triangles are sampled.
enum class Density {
  Draft,  ///< enough to count cells.
  Full,
};

/// Samples for target edge `h` (unit coordinates).
SkinSamples sample_skin(const UnitSkin& skin, double h, Density density);

}  // namespace sinew::lattice::detail
