#include "tools/commands/scene_flags.h"

#include <algorithm>
#include <variant>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <fmt/format.h>

#include "tools/scene/scene_fields.h"

namespace sinew::tools {
namespace {

std::string help_with_default(const SceneField& field) {
  const std::string value = flag_text(Scene{}, field);
  return value.empty() ? help_text(field) : fmt::format("{} [{}]", help_text(field), value);
}

/// What stands for the value in --help.
std::string placeholder(const SceneField& field) {
  if (field.key == "output") return "DIR";
  if (!field.unit.empty()) return std::string(field.unit);
  if (std::holds_alternative<PathMember>(field.member)) return "FILE";
  if (std::holds_alternative<int Scene::*>(field.member)) return "N";
  if (std::holds_alternative<std::vector<int> Scene::*>(field.member)) return "N,N,...";
  if (std::holds_alternative<double Scene::*>(field.member)) return "X";
  if (std::holds_alternative<std::optional<FrameRange> Scene::*>(field.member)) return "A-B";
  return "NAME";
}

}  // namespace

void SceneFlags::add_to(CLI::App& command, std::span<const std::string_view> keys) {
  for (const SceneField& field : scene_fields()) {
    const std::string key(field.key);
    if (key == "rig") continue;  // the positional argument
    if (!keys.empty() && std::find(keys.begin(), keys.end(), field.key) == keys.end()) continue;
    const std::string name = (key == "output" ? "-o," : "") + flag_name(field);
    if (std::holds_alternative<bool Scene::*>(field.member)) {
      command.add_flag(name, switches_[key], std::string(field.help));
    } else {
      command.add_option(name, flags_[key], help_with_default(field))->type_name(placeholder(field));
    }
  }
}

void SceneFlags::apply(Scene& scene) const {
  for (const auto& [key, text] : flags_) {
    const SceneField& field = *find_scene_field(key);
    if (text) set_from_text(scene, field, *text, flag_name(field));
  }
  for (const auto& [key, given] : switches_) {
    const SceneField& field = *find_scene_field(key);
    if (given) set_from_text(scene, field, "", flag_name(field));
  }
}

}  // namespace sinew::tools
