#pragma once

#include <vector>

#include "lattice/mirror_map.h"

/// Where a plane of symmetry of a set of points can lie.
namespace sinew::lattice::detail {

/// Half-way between the outermost points: exact for every plane of symmetry with this normal (of length 1).
MirrorPlane middle_plane(const Points& points, const Eigen::Vector3d& normal);

/// The middle planes normal to the three principal axes.
std::vector<MirrorPlane> principal_planes(const Points& points);

}  // namespace sinew::lattice::detail
