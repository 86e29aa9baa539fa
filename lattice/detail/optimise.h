#pragma once

#include "lattice/detail/tetrahedralise.h"

namespace sinew::lattice::detail {

/// Unit coordinates: raises the quality of the cells by flips and by moving vertices, pulls
/// the boundary to 0.2 h outside the skin, and never lets go of a sample. Joints stay, vertices on bones
/// slide along them, edges of bones are kept. Moves `points`, replaces `cells`; neither where `poll` throws.
void optimise(LatticePoints& points, Tetrahedra& cells, const ReducedSkeleton& skeleton, const UnitSkin& skin,
              const SkinSamples& samples, double h, const CellSizes& sizes = {}, const Poll& poll = {});

}  // namespace sinew::lattice::detail
