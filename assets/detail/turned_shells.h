#pragma once

#include "assets/rig.h"

namespace sinew::assets::detail {

/// Fills Part::turned: in every shell of flesh that is closed (each edge has two triangles once points at one
/// place are one), triangles that are wound against the others, and all of them where the shell is inside
/// out. An inside-out shell within a shell that is not is a cavity and stays one. What was turned is added to
/// `rig.findings`.
void turn_shells(Rig& rig);

}  // namespace sinew::assets::detail
