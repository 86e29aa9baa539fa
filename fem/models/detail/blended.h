#pragma once

#include "fem/models/model.h"

/// Blended local linearisation ([Capell02, sec. 5]) as a model: fem/models/detail/blended_solver.h behind the
/// interface.
namespace sinew::fem {

std::unique_ptr<Model> make_blended(const Body& body, const SolverOptions& options);

}  // namespace sinew::fem
