#pragma once

#include <string>

#include "tools/commands/scene_flags.h"
#include "tools/scene/scene.h"

namespace CLI {
class App;
}

namespace sinew::tools {

/// The arguments of `sinew simulate`: (SCENE.toml | RIG) and one flag per key of a scene; flags win over the
/// file. Must outlive the parsing of the app it was added to.
class SimulateOptions {
 public:
  void add_to(CLI::App& command);

  /// After parsing: the scene in force, checked. A run needs a rig and an output; printing the scene needs
  /// neither. Throws assets::ConfigError (the flag or <file>:<line> first), assets::LimitError,
  /// assets::IoError.
  Scene scene() const;

  /// --print-scene: print the scene in force (print_scene) and stop.
  bool print_scene_only() const { return print_scene_only_; }

 private:
  std::string input_;
  bool print_scene_only_ = false;
  SceneFlags flags_;
};

}  // namespace sinew::tools
