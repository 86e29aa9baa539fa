#pragma once

#include <string>

#include "assets/detail/imported_scene.h"
#include "assets/rig.h"

namespace sinew::assets::detail {

/// Turns a checked scene into a rig: normalised weights, one rest pose, SI units and Y up, unique names,
/// roles, clips on joints. A file without skin or clip gives a rig with a finding of severity Error. Throws
/// InputError.
Rig build_rig(const std::string& file, ImportedScene scene, const LoadOptions& options);

}  // namespace sinew::assets::detail
