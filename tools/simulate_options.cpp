#include "tools/simulate_options.h"

#include <algorithm>
#include <filesystem>
#include <variant>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <fmt/format.h>

#include "assets/error.h"
#include "tools/scene_fields.h"

namespace sinew::tools {
namespace {

bool is_scene_file(const std::string& file) {
  std::string extension = std::filesystem::path(file).extension().string();
  for (char& letter : extension) {
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  }
  return extension == ".toml";
}

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
  if (std::holds_alternative<double Scene::*>(field.member)) return "X";
  if (std::holds_alternative<std::optional<FrameRange> Scene::*>(field.member)) return "A-B";
  return "NAME";
}

}  // namespace

void SimulateOptions::add_to(CLI::App& command) {
  command.add_option("input", input_, "scene file (.toml), or a rig: glTF, GLB, FBX, Collada, ...")
      ->type_name("SCENE.toml|RIG");
  for (const SceneField& field : scene_fields()) {
    const std::string key(field.key);
    if (key == "rig") continue;  // the positional argument
    const std::string name = (key == "output" ? "-o," : "") + flag_name(field);
    if (std::holds_alternative<bool Scene::*>(field.member)) {
      command.add_flag(name, switches_[key], std::string(field.help));
    } else {
      command.add_option(name, flags_[key], help_with_default(field))->type_name(placeholder(field));
    }
  }
  command.add_flag("--print-scene", print_scene_only_, "print the whole scene in force as TOML and stop");
}

Scene SimulateOptions::scene() const {
  Scene scene;
  if (is_scene_file(input_)) {
    scene = read_scene(input_);
  } else {
    scene.rig = input_;
  }
  for (const auto& [key, text] : flags_) {
    const SceneField& field = *find_scene_field(key);
    if (text) set_from_text(scene, field, *text, flag_name(field));
  }
  for (const auto& [key, given] : switches_) {
    const SceneField& field = *find_scene_field(key);
    if (given) set_from_text(scene, field, "", flag_name(field));
  }
  scene.validate();
  if (print_scene_only_) return scene;
  if (scene.rig.empty() && !scene.plain) {
    throw assets::ConfigError(
        input_.empty() ? "the rig is missing, expected sinew simulate (SCENE.toml | RIG) -o OUT; hint: try "
                         "assets/samples/hopper.glb"
                       : fmt::format("{}: rig is missing; hint: rig = \"character.glb\"", input_));
  }
  if (scene.output.empty()) {
    throw assets::ConfigError("--output: missing, expected a directory for the results; hint: -o out");
  }
  return scene;
}

}  // namespace sinew::tools
