#pragma once

#include <string>
#include <vector>

#include "assets/detail/fbx_document.h"
#include "assets/detail/imported_scene.h"

namespace sinew::assets::detail {

/// assimp makes inverse bind matrices from where a mesh's node stands now, which is wrong where the mesh was
/// moved after it was bound. Takes the file's own matrices instead. Throws InputError where the file has
/// clusters but no mesh came with a skin, that is, where the importer lost it.
void take_fbx_bind_matrices(const std::string& file, const std::vector<FbxCluster>& clusters,
                            ImportedScene& scene);

}  // namespace sinew::assets::detail
