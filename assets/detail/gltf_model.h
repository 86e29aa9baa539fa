#pragma once

#include <string>

#include "assets/detail/gltf_container.h"

namespace tinygltf {
class Model;
}

namespace sinew::assets::detail {

/// Parses a container with tinygltf; no other file is opened. Throws InputError (with `file`).
void parse_gltf(const std::string& file, const GltfContainer& container, tinygltf::Model& model);

}  // namespace sinew::assets::detail
