#pragma once

#include "lattice/detail/cell_sizes.h"
#include "lattice/detail/lattice_points.h"

namespace sinew::lattice::detail {

/// Free points where the target edge changes from place to place: a body-centred cubic crystal that grows
/// from point to neighbouring point, every step as long as the target edge there. A neighbour that has no
/// room is left out, one that has more stands alone, so that the crystal is regular where the edge is
/// constant and has dislocations where it changes. Inside the skin and within 1.2 target edges of it; of a
/// half (`out.half`) the side x >= 0 with points on the plane.
void place_graded_points(const UnitSkin& skin, const BoneClearance& clearance, const CellSizes& sizes,
                         double h, double shift, LatticePoints& out);

}  // namespace sinew::lattice::detail
