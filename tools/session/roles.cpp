#include "tools/session/roles.h"

#include <algorithm>
#include <vector>

#include <fmt/format.h>

#include "assets/error.h"
#include "assets/islands.h"

namespace sinew::tools {
namespace {

using assets::Island;

void give(Island& island, assets::PartRole role) {
  island.role = role;
  island.reason = "as the scene says";
}

/// Bones speak of all that hangs on them alone.
void follow_bones(const Scene& scene, const assets::Rig& rig, std::vector<Island>& islands) {
  std::vector<std::string> names;
  for (const skeleton::Joint& joint : rig.skeleton.joints()) names.push_back(joint.name);
  for (std::size_t i = 0; i < scene.bone_roles.size(); ++i) {
    const RoleOf& wanted = scene.bone_roles[i];
    const std::vector<int> joints = joints_of({wanted.name}, names, fmt::format("bone {}", i + 1));
    bool used = false;
    for (Island& island : islands) {
      if (!std::binary_search(joints.begin(), joints.end(), island.joint)) continue;
      give(island, wanted.role);
      used = true;
    }
    if (used || wanted.role == assets::PartRole::Simulated) continue;
    throw assets::ConfigError(fmt::format(
        "bone {}: no island of the skin hangs on '{}' alone, expected one; hint: [[material]] with "
        "a large young makes flesh stiff that hangs on several bones",
        i + 1, wanted.name));
  }
}

void follow_parts(const Scene& scene, std::vector<Island>& islands) {
  std::vector<std::string> names;
  for (const Island& island : islands) names.push_back(island.name);
  for (std::size_t i = 0; i < scene.part_roles.size(); ++i) {
    const RoleOf& wanted = scene.part_roles[i];
    const std::vector<int> found = matching(wanted.name, names);
    if (found.empty())
      throw assets::ConfigError(fmt::format("part {}: {}", i + 1, no_such("part", wanted.name, names)));
    for (const int k : found) give(islands[static_cast<std::size_t>(k)], wanted.role);
  }
}

}  // namespace

std::string prop_line(const assets::Rig& rig, const assets::Prop& prop) {
  return fmt::format("{} (island of {} vertices{}): {}, {}", prop.name, prop.vertices.size(),
                     prop.joint < 0 ? "" : fmt::format(" on '{}'", rig.skeleton.joint(prop.joint).name),
                     role_name(prop.role), prop.reason);
}

void settle_roles(const Scene& scene, assets::Rig& rig, const Talk& talk) {
  std::vector<Island> islands = assets::find_islands(rig);
  follow_bones(scene, rig, islands);
  follow_parts(scene, islands);
  assets::set_roles(rig, islands);
  constexpr std::size_t kMostShown = 12;
  for (std::size_t i = 0; i < std::min(rig.props.size(), kMostShown); ++i) talk(prop_line(rig, rig.props[i]));
  if (rig.props.size() <= kMostShown) return;
  const auto first = rig.props.begin() + kMostShown;
  const auto riding = std::count_if(
      first, rig.props.end(), [](const assets::Prop& prop) { return prop.role == assets::PartRole::Riding; });
  talk(fmt::format("and {} more props, {} of them riding; sinew inspect lists them",
                   rig.props.size() - kMostShown, riding));
}

}  // namespace sinew::tools
