#pragma once

#include <vector>

#include "lattice/build.h"

namespace sinew::lattice {

/// Smallest dihedral angle of one cell [degrees], over all corners and the three edges at each.
double min_dihedral_degrees(const CellComplex& complex, const Cell& cell);

/// Smallest scaled Jacobian over the corners of the cell itself: the determinant of the three edges there,
/// each of length 1; in [-1, 1], 0.707 for a regular tetrahedron, 1 for a cube.
double min_corner_jacobian(const CellComplex& complex, const Cell& cell);

/// Smallest scaled Jacobian over the corners of the hexahedra into which one subdivision cuts the cell; in
/// [-1, 1], 0.707 for a regular tetrahedron, 1 for a cube.
double min_scaled_jacobian(const CellComplex& complex, const Cell& cell);

}  // namespace sinew::lattice
