#pragma once

#include "lattice/control_lattice.h"
#include "lattice/detail/rig_input.h"

namespace sinew::lattice::detail {

/// Gives limbs that lie side by side, two legs, fingers, a tail along the thigh, cells of their own. Where
/// the skin and bones in a cell are of several limbs (LimbMap), every limb gets a copy of the cell; cells and
/// copies share vertices round a vertex only with those of the same limb, or into which their flesh goes on
/// through a face. Two cells of different limbs that meet across a gap part as well. A bone keeps its
/// vertices in the copies of its own limb, the others get vertices at the same places.
///
/// Copies beyond the first of a place come after all other cells; `lattice.copies` lists them. A face may
/// then belong to more than two cells. Cells of air, with neither flesh nor bone, are left out, and vertices
/// with them. Needs cells, bones and edge length of `lattice`; its cells and vertices keep their order.
void separate_limbs(const RigInput& input, const ReducedSkeleton& skeleton, ControlLattice& lattice);

}  // namespace sinew::lattice::detail
