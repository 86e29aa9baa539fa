#pragma once

#include <string>
#include <string_view>

#include "assets/rig.h"
#include "tools/scene/scene.h"
#include "tools/session/character.h"

/// What becomes of the pieces of a rig's skin: flesh, or props that keep their shape.
namespace sinew::tools {

/// Finds the islands of the rig's skin, gives them the roles that suit them or that the scene names, and says
/// which are props, and why. Throws assets::ConfigError for a part or bone that is not there, or a role that
/// it cannot have.
void settle_roles(const Scene& scene, assets::Rig& rig, const Talk& talk);

/// One line about a prop.
std::string prop_line(const assets::Rig& rig, const assets::Prop& prop);

}  // namespace sinew::tools
