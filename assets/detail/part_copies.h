#pragma once

#include "assets/rig.h"

namespace sinew::assets::detail {

/// Modellers often keep an unskinned, finer body over the skinned one. Every unskinned part that fills the
/// same space as the simulated skin and hugs it is bound to it: each of its vertices takes the weights of the
/// closest point of the skin, and its role becomes Skinned. A finding names it.
void bind_coincident_copies(Rig& rig);

}  // namespace sinew::assets::detail
