#pragma once

#include <string>

#include "assets/detail/imported_scene.h"

namespace sinew::assets::detail {

/// Reads glTF 2.0 (.gltf or .glb) in the file's own vertex order, one mesh per primitive. Runs third-party
/// code: call it in the importer process. Throws InputError, IoError or LimitError.
ImportedScene read_gltf(const std::string& file);

}  // namespace sinew::assets::detail
