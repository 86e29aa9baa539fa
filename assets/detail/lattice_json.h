#pragma once

#include <string>

#include "lattice/control_lattice.h"
#include "lattice/surface.h"

namespace sinew::assets::detail {

/// All of a lattice but its cells and points as JSON text; doubles keep their bits. Joints are kept by name.
std::string lattice_to_json(const lattice::ControlLattice& lattice, const lattice::JointTree& joints);

/// Fills in everything but the cells and points, with joints found by name in `joints`. `where` opens every
/// message. Throws InputError naming the key, bone or joint.
void lattice_from_json(const std::string& where, const std::string& text, const lattice::JointTree& joints,
                       lattice::ControlLattice& lattice);

}  // namespace sinew::assets::detail
