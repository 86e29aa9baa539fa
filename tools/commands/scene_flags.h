#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "tools/scene/scene.h"

namespace CLI {
class App;
}

namespace sinew::tools {

/// Keys of a scene as flags of a command. Must outlive the parsing of the app it was added to.
class SceneFlags {
 public:
  /// One flag for each of `keys`; for every key but the rig where there are none.
  void add_to(CLI::App& command, std::span<const std::string_view> keys = {});

  /// After parsing: sets what was given. Throws assets::ConfigError naming the flag.
  void apply(Scene& scene) const;

 private:
  /// By key, in a std::map as the parser keeps the addresses.
  std::map<std::string, std::optional<std::string>> flags_;
  std::map<std::string, bool> switches_;
};

}  // namespace sinew::tools
