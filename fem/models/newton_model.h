#pragma once

#include <memory>
#include <string>

#include "fem/models/cell_energy.h"
#include "fem/models/model.h"

namespace sinew::fem {

/// When the balance of forces counts as reached.
struct NewtonOptions {
  /// Residual over the forces that balance [-]; in (0, 1). Of a stage; at rest `rest_tolerance` holds.
  double tolerance = 1e-6;
  double rest_tolerance = 1e-10;
  int max_iterations = 50;  ///< >= 1.
};

/// A model given by the energy of its cells: full Newton on the incremental potential
///   inertia/2 |x - target|_M^2 + ties + energy(x) - load . x,
/// backtracking until the potential falls. Where the Hessian has no Cholesky factor, each cell's is replaced
/// by its positive semidefinite part, so that the step descends.
std::unique_ptr<Model> make_newton_model(std::string name, const Body& body,
                                         std::unique_ptr<CellEnergy> energy,
                                         const NewtonOptions& options = {});

}  // namespace sinew::fem
