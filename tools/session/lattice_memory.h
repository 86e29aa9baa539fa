#pragma once

#include "assets/lattice_input.h"
#include "tools/scene/scene.h"
#include "tools/support/caller.h"

namespace sinew::tools {

/// About how many cells of edge h [m] the builder makes round a skin: those of a body-centred grid (7.8 per
/// h^3) in its volume and in a layer of 0.6 h round it.
double estimated_cells(const lattice::Surface& skin, double edge);

/// Lattices of more cells are written without materials and regions: those would take most of the memory.
inline constexpr int kMostPaintedCells = 50'000;

/// States what a large lattice will take of memory, and throws assets::LimitError for what there is no room
/// for or no scene may ask for: by the number of cells or by their size, whichever the scene gives.
void check_lattice_memory(const Scene& scene, const lattice::Surface& skin, const Talk& talk);

}  // namespace sinew::tools
