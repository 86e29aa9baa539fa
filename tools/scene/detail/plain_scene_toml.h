#pragma once

#include "tools/scene/detail/toml_reader.h"
#include "tools/scene/plain_scene.h"

namespace sinew::tools::detail {

/// The keys of a plain scene at the top of a file, in alphabetical order. `lattice` is one of them where it
/// is a table.
std::vector<std::string> plain_scene_keys();

/// Reads one of them into `plain`. Types are checked here, values by PlainScene::validate.
void read_plain_scene(const TomlReader& reader, const std::string& key, const toml::node& node,
                      PlainScene& plain);

}  // namespace sinew::tools::detail
