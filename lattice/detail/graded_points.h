#pragma once

#include "lattice/detail/lattice_points.h"

namespace sinew::lattice::detail {

/// Free points where the target edge changes from place to place: a body-centred cubic crystal that grows
/// from point to neighbouring point, every step as long as the target edge there. A neighbour that has no
/// room is left out, one that has more stands alone, so that the crystal is regular where the edge is
/// constant and has dislocations where it changes. Inside the skin and within 1.5 target edges of it; of a
/// half (`out.half`) the side x >= 0 with points on the plane. `options.sizes` must be there; points near
/// bones, as `clearance` says, are left out. Adds to `out`. Unit coordinates.
void place_graded_points(const UnitSkin& skin, const BoneClearance& clearance, double h,
                         const PointOptions& options, LatticePoints& out);

}  // namespace sinew::lattice::detail
