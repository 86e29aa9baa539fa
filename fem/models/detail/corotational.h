#pragma once

#include "fem/models/model.h"

/// Corotational flesh: every leaf cell is linear in its own rotation, the polar part of its mean deformation
/// gradient. The forces are the slope of a potential (fem/models/detail/corotational_cells.h), linear for a
/// stage from its predicted end on.
namespace sinew::fem {

std::unique_ptr<Model> make_corotational(const Body& body, const SolverOptions& options);

}  // namespace sinew::fem
