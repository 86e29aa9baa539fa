#pragma once

#include <optional>
#include <string>

#include "tools/scene/scene.h"
#include "tools/support/caller.h"

namespace sinew::tools {

struct PoseRequest {
  std::optional<double> time;  ///< in the clip [s]; left out: that of the first frame.
  int load_steps = 4;          ///< in which pose, gravity and loads grow; 1 ... 10000.
};

/// Finds where the flesh of a checked scene comes to rest in one pose and writes its output folder; gives
/// back the report as it stands in pose.json. Throws the errors of assets/error.h, NumericalError and
/// Stopped; then nothing is written.
std::string pose(const PoseRequest& request, const Scene& scene, const Caller& caller);

}  // namespace sinew::tools
