#pragma once

#include "lattice/control_lattice.h"
#include "lattice/detail/rig_input.h"

namespace sinew::lattice::detail {

/// The bones of a reduced skeleton in rest coordinates, without chains; ends are the joints' positions bit
/// for bit where a joint carries them at its own place.
std::vector<LatticeBone> lattice_bones(const RigInput& input, const ReducedSkeleton& skeleton);

/// Puts the chain vertices of every hard bone exactly on it: the ends bit for bit, the others at (1 - s) a +
/// s b with `parameters[b]` the s of each chain vertex of bone b.
void place_chains(ControlLattice& lattice, const std::vector<std::vector<double>>& parameters);

/// What becomes of components that no bone reaches.
enum class FloatingParts { Tie, Leave };

/// The rest of a lattice that has cells and bones: soft frames and changes of the skeleton, a soft frame for
/// every component that no bone reaches (unless told to leave them), and the frame of every joint.
void hang_joints(const RigInput& input, const ReducedSkeleton& skeleton, ControlLattice& lattice,
                 FloatingParts floating = FloatingParts::Tie);

}  // namespace sinew::lattice::detail
