#pragma once

#include <vector>

#include "assets/islands.h"

namespace sinew::assets::detail {

/// Chooses the role of every island (as find_islands says) and writes down why.
void choose_roles(const Rig& rig, std::vector<Island>& islands);

}  // namespace sinew::assets::detail
