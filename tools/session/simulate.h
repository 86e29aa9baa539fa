#pragma once

#include <string>

#include "tools/scene/scene.h"
#include "tools/support/caller.h"

namespace sinew::tools {

/// Runs a checked scene and writes its output folder; gives back the report as it stands in report.json.
/// Throws the errors of assets/error.h, NumericalError and Stopped; then nothing is written.
std::string simulate(const Scene& scene, const Caller& caller);

}  // namespace sinew::tools
