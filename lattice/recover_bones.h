#pragma once

#include "lattice/control_lattice.h"
#include "lattice/surface.h"

namespace sinew::lattice {

/// How far a lattice vertex may lie from the joint or bone it stands for, as a share of the longest side of
/// the skin's box: files round coordinates to six or seven digits. Vertices that are taken are moved onto the
/// bone.
inline constexpr double kRecoverTolerance = 1e-5;

/// Makes a control lattice of cells that somebody else built: reduces the skeleton at the cells' mean edge
/// length and takes for every bone the chain of edges that lies on it. A bone without such a
/// chain becomes soft; `changes` says so. The quality is measured. Throws std::invalid_argument where the
/// skin, the joints or the cells cannot be used.
ControlLattice recover_bones(const CellComplex& complex, const Surface& skin, const JointTree& joints);

}  // namespace sinew::lattice
