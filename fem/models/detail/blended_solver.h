#pragma once

#include <memory>

#include "fem/body/body.h"
#include "fem/linear/factor.h"
#include "fem/models/stage_problem.h"

/// Blended local linearisation: one prefactored linear system per region, blended by the region weights
/// ([Capell02, sec. 5]).
namespace sinew::fem {

class BlendedSolver {
 public:
  /// `body` must outlive the solver.
  BlendedSolver(const Body& body, const SolverOptions& options = {});
  ~BlendedSolver();
  BlendedSolver(BlendedSolver&&) noexcept;

  /// Factors all regions' systems for a step h [s] and an integrator; does nothing where they are there
  /// already. The report names the region and vertex where a system is not positive definite.
  [[nodiscard]] Factor::Report prepare(double h, Integrator integrator);

  /// Velocity v+ [m/s] at the stage for all leaf vertices. Bone vertices get the velocity that puts them on
  /// the clip at the stage. prepare(h, integrator) must have succeeded. problem.force is not looked at.
  lattice::Points stage_velocity(const StageProblem& problem);

  SolverCounts counts() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew::fem
