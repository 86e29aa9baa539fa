#include "fem/models/detail/newton_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

namespace sinew::fem {

using lattice::Points;

NewtonSolver::NewtonSolver(std::string name, const Body& body, const FreeVertices& free, BlockSystem& system,
                           CellEnergy& energy, const NewtonOptions& options)
    : name_(std::move(name)),
      body_(body),
      free_(free),
      system_(system),
      energy_(energy),
      options_(options),
      cell_sum_(body),
      hessians_(body.mesh.cells.size(), CellStiffness::Zero()),
      gradients_(body.mesh.cells.size()),
      energies_(body.mesh.cells.size()) {
  system_.assemble({1.0, 0.0, 0.0}, hessians_);
  mass_diagonal_ = system_.diagonal();
}

template <class Action>
void NewtonSolver::each_cell(const Action& action, const Points& x) const {
  tbb::parallel_for(0, static_cast<int>(body_.mesh.cells.size()),
                    [&](int c) { action(c, cell_points(x, body_.mesh.cells[static_cast<std::size_t>(c)])); });
}

double NewtonSolver::elastic_energy(const Points& x) {
  each_cell(
      [&](int c, const CellPoints& p) { energies_[static_cast<std::size_t>(c)] = energy_.energy(c, p); }, x);
  double sum = 0.0;
  for (double e : energies_) sum += e;
  return sum;
}

Points NewtonSolver::elastic_forces(const Points& x) {
  each_cell(
      [&](int c, const CellPoints& p) { gradients_[static_cast<std::size_t>(c)] = energy_.gradient(c, p); },
      x);
  return cell_sum_(gradients_);
}

Factor::Report NewtonSolver::factorise(const Balance& balance, const Points& x) {
  each_cell(
      [&](int c, const CellPoints& p) { hessians_[static_cast<std::size_t>(c)] = energy_.hessian(c, p); }, x);
  system_.assemble({balance.inertia, 1.0, 1.0 + balance.damping}, hessians_);
  Factor::Report report = factor_.factorise(system_.lower());
  if (report.ok) return report;
  // As little of the positive parts as does: all of them make the flesh so stiff that near a state from which
  // it might buckle the residual falls by a few percent a step.
  const std::vector<CellStiffness> whole = hessians_;
  std::vector<CellStiffness> positive(whole.size());
  each_cell(
      [&](int c, const CellPoints& p) {
        positive[static_cast<std::size_t>(c)] = energy_.semidefinite_hessian(c, p);
      },
      x);
  for (double share : {1.0 / 32.0, 1.0 / 8.0, 1.0 / 2.0, 1.0}) {
    for (std::size_t c = 0; c < whole.size(); ++c)
      hessians_[c] = share < 1.0 ? CellStiffness(whole[c] + share * (positive[c] - whole[c])) : positive[c];
    system_.assemble({balance.inertia, 1.0, 1.0 + balance.damping}, hessians_);
    report = factor_.factorise(system_.lower());
    if (report.ok) return report;
  }
  // Flesh squeezed flat may have no stiffness left in some direction.
  system_.shift_diagonal(1e-6 * system_.diagonal().maxCoeff());
  return factor_.factorise(system_.lower());
}

NewtonSolver::Iterate NewtonSolver::iterate(const Balance& balance, Points move) {
  Iterate at;
  const Points x = balance.origin + move;
  at.outer = outer_forces(body_, balance, move);
  at.elastic = elastic_forces(x);
  at.energy = elastic_energy(x);
  at.residual = free_.gather(at.outer.sum - at.elastic);
  at.move = std::move(move);
  return at;
}

/// Goes along `step` as far as the energy falls enough. Changes below `unresolved` drown in the rounding of
/// an energy of 1 m of flesh: there the slope has to fall instead (the approximate Wolfe condition of
/// [Hager05]).
bool NewtonSolver::search(const Balance& balance, const Points& step, double unresolved, Iterate& at) {
  const Points leaf_step = free_.spread(step);
  const double slope = -at.residual.cwiseProduct(step).sum();
  double length = 1.0;
  for (int k = 0; k < 30; ++k, length *= 0.5) {
    Iterate tried = iterate(balance, at.move + length * leaf_step);
    // The outer forces are linear in the move: their potential's change is exact as a mean.
    const double change = tried.energy - at.energy -
                          0.5 * length * (at.outer.sum + tried.outer.sum).cwiseProduct(leaf_step).sum();
    const double noise = 1e-13 * (std::abs(at.energy) + std::abs(tried.energy));
    bool enough = change <= 1e-4 * length * slope + noise;
    if (!enough && -length * slope <= unresolved)
      enough = std::abs(tried.residual.cwiseProduct(step).sum()) <= 0.9 * std::abs(slope);
    if (!enough) continue;
    at = std::move(tried);
    return true;
  }
  return false;
}

SolveReport NewtonSolver::solve(const Balance& balance, double tolerance, Points& move) {
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  energy_.set_damping(balance.damping, balance.past);
  SolveReport report;
  Iterate at = iterate(balance, move);
  const double extent = (balance.origin + move).rowwise().norm().maxCoeff();
  double rounding = 0.0;  ///< what is left of a residual that is zero, of the elastic forces.
  const auto stagnated = [&] {
    report.message = kStagnated;
    move = at.move;
    return report;
  };
  const int most = balance.inertia > 0.0 ? options_.max_iterations : options_.max_rest_iterations;
  for (; report.iterations < most; ++report.iterations) {
    const double scale = at.outer.scale + at.elastic.norm();
    report.residual = at.residual.norm() / std::max(scale, std::numeric_limits<double>::min());
    if (!std::isfinite(report.residual)) break;
    if (at.residual.norm() <= tolerance * scale) {
      move = at.move;
      return report;
    }
    const Factor::Report factor = factorise(balance, balance.origin + at.move);
    if (!factor.ok) {
      report.status = SolveStatus::NotPositiveDefinite;
      report.message = name_ + ": " + factor.message;
      name_worst_cell(body_, balance.origin + at.move, free_.spread(at.residual), report);
      return report;
    }
    Eigen::VectorXd direction = Eigen::Map<const Eigen::VectorXd>(at.residual.data(), at.residual.size());
    factor_.solve(direction);
    const Points step = Eigen::Map<const Points>(direction.data(), at.residual.rows(), 3);

    // Elastic forces are exact to the last digit of the places only. What that digit moves, with the inertia
    // against it, is as near as the balance can be found, however stiff some of the flesh is.
    const Eigen::ArrayXd diagonal = system_.diagonal().array();
    const Eigen::ArrayXd elastic = (diagonal - balance.inertia * mass_diagonal_.array()).max(0.0);
    rounding = 4.0 * kEpsilon * extent * elastic.matrix().norm();
    if ((direction.array().abs() * diagonal <= 4.0 * kEpsilon * extent * elastic).all()) return stagnated();
    if (!search(balance, step, kEpsilon * extent * extent * elastic.matrix().norm(), at)) break;
  }
  if (at.residual.norm() <= rounding) return stagnated();
  report.status = SolveStatus::NoConvergence;
  report.message = fmt::format("{}: no balance of forces after {} iterations, residual {:.2g} of the forces",
                               name_, report.iterations, report.residual);
  name_worst_cell(body_, balance.origin + at.move, free_.spread(at.residual), report);
  return report;
}

CellStiffness CellEnergy::semidefinite_hessian(int cell, const CellPoints& x) const {
  // Of dynamic size: as fast, and far less to compile.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(hessian(cell, x));
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
         eigen.eigenvectors().transpose();
}

}  // namespace sinew::fem
