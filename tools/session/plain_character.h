#pragma once

#include "assets/lattice_input.h"
#include "assets/rig.h"
#include "fem/body/body.h"
#include "lattice/control_lattice.h"
#include "tools/scene/scene.h"

namespace sinew::tools {

/// What a plain scene stands for: a rig and a lattice as files would give them.
struct PlainCharacter {
  assets::Rig rig;  ///< one part, the box's sides; one joint per bone; one clip.
  assets::LatticeInput input;
  lattice::ControlLattice lattice;
  std::vector<fem::HeldPlane> held;
  std::vector<int> bare_frames;  ///< the joint of a body that nothing holds.
};

/// Makes it; `scene.plain` must be there and valid. The skin is the boundary of the box subdivided once. Its
/// weights fall with the fourth power of the distance to bones and held sides. Throws assets::InputError
/// naming the bone that is no chain of lattice edges.
PlainCharacter make_plain_character(const Scene& scene);

}  // namespace sinew::tools
