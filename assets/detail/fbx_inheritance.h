#pragma once

#include <map>
#include <string>

#include "assets/detail/fbx_document.h"
#include "assets/detail/imported_scene.h"

namespace sinew::assets::detail {

/// Puts right what plain matrix products get wrong where an FBX node does not inherit scale the plain way
/// (RSrs):
///   Rrs   the parent's own scale is left out:  world = parent T S_p^-1 R S
///   RrSs  scales gather apart from rotations:  world = R_p R S_p S
/// Both are exact with one more node between parent and child, which holds the child's translation T and the
/// inverse of the gathered scale; nodes for which it makes no difference stay as they are. Where a clip
/// animates the scale, the inverse is sampled between keys.
void apply_fbx_inheritance(const std::map<std::string, FbxInherit>& inherit, ImportedScene& scene);

}  // namespace sinew::assets::detail
