#include "fem/models/newton_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "fem/models/balance.h"
#include "fem/models/free_system.h"
#include "fem/models/repeated_factor.h"

namespace sinew::fem {
namespace {

using lattice::Points;

class NewtonModel final : public Model {
 public:
  NewtonModel(std::string name, const Body& body, std::unique_ptr<CellEnergy> energy,
              const NewtonOptions& options)
      : name_(std::move(name)),
        body_(body),
        energy_(std::move(energy)),
        options_(options),
        free_(free_vertices(body)),
        system_(body, free_),
        cell_sum_(body),
        hessians_(body.mesh.cells.size()),
        gradients_(body.mesh.cells.size()),
        energies_(body.mesh.cells.size()) {
    system_.assemble(1.0, 0.0, std::vector<CellStiffness>(hessians_.size(), CellStiffness::Zero()));
    mass_diagonal_ = system_.diagonal();
  }

  SolveReport prepare(double, Integrator) override { return {}; }

  SolveReport solve_stage(const StageProblem& problem, Points& velocity) override {
    const Balance balance = stage_balance(body_, problem);
    Points move = balance.guess;
    SolveReport report = solve(balance, options_.tolerance, move);
    if (report.ok()) refuse_below(0.0, balance.origin + move, report);
    if (report.ok()) velocity = move / (stage_of(problem.integrator).eta * problem.h);
    return report;
  }

  SolveReport equilibrate(const PoseProblem& problem, Points& x) override {
    const Balance balance = rest_balance(body_, problem, x);
    Points move = balance.guess;
    SolveReport report = solve(balance, options_.rest_tolerance, move);
    const Points solution = balance.origin + move;
    if (report.ok()) refuse_below(energy_->least_stretch(), solution, report);
    if (report.ok()) x = solution;
    return report;
  }

  CellForces cell_forces(const Points& x, const PosedFrames&) override {
    energy_->set_damping(0.0, {});
    CellForces result;
    result.energy.resize(energies_.size());
    result.force.resize(energies_.size());
    each_cell(
        [&](int c, const CellPoints& corners) {
          result.energy[static_cast<std::size_t>(c)] = energy_->energy(c, corners);
          result.force[static_cast<std::size_t>(c)] = energy_->gradient(c, corners);
        },
        x);
    return result;
  }

  SolverCounts counts() const override {
    SolverCounts counts;
    counts.regions = 1;
    counts.functions = body_.mesh.num_functions();
    counts.unknowns = {free_.num_unknowns()};
    counts.factor_nonzeros = factor_.num_nonzeros();
    return counts;
  }

 private:
  template <class Action>
  void each_cell(const Action& action, const Points& x) const {
    tbb::parallel_for(0, static_cast<int>(body_.mesh.cells.size()), [&](int c) {
      action(c, cell_points(x, body_.mesh.cells[static_cast<std::size_t>(c)]));
    });
  }

  double elastic_energy(const Points& x) {
    each_cell(
        [&](int c, const CellPoints& p) { energies_[static_cast<std::size_t>(c)] = energy_->energy(c, p); },
        x);
    double sum = 0.0;
    for (double e : energies_) sum += e;
    return sum;
  }

  /// Elastic forces f(x) on the leaf vertices.
  Points elastic_forces(const Points& x) {
    each_cell([&](int c,
                  const CellPoints& p) { gradients_[static_cast<std::size_t>(c)] = energy_->gradient(c, p); },
              x);
    return cell_sum_(gradients_);
  }

  /// A law that stops to resist being squeezed finds its balance in flesh that is turned inside out.
  void refuse_below(double stretch, const Points& x, SolveReport& report) const {
    if (energy_->least_stretch() == 0.0) return;
    const LeastStretch least = least_stretch(body_, x);
    if (least.stretch > stretch) return;
    report.status = SolveStatus::NoConvergence;
    report.cell = least.cell;
    report.message = fmt::format(
        "{}: collapsed, {} is squeezed to {:.3g} of its length and the law resists down to {:.3g} only; "
        "hint: "
        "neo-hookean",
        name_, place_of(body_, least.cell), least.stretch, energy_->least_stretch());
  }

  /// What is known at a move.
  struct Iterate {
    Points move, elastic, residual;  ///< residual: at the unknowns.
    OuterForces outer;
    double energy = 0.0;  ///< elastic.
  };
  Iterate iterate(const Balance& balance, Points move);
  Factor::Report factorise(const Balance& balance, const Points& x);
  SolveReport solve(const Balance& balance, double tolerance, Points& move);
  bool search(const Balance& balance, const Points& step, double unresolved, Iterate& at);

  std::string name_;
  const Body& body_;
  std::unique_ptr<CellEnergy> energy_;
  NewtonOptions options_;
  FreeVertices free_;
  BlockSystem system_;
  CellSum cell_sum_;
  RepeatedFactor factor_;
  std::vector<CellStiffness> hessians_;
  std::vector<CellVector> gradients_;
  std::vector<double> energies_;
  Eigen::VectorXd mass_diagonal_;  ///< of M at the unknowns.
};

Factor::Report NewtonModel::factorise(const Balance& balance, const Points& x) {
  each_cell(
      [&](int c, const CellPoints& p) { hessians_[static_cast<std::size_t>(c)] = energy_->hessian(c, p); },
      x);
  system_.assemble(balance.inertia, 1.0, hessians_);
  Factor::Report report = factor_.factorise(system_.lower());
  if (report.ok) return report;
  each_cell(
      [&](int c, const CellPoints& p) {
        hessians_[static_cast<std::size_t>(c)] = energy_->semidefinite_hessian(c, p);
      },
      x);
  system_.assemble(balance.inertia, 1.0, hessians_);
  report = factor_.factorise(system_.lower());
  if (report.ok) return report;
  // Flesh squeezed flat may have no stiffness left in some direction.
  system_.shift_diagonal(1e-6 * system_.diagonal().maxCoeff());
  return factor_.factorise(system_.lower());
}

NewtonModel::Iterate NewtonModel::iterate(const Balance& balance, Points move) {
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
bool NewtonModel::search(const Balance& balance, const Points& step, double unresolved, Iterate& at) {
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

SolveReport NewtonModel::solve(const Balance& balance, double tolerance, Points& move) {
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  energy_->set_damping(balance.damping, balance.past);
  SolveReport report;
  Iterate at = iterate(balance, move);
  const double extent = (balance.origin + move).rowwise().norm().maxCoeff();
  double rounding = 0.0;  ///< what is left of a residual that is zero, of the elastic forces.
  const auto stagnated = [&] {
    report.message = kStagnated;
    move = at.move;
    return report;
  };
  for (; report.iterations < options_.max_iterations; ++report.iterations) {
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

}  // namespace

CellStiffness CellEnergy::semidefinite_hessian(int cell, const CellPoints& x) const {
  // Of dynamic size: as fast, and far less to compile.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(hessian(cell, x));
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
         eigen.eigenvectors().transpose();
}

std::unique_ptr<Model> make_newton_model(std::string name, const Body& body,
                                         std::unique_ptr<CellEnergy> energy, const NewtonOptions& options) {
  return std::make_unique<NewtonModel>(std::move(name), body, std::move(energy), options);
}

}  // namespace sinew::fem
