#pragma once

#include <string>
#include <string_view>

#include "assets/detail/imported_scene.h"

/// The form in which the importer process hands a scene to its parent.
namespace sinew::assets::detail {

/// Bytes of a scene; read_scene() gives it back bit for bit.
std::string write_scene(const ImportedScene& scene);

/// Trusts nothing: every count is compared with the bytes that are left before anything is allocated. Throws
/// std::runtime_error where the bytes are not a whole scene. Indices inside are for check_scene() to judge.
ImportedScene read_scene(std::string_view bytes);

}  // namespace sinew::assets::detail
