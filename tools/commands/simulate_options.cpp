#include "tools/commands/simulate_options.h"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <fmt/format.h>

#include "assets/error.h"

namespace sinew::tools {
void SimulateOptions::add_to(CLI::App& command) {
  command.add_option("input", input_, "scene file (.toml), or a rig: glTF, GLB, FBX, Collada, ...")
      ->type_name("SCENE.toml|RIG");
  flags_.add_to(command);
  command.add_flag("--print-scene", print_scene_only_, "print the whole scene in force as TOML and stop");
}

Scene SimulateOptions::scene() const {
  Scene scene;
  if (is_scene_file(input_)) {
    scene = read_scene(input_);
  } else {
    scene.rig = input_;
  }
  flags_.apply(scene);
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
