#pragma once

#include "lattice/control_lattice.h"
#include "lattice/detail/rig_input.h"

namespace sinew::lattice::detail {

/// Unglues parts of the body that only meet across a gap, legs side by side or an arm along the flank: where
/// two cells meet in a face that lies wholly outside the skin, and the skin in them is farther apart along
/// the skeleton than 1.5 h, they no longer share its vertices. Every part keeps its cells and gets copies of
/// the vertices, at the same place. Cells that hold the skin of both parts stay (full separation would double
/// them), and so do vertices of bones. Needs cells, bones and edge length of `lattice`. Returns the number of
/// copies.
int separate_limbs(const RigInput& input, const ReducedSkeleton& skeleton, ControlLattice& lattice);

}  // namespace sinew::lattice::detail
