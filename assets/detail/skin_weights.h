#pragma once

#include <vector>

#include "assets/detail/imported_scene.h"

namespace sinew::assets::detail {

/// Makes the weights of every skinned mesh sum to 1: influences of one joint are added up, sums are divided
/// out, weights that are no finite numbers count as none, and vertices without any weight take those of a
/// neighbour along the mesh (else of the nearest weighted vertex). What was wrong is added to
/// `scene.findings`. A mesh whose vertices all lack weights becomes unskinned.
void normalise_weights(ImportedScene& scene);

}  // namespace sinew::assets::detail
