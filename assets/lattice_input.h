#pragma once

#include "assets/rig.h"
#include "lattice/surface.h"

namespace sinew::assets {

/// What the lattice builder takes: plain points in the rig's rest space.
struct LatticeInput {
  /// The simulated parts, welded; influences name joints of the rig.
  PhysicsSkin skin;
  /// Every joint of the rig, in its order, so that frame indices of the lattice are joint indices of the rig.
  lattice::JointTree joints;
};

/// Turns a rig into the builder's input. Throws InputError where no part is simulated or the
/// skin is flat.
LatticeInput lattice_input(const Rig& rig);

}  // namespace sinew::assets
