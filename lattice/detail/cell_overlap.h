#pragma once

#include "lattice/control_lattice.h"

namespace sinew::lattice::detail {

/// Volume that two cells have in common [m^3]. Hexahedra and wedges are the union of the tetrahedra between
/// their faces (each split about its mean) and the cell's mean; two tetrahedra are intersected exactly, one
/// cut by the planes of the other.
double overlap_volume(const CellComplex& complex, const Cell& a, const Cell& b);

}  // namespace sinew::lattice::detail
