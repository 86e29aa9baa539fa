#pragma once

#include "fem/models/model.h"

/// One linear system for the whole flesh: every leaf cell is linear in the rotation of its frames, blended by
/// their weights. The pose alone decides the matrix.
namespace sinew::fem {

std::unique_ptr<Model> make_blended_stiffness(const Body& body, const SolverOptions& options);

}  // namespace sinew::fem
