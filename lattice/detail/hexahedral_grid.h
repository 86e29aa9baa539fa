#pragma once

#include "lattice/control_lattice.h"
#include "lattice/detail/rig_input.h"

namespace sinew::lattice::detail {

/// Cubes of side `side` (unit coordinates), symmetric about the middle of the skin's box: all that touch the
/// skin and all whose middle lies inside it. Rest coordinates.
CellComplex grid_over_skin(const UnitSkin& skin, double side, const Poll& poll = {});

/// The side at which grid_over_skin gives about `cells` cubes, within 10 % where the skin allows.
double find_grid_side(const UnitSkin& skin, int cells, const Poll& poll = {});

/// The lattice that cannot fail: a plain grid of cubes in which no bone lies on edges. Every bone of the
/// skeleton, reduced at the size of the cubes, is soft, and limbs that share cubes have a copy each.
ControlLattice hexahedral_lattice(const RigInput& input, double side, const ReductionOptions& options);

}  // namespace sinew::lattice::detail
