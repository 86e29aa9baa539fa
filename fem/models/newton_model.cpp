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
        energies_(body.mesh.cells.size()) {}

  SolveReport prepare(double, Integrator) override { return {}; }

  SolveReport solve_stage(const StageProblem& problem, Points& velocity) override {
    const Balance balance = stage_balance(body_, problem);
    Points x = balance.guess;
    SolveReport report = solve(balance, options_.tolerance, x);
    if (report.ok()) refuse_below(0.0, x, report);
    if (report.ok()) velocity = (x - *problem.x_h) / (stage_of(problem.integrator).eta * problem.h);
    return report;
  }

  SolveReport equilibrate(const PoseProblem& problem, Points& x) override {
    const Balance balance = rest_balance(body_, problem, x);
    Points solution = balance.guess;
    SolveReport report = solve(balance, options_.rest_tolerance, solution);
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

  Factor::Report factorise(const Balance& balance, const Points& x);
  SolveReport solve(const Balance& balance, double tolerance, Points& x);

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

SolveReport NewtonModel::solve(const Balance& balance, double tolerance, Points& x) {
  energy_->set_damping(balance.damping, balance.past);
  SolveReport report;
  OuterForces outer = outer_forces(body_, balance, x);
  Points elastic = elastic_forces(x);
  double energy = elastic_energy(x);
  Points residual = free_.gather(outer.sum - elastic);
  const double extent = x.rowwise().norm().maxCoeff();
  double rounding = 0.0;  ///< what is left of a residual that is zero.
  for (; report.iterations < options_.max_iterations; ++report.iterations) {
    const double scale = outer.scale + elastic.norm();
    report.residual = residual.norm() / std::max(scale, std::numeric_limits<double>::min());
    if (!std::isfinite(report.residual)) break;
    if (residual.norm() <= tolerance * scale + rounding) return report;
    const Factor::Report factor = factorise(balance, x);
    if (!factor.ok) {
      report.status = SolveStatus::NotPositiveDefinite;
      report.message = name_ + ": " + factor.message;
      name_worst_cell(body_, x, free_.spread(residual), report);
      return report;
    }
    rounding = 4.0 * std::numeric_limits<double>::epsilon() * system_.diagonal().norm() * extent;
    if (residual.norm() <= rounding) return report;

    Eigen::VectorXd direction = Eigen::Map<const Eigen::VectorXd>(residual.data(), residual.size());
    factor_.solve(direction);
    const Points step = Eigen::Map<const Points>(direction.data(), residual.rows(), 3);
    const Points leaf_step = free_.spread(step);
    const double slope = -residual.cwiseProduct(step).sum();
    double length = 1.0;
    bool accepted = false;
    for (int k = 0; k < 30; ++k, length *= 0.5) {
      const Points tried = x + length * leaf_step;
      const OuterForces tried_outer = outer_forces(body_, balance, tried);
      const double tried_energy = elastic_energy(tried);
      // The outer forces are linear in x: their potential's change is exact as a mean.
      const double change =
          tried_energy - energy - 0.5 * length * (outer.sum + tried_outer.sum).cwiseProduct(leaf_step).sum();
      const double noise = 1e-13 * (std::abs(energy) + std::abs(tried_energy));
      if (!(change <= 1e-4 * length * slope + noise)) continue;
      x = tried;
      outer = tried_outer;
      energy = tried_energy;
      accepted = true;
      break;
    }
    if (!accepted) break;
    if (length * leaf_step.cwiseAbs().maxCoeff() <= 1e-15 * extent) return report;  // nothing moves any more
    elastic = elastic_forces(x);
    residual = free_.gather(outer.sum - elastic);
  }
  report.status = SolveStatus::NoConvergence;
  report.message = fmt::format("{}: no balance of forces after {} iterations, residual {:.2g} of the forces",
                               name_, report.iterations, report.residual);
  name_worst_cell(body_, x, free_.spread(residual), report);
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
