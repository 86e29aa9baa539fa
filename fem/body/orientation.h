#pragma once

#include "lattice/basis.h"

namespace sinew::fem {

/// Throws std::invalid_argument naming the leaf cell where one is inverted at a Gauss point.
void check_orientation(const lattice::LeafMesh& mesh);

}  // namespace sinew::fem
