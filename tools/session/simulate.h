#pragma once

#include "tools/scene/scene.h"
#include "tools/session/character.h"

namespace sinew::tools {

/// Runs a checked scene and writes its output folder; what `sinew simulate` does after its flags are read.
/// Prints the report on stdout where the scene asks for JSON. Throws the errors of assets/error.h,
/// NumericalError, Interrupted.
void simulate(const Scene& scene, const Talk& talk);

}  // namespace sinew::tools
