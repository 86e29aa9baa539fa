#pragma once

#include "assets/rig.h"

namespace sinew::assets::detail {

/// Looks at the simulated skin as a surface and adds findings for what a modeller should know: triangles
/// without area, open borders, edges shared by more than two triangles, separate shells. None of them stops a
/// simulation.
void report_skin(Rig& rig);

}  // namespace sinew::assets::detail
