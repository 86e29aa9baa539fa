#pragma once

#include <nlohmann/json.hpp>

#include "assets/rig.h"
#include "fem/skin/skin_verdict.h"

namespace sinew::tools::detail {

/// The measures of one frame's skin as reports have them. Lengths in heights of the character and areas in
/// the judged skin's, so that one limit fits all; places by bone and part.
nlohmann::ordered_json skin_json(const fem::SkinFrame& frame, const assets::Rig& rig);

}  // namespace sinew::tools::detail
