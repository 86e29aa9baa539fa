#pragma once

#include <memory>
#include <string>

#include "fem/linear/factor.h"
#include "fem/models/detail/rotated_stiffness.h"

namespace sinew::fem {

/// How the one linear system of a stage is solved.
struct RotatedOptions {
  /// Share of a stage's first residual that the conjugate gradients leave [-]: this times (w0 h)^2, w0 = 2 pi
  /// times the damping frequency, which is what the step itself errs by, and at most `loosest`; never less
  /// than `tolerance` of the forces that balance.
  double time_share = 1e-3;
  double loosest = 1e-4;          ///< in (0, 1).
  double tolerance = 1e-6;        ///< in (0, 1).
  double rest_tolerance = 1e-10;  ///< the same at rest.
  /// Iterations after which the preconditioner is factored anew; >= 1.
  int stale_after = 15;
  Precision precision = Precision::Float;  ///< of the preconditioner.
  int max_rest_iterations = 200;           ///< >= 1.
};

/// The defaults with what a solver is asked for.
RotatedOptions rotated_options(const SolverOptions& solver);

/// A model whose cells are linear in rotations of their own: one symmetric system per stage,
///   [inertia M + P + (1 + damping) sum_e R_e K_e R_e^T] dx = residual,
/// solved by conjugate gradients. The preconditioner is a Cholesky factor of an earlier stage's system,
/// turned at every vertex by what the cells round it have turned since, so that it lasts while the flesh
/// swings.
std::unique_ptr<Model> make_rotated_model(std::string name, const Body& body, CellRotations rotations,
                                          const RotatedOptions& options = {});

/// The same with the polar rotations of the cells, which follow the places, and forces that are the slope of
/// a potential (fem/models/detail/corotational_cells.h). A stage that changes the cells much is solved again
/// with their new rotations until its forces balance, in the last resort, as a rest is, by Newton's method.
std::unique_ptr<Model> make_polar_model(std::string name, const Body& body,
                                        const RotatedOptions& options = {});

}  // namespace sinew::fem
