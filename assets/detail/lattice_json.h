#pragma once

#include <string>
#include <vector>

#include "lattice/check_cells.h"
#include "lattice/control_lattice.h"
#include "lattice/surface.h"

namespace sinew::assets::detail {

/// All of a lattice but its cells and points as JSON text; doubles keep their bits. Joints are kept by name.
/// `cell_order`: where the format groups cells by type, the place in the file of each cell; else empty.
std::string lattice_to_json(const lattice::ControlLattice& lattice, const lattice::JointTree& joints,
                            const std::vector<int>& cell_order = {});

/// Fills in everything but the points of a lattice that has its cells, and brings these into their order.
/// Joints are found by name in `joints`. Returns whether cells may lie at the same place without being
/// joined. `where` opens every message. Throws InputError naming the key, bone or joint.
lattice::Coincidence lattice_from_json(const std::string& where, const std::string& text,
                                       const lattice::JointTree& joints, lattice::ControlLattice& lattice);

}  // namespace sinew::assets::detail
