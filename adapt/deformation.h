#pragma once

#include <vector>

#include "fem/body/body.h"

/// Where the flesh deforms: what adaptive refinement will look at ([Capell02, sec. 4.3]).
namespace sinew::adapt {

/// Deformation magnitude [-] of every active function, in the order of body.mesh.functions:
/// - a detail (level >= 1): |q_a| over the size of its cells. Details vanish under affine motion, so this is
///   non-affine deformation, whatever the pose;
/// - a level-0 hat: the largest |principal stretch - 1| at the centre of a leaf cell in its support, with no
///   regard to
///   rotation.
/// Both are 0 at rest and unchanged by a rigid motion. x: leaf vertices, num_vertices x 3 [m]. Throws
/// std::invalid_argument for another size.
std::vector<double> deformation_magnitudes(const fem::Body& body, const lattice::Points& x);

}  // namespace sinew::adapt
