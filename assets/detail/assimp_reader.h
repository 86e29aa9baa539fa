#pragma once

#include <string>

#include "assets/detail/imported_scene.h"

namespace sinew::assets::detail {

/// Reads FBX, Collada, BVH, X, OBJ and whatever else assimp reads. assimp may crash on bad files: call it in
/// the importer process. Vertices that agree in position and weights are joined (first occurrence keeps its
/// place), since assimp writes one per corner. Throws InputError or LimitError.
ImportedScene read_with_assimp(const std::string& file);

}  // namespace sinew::assets::detail
