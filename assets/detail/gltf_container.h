#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace sinew::assets::detail {

/// A glTF file after everything that can be judged without reading an accessor was judged: a GLB in memory
/// with what a rig does not need (images, textures, materials, cameras) taken out.
struct GltfContainer {
  std::string glb;
  /// External buffers, by the stand-in name that the JSON inside `glb` uses for them.
  std::map<std::string, std::string> external_buffers;
};

/// Takes the bytes of a .glb or .gltf apart. Checks the GLB header and chunks, the JSON (syntax, depth, whole
/// numbers in range), required extensions and the places that URIs point to. `file` serves for messages and
/// for the directory that external buffers must stay in. Throws InputError or LimitError.
GltfContainer read_gltf_container(const std::string& file, std::string_view bytes);

}  // namespace sinew::assets::detail
