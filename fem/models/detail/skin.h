#pragma once

#include "fem/models/model.h"

/// Free-form deformation by the bones: lattice vertices skinned by the frames, no inertia, no solve.
namespace sinew::fem {

std::unique_ptr<Model> make_skin(const Body& body, const SolverOptions& options);

}  // namespace sinew::fem
