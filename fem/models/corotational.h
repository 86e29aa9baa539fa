#pragma once

#include "fem/models/model.h"

/// Corotational flesh: every leaf cell is linear in its own rotation, the polar part of its mean deformation
/// gradient, taken at the predicted end of the stage.
namespace sinew::fem {

std::unique_ptr<Model> make_corotational(const Body& body, const SolverOptions& options);

}  // namespace sinew::fem
