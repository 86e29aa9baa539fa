#pragma once

#include <string>
#include <vector>

#include "fem/linear/repeated_factor.h"
#include "fem/models/balance.h"
#include "fem/models/cell_energy.h"
#include "fem/models/detail/free_system.h"
#include "fem/models/model.h"

namespace sinew::fem {

/// When the balance of forces counts as reached.
struct NewtonOptions {
  /// Residual over the forces that balance [-]; in (0, 1). Of a stage; at rest `rest_tolerance` holds.
  double tolerance = 1e-6;
  double rest_tolerance = 1e-10;
  int max_iterations = 50;  ///< >= 1; at rest max_rest_iterations.
  int max_rest_iterations = 50;
};

/// Full Newton on the incremental potential
///   inertia/2 |x - target|_M^2 + ties + energy(x) - load . x
/// of cells that have an energy, backtracking until the potential falls. Where the Hessian has no Cholesky
/// factor, each cell's is moved toward its positive semidefinite part until there is one, so that the step
/// descends.
class NewtonSolver {
 public:
  /// All of them must outlive the solver; what `system` holds is replaced.
  NewtonSolver(std::string name, const Body& body, const FreeVertices& free, BlockSystem& system,
               CellEnergy& energy, const NewtonOptions& options = {});

  /// Moves to the balance, from `move`, until what is left over is `tolerance` of the forces that balance
  /// [-]. `move` is untouched unless the report is ok.
  SolveReport solve(const Balance& balance, double tolerance, lattice::Points& move);

  std::size_t factor_nonzeros() const { return factor_.num_nonzeros(); }

 private:
  /// What is known at a move.
  struct Iterate {
    lattice::Points move, elastic, residual;  ///< residual: at the unknowns.
    OuterForces outer;
    double energy = 0.0;  ///< elastic.
  };
  template <class Action>
  void each_cell(const Action& action, const lattice::Points& x) const;
  double elastic_energy(const lattice::Points& x);
  /// Elastic forces f(x) on the leaf vertices.
  lattice::Points elastic_forces(const lattice::Points& x);
  Iterate iterate(const Balance& balance, lattice::Points move);
  Factor::Report factorise(const Balance& balance, const lattice::Points& x);
  bool search(const Balance& balance, const lattice::Points& step, double unresolved, Iterate& at);

  std::string name_;
  const Body& body_;
  const FreeVertices& free_;
  BlockSystem& system_;
  CellEnergy& energy_;
  NewtonOptions options_;
  CellSum cell_sum_;
  RepeatedFactor factor_;
  std::vector<CellStiffness> hessians_;
  std::vector<CellVector> gradients_;
  std::vector<double> energies_;
  Eigen::VectorXd mass_diagonal_;  ///< of M at the unknowns.
};

}  // namespace sinew::fem
