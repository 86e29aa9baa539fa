#include "fem/models/detail/rotated_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "fem/body/placement.h"
#include "fem/linear/repeated_factor.h"
#include "fem/models/balance.h"
#include "fem/models/detail/corotational_cells.h"
#include "fem/models/detail/free_system.h"
#include "fem/models/detail/newton_solver.h"
#include "fem/models/detail/turned_cells.h"
#include "fem/models/near_rest.h"

namespace sinew::fem {
namespace {

using lattice::Points;
using Rotations = std::vector<Eigen::Matrix3d>;

/// Polar rotations of the last few places: where a stage ends the next ones look back to.
class RememberedRotations {
 public:
  const Rotations& at(const Points& x, const PolarRotations& rotations) {
    for (const auto& [place, known] : last_) {
      if (place.rows() == x.rows() && place == x) return known;
    }
    if (last_.size() == kMost) last_.pop_front();
    last_.emplace_back(x, rotations(x));
    return last_.back().second;
  }

 private:
  static constexpr std::size_t kMost = 6;
  std::deque<std::pair<Points, Rotations>> last_;
};

/// A Cholesky factor of an earlier system, to precondition by.
struct EarlierFactor {
  explicit EarlierFactor(Precision precision) : factor(precision) {}
  RepeatedFactor factor;
  ModelMemory::EarlierSystem of;
};

/// When conjugate gradients have done enough.
struct Enough {
  double residual = 0.0;  ///< norm of what is left over [N].
  double move = 0.0;      ///< or the largest move that the preconditioner still asks for [m]; 0: never.
};

class RotatedModel final : public Model, public NearRest {
 public:
  RotatedModel(std::string name, const Body& body, CellRotations rotations, const RotatedOptions& options)
      : name_(std::move(name)),
        body_(body),
        rotations_(std::move(rotations)),
        options_(options),
        cells_(body),
        free_(free_vertices(body)),
        system_(body, free_),
        stage_factor_(options_.precision),
        rest_factor_(options_.precision) {}
  /// With polar rotations.
  RotatedModel(std::string name, const Body& body, const RotatedOptions& options)
      : RotatedModel(std::move(name), body, CellRotations(), options) {
    polar_.emplace(body, cells_);
    rotations_ = [this](const Points& x, const PosedFrames&) {
      return remembered_.at(x, polar_->rotations());
    };
  }

  SolveReport prepare(double, Integrator) override { return {}; }

  SolveReport solve_stage(const StageProblem& problem, Points& velocity) override {
    const Balance balance = stage_balance(body_, problem, grows());
    Points move = balance.guess;
    // The midpoint rule takes nothing out of what an unbalanced stage puts in: a stiff block that spins by 6
    // degrees a step would gain as much again within a second.
    const bool exact = polar_ && problem.integrator == Integrator::ImplicitMidpoint;
    SolveReport report =
        exact    ? solve_newton(balance, NewtonOptions().tolerance, move)
        : polar_ ? solve_polar(balance, problem.h, stage_of(problem.integrator).eta * problem.h, move)
                 : solve_linear(balance, problem.h, move);
    if (report.ok()) velocity = move / (stage_of(problem.integrator).eta * problem.h);
    return report;
  }

  SolveReport equilibrate(const PoseProblem& problem, Points& x) override;
  SolveReport approach_rest(const PoseProblem& problem, double slack, Points& x) override;

  CellForces cell_forces(const Points& x, const PosedFrames& pose) override {
    if (polar_) return (*polar_)(x);
    return cells_.forces(x, rotations_(x, pose), body_.grows ? growth(body_, pose).shape : body_.mesh.points);
  }

  ModelMemory memory() const override { return {{stage_factor_.of, rest_factor_.of}}; }
  SolveReport recall(const ModelMemory& memory) override;

  SolverCounts counts() const override {
    SolverCounts counts;
    counts.regions = 1;
    counts.functions = body_.mesh.num_functions();
    counts.unknowns = {free_.num_unknowns()};
    counts.factor_nonzeros =
        std::max(stage_factor_.factor.num_nonzeros(), rest_factor_.factor.num_nonzeros());
    return counts;
  }

 private:
  /// Polar rotations follow the places, not the joints: such flesh keeps its own size.
  Grows grows() const { return polar_ ? Grows::No : Grows::WithItsJoints; }
  /// Residual that may be left of a stage [N].
  double enough_for(double h, const Points& residual) const {
    const double angle = 2.0 * std::numbers::pi * body_.damping.frequency * h;
    const double share = std::min(options_.loosest, options_.time_share * angle * angle);
    return std::max(options_.tolerance * scale_, share * residual.norm());
  }
  SolveReport solve_linear(const Balance& balance, double h, Points& move);
  SolveReport solve_newton(const Balance& balance, double tolerance, Points& move);
  SolveReport solve_polar(const Balance& balance, double h, double eta_h, Points& move);
  std::vector<Rotations> past_rotations(const Balance& balance);
  Points residual_of(const Balance& balance, const Rotations& rotations, const std::vector<Rotations>& past,
                     const Points& move);
  Points apply(const Balance& balance, const Rotations& rotations, const Points& dx);
  SolveReport correct(const Balance& balance, const Rotations& rotations, const Points& residual,
                      const Enough& enough, Points& move);
  bool refactor(const ModelMemory::EarlierSystem& system, EarlierFactor& earlier, SolveReport& report);
  std::vector<Eigen::Matrix3d> turns_since(const EarlierFactor& earlier, const Rotations& rotations) const;

  std::string name_;
  const Body& body_;
  CellRotations rotations_;
  RotatedOptions options_;
  RotatedStiffness cells_;
  RememberedRotations remembered_;
  std::optional<PolarForces> polar_;  ///< where the rotations follow the places.
  FreeVertices free_;
  BlockSystem system_;
  std::vector<double> corner_forces_;  ///< a buffer.
  bool near_collapse_ = false;         ///< some cell, at the last residual.
  double scale_ = 0.0;                 ///< of the forces at the last residual.

  std::unique_ptr<CellEnergy> potential_;  ///< of polar rotations, made when it is first needed,
  std::optional<NewtonSolver> newton_;     ///< like its solver.

  // Apart, as whoever asks for both in turn would factor at every change.
  EarlierFactor stage_factor_, rest_factor_;
};

std::vector<Rotations> RotatedModel::past_rotations(const Balance& balance) {
  std::vector<Rotations> past;
  if (balance.damping == 0.0) return past;
  for (const PastPlace& place : balance.past) past.push_back(rotations_(*place.x, *place.pose));
  return past;
}

/// Forces left over at the unknowns.
Points RotatedModel::residual_of(const Balance& balance, const Rotations& rotations,
                                 const std::vector<Rotations>& past, const Points& move) {
  const Points x = balance.origin + move;
  std::vector<detail::TurnedPlace> places{{1.0 + balance.damping, &x, &rotations}};
  for (std::size_t k = 0; k < past.size(); ++k)
    places.push_back({-balance.damping * balance.past[k].share, balance.past[k].x, &past[k]});
  // Strain is counted from the shape of its own time.
  Points rest;
  if (balance.growth) {
    rest = (1.0 + balance.damping) * balance.growth->shape;
    for (std::size_t k = 0; k < past.size(); ++k)
      rest -= balance.damping * balance.past[k].share * growth(body_, *balance.past[k].pose).shape;
  }
  places.push_back({-1.0, balance.growth ? &rest : &body_.mesh.points});
  if (polar_) {
    near_collapse_ = (*polar_)(places, corner_forces_);
  } else {
    cells_.cells().forces(rotations, places, corner_forces_);
  }
  Points elastic(x.rows(), 3);
  for (int a = 0; a < body_.mesh.num_vertices(); ++a)
    elastic.row(a) = cells_.cells().groups().sum_at(a, corner_forces_).transpose();
  const OuterForces outer = outer_forces(body_, balance, move);
  scale_ = outer.scale + elastic.norm();
  return free_.gather(outer.sum - elastic);
}

/// A dx at the unknowns.
Points RotatedModel::apply(const Balance& balance, const Rotations& rotations, const Points& dx) {
  const Points leaves = free_.spread(dx);
  const std::array<detail::TurnedPlace, 1> place{{{1.0 + balance.damping, &leaves, &rotations}}};
  cells_.cells().forces(rotations, place, corner_forces_);
  const LeafMatrices& m = body_.matrices;
  Points forces(leaves.rows(), 3);
  tbb::parallel_for(
      tbb::blocked_range<int>(0, m.num_vertices(), 128), [&](const tbb::blocked_range<int>& range) {
        for (int a = range.begin(); a != range.end(); ++a) {
          const auto i = static_cast<std::size_t>(a);
          Eigen::Vector3d sum = cells_.cells().groups().sum_at(a, corner_forces_);
          for (auto e = static_cast<std::size_t>(m.row_start[i]);
               e < static_cast<std::size_t>(m.row_start[i + 1]); ++e)
            sum += (balance.inertia * m.mass[e] + m.tie[e] + (1.0 + balance.damping) * m.ghost[e]) *
                   leaves.row(m.column[e]).transpose();
          forces.row(a) = sum.transpose();
        }
      });
  return free_.gather(forces);
}

bool RotatedModel::refactor(const ModelMemory::EarlierSystem& system, EarlierFactor& earlier,
                            SolveReport& report) {
  std::vector<CellStiffness> matrices(system.rotations.size());
  tbb::parallel_for(std::size_t{0}, matrices.size(), [&](std::size_t c) {
    matrices[c] = (1.0 + system.damping) * cells_.rotated(static_cast<int>(c), system.rotations[c]);
  });
  system_.assemble({system.inertia, 1.0, 1.0 + system.damping}, matrices);
  const Factor::Report factor = earlier.factor.factorise(system_.lower());
  if (!factor.ok) {
    report.status = SolveStatus::NotPositiveDefinite;
    report.message = name_ + ": " + factor.message;
    return false;
  }
  earlier.of = system;
  return true;
}

SolveReport RotatedModel::recall(const ModelMemory& memory) {
  SolveReport report;
  std::array<EarlierFactor*, 2> factors{&stage_factor_, &rest_factor_};
  for (std::size_t k = 0; k < factors.size(); ++k) {
    const bool known = k < memory.systems.size() && !memory.systems[k].rotations.empty();
    if (!known) {
      factors[k]->of = {};  // no stage is like it, so that the next one factors
    } else if (!refactor(memory.systems[k], *factors[k], report)) {
      break;
    }
  }
  return report;
}

/// Mean rotation of the cells round every unknown since the factor was made.
std::vector<Eigen::Matrix3d> RotatedModel::turns_since(const EarlierFactor& earlier,
                                                       const Rotations& rotations) const {
  std::vector<Eigen::Vector4d> sums(static_cast<std::size_t>(body_.mesh.num_vertices()),
                                    Eigen::Vector4d::Zero());
  for (std::size_t c = 0; c < rotations.size(); ++c) {
    const Eigen::Quaterniond turn(rotations[c] * earlier.of.rotations[c].transpose());
    for (int a : body_.mesh.cells[c]) {
      Eigen::Vector4d& sum = sums[static_cast<std::size_t>(a)];
      sum += sum.dot(turn.coeffs()) < 0.0 ? -turn.coeffs() : turn.coeffs();
    }
  }
  std::vector<Eigen::Matrix3d> turns;
  turns.reserve(free_.vertex.size());
  for (int a : free_.vertex) {
    const Eigen::Vector4d& sum = sums[static_cast<std::size_t>(a)];
    const bool usable = sum.norm() > 0.1;
    turns.push_back(usable ? Eigen::Quaterniond(sum.normalized()).toRotationMatrix()
                           : Eigen::Matrix3d::Identity());
  }
  return turns;
}

/// The solution for `residual` by an earlier factor, turned at every unknown.
void precondition(const EarlierFactor& earlier, const std::vector<Eigen::Matrix3d>& turns,
                  const Points& residual, Points& result) {
  result.resize(residual.rows(), 3);
  for (Eigen::Index i = 0; i < residual.rows(); ++i)
    result.row(i) = residual.row(i) * turns[static_cast<std::size_t>(i)];
  earlier.factor.solve(Eigen::Map<Eigen::VectorXd>(result.data(), result.size()));
  for (Eigen::Index i = 0; i < residual.rows(); ++i)
    result.row(i) = (turns[static_cast<std::size_t>(i)] * result.row(i).transpose()).transpose();
}

/// Adds to `move` the solution of the system for `residual`, but for `enough` of it.
SolveReport RotatedModel::correct(const Balance& balance, const Rotations& rotations, const Points& residual,
                                  const Enough& enough, Points& move) {
  SolveReport report;
  EarlierFactor& earlier = balance.inertia == 0.0 ? rest_factor_ : stage_factor_;
  const bool other = earlier.of.inertia != balance.inertia || earlier.of.damping != balance.damping;
  const auto system = [&] { return ModelMemory::EarlierSystem{balance.inertia, balance.damping, rotations}; };
  if ((other || !earlier.factor.ok()) && !refactor(system(), earlier, report)) return report;

  Points r = residual, dx = Points::Zero(r.rows(), 3), z, direction, image;
  std::vector<Eigen::Matrix3d> turns = turns_since(earlier, rotations);
  double rz = 0.0;
  bool fresh = false;
  for (int since_factor = 0; r.norm() > enough.residual; ++report.iterations, ++since_factor) {
    if (since_factor == options_.stale_after) {
      // With a factor of this very matrix a step or two remain; more means that rounding rules.
      if (fresh) break;
      if (!refactor(system(), earlier, report)) return report;
      turns = turns_since(earlier, rotations);
      fresh = true;
      since_factor = 0;
    }
    precondition(earlier, turns, r, z);
    const double next = r.cwiseProduct(z).sum();
    if (!std::isfinite(next)) {
      report.status = SolveStatus::NoConvergence;
      report.message = name_ + ": forces are not finite";
      return report;
    }
    if (z.rowwise().norm().maxCoeff() <= enough.move) break;
    direction = since_factor == 0 ? z : Points(z + next / rz * direction);
    rz = next;
    image = apply(balance, rotations, direction);
    const double length = rz / direction.cwiseProduct(image).sum();
    dx += length * direction;
    r -= length * image;
  }
  report.residual = r.norm() / std::max(scale_, std::numeric_limits<double>::min());
  move += free_.spread(dx);
  return report;
}

SolveReport RotatedModel::solve_linear(const Balance& balance, double h, Points& move) {
  const Rotations rotations = rotations_(balance.origin + move, *balance.pose);
  const Points residual = residual_of(balance, rotations, past_rotations(balance), move);
  return correct(balance, rotations, residual, {enough_for(h, residual)}, move);
}

/// One linear solve as a rule. Its forces balance but for the square of what turns and stretches have changed
/// on the way; where that is not small they are looked at, and balanced by more such solves or, where these
/// do not get there soon, by Newton's method.
SolveReport RotatedModel::solve_polar(const Balance& balance, double h, double eta_h, Points& move) {
  // Change of a deformation gradient, whose square is then 4e-6 of a strain of one. At 0.005 flesh in which
  // sound crosses ten thousand cells a step gains 5e-6 of its energy.
  constexpr double kSmall = 0.002;
  // Of the first residual. At 0.01 a bar jerked by 1.14 lengths is left to Newton's method, which finds a
  // rest with cells inside out.
  constexpr double kGood = 0.1;
  // Of the forces that are to balance: where the guess was far off, a tenth of what it left may be all of
  // them. At 0.9 a bar drawn to a hundred lengths goes on inside out; at 0.1 the jerked bar is left to
  // Newton's method.
  constexpr double kBalanced = 0.5;
  constexpr int kRounds = 4;
  const std::vector<Rotations> past = past_rotations(balance);
  SolveReport total;
  double first = 0.0, last = 0.0, enough = 0.0;
  for (int round = 0;; ++round) {
    // As later stages will have it to the last digit when they look back.
    Points x = balance.origin + eta_h * (move / eta_h);
    place_bones(body_, *balance.pose, x);
    const Rotations rotations = rotations_(x, *balance.pose);
    const Points residual = residual_of(balance, rotations, past, move);
    const double left = residual.norm();
    if (round == 0) {
      first = left;
      enough = enough_for(h, residual);
    } else if (left <= std::max(enough, std::min(kGood * first, kBalanced * scale_))) {
      return total;
    } else if (round == kRounds || !(left <= (round == 1 ? 10.0 : 0.5) * last)) {
      break;
    }
    last = left;
    const Points before = move;
    const SolveReport step = correct(balance, rotations, residual, {enough}, move);
    total.iterations += step.iterations;
    total.residual = step.residual;
    if (!step.ok()) return step;
    if (!near_collapse_ && polar_->rotations().largest_change(move - before) <= kSmall) return total;
  }
  move = balance.guess;
  return solve_newton(balance, NewtonOptions().tolerance, move);
}

SolveReport RotatedModel::solve_newton(const Balance& balance, double tolerance, Points& move) {
  if (!newton_) {
    potential_ = corotational_cells(body_);
    NewtonOptions options;
    options.rest_tolerance = options_.rest_tolerance;
    options.max_rest_iterations = options_.max_rest_iterations;
    newton_.emplace(name_, body_, free_, system_, *potential_, options);
  }
  return newton_->solve(balance, tolerance, move);
}

SolveReport RotatedModel::equilibrate(const PoseProblem& problem, Points& x) {
  const Balance balance = rest_balance(body_, problem, x, grows());
  Points move = balance.guess;
  if (polar_) {
    const SolveReport report = solve_newton(balance, options_.rest_tolerance, move);
    if (report.ok()) x = balance.origin + move;
    return report;
  }
  SolveReport total;
  const Rotations rotations = rotations_(balance.origin + move, *balance.pose);
  const double extent = balance.origin.rowwise().norm().maxCoeff();
  Points residual;
  for (; total.iterations < options_.max_rest_iterations; ++total.iterations) {
    residual = residual_of(balance, rotations, {}, move);
    total.residual = residual.norm() / std::max(scale_, std::numeric_limits<double>::min());
    if (!std::isfinite(total.residual)) break;
    if (residual.norm() <= options_.rest_tolerance * scale_) {
      x = balance.origin + move;
      return total;
    }
    const Points before = move;
    const SolveReport step =
        correct(balance, rotations, residual, {0.1 * options_.rest_tolerance * scale_}, move);
    if (!step.ok()) return step;
    if ((move - before).cwiseAbs().maxCoeff() <= 1e-15 * extent) {
      x = balance.origin + move;
      total.message = kStagnated;
      return total;
    }
  }
  total.status = SolveStatus::NoConvergence;
  total.message = fmt::format(
      "{}: no balance of forces after {} iterations, residual {:.2g} of the forces; hint: neo-hookean", name_,
      total.iterations, total.residual);
  name_worst_cell(body_, balance.origin + move, free_.spread(residual), total);
  return total;
}

/// One linear solve, or a few of Newton's method, as far as it matters.
SolveReport RotatedModel::approach_rest(const PoseProblem& problem, double slack, Points& x) {
  const Balance balance = rest_balance(body_, problem, x, grows());
  Points move = balance.guess;
  SolveReport report;
  if (polar_) {
    report = solve_newton(balance, NewtonOptions().tolerance, move);
  } else {
    const Rotations rotations = rotations_(balance.origin + move, *balance.pose);
    const Points residual = residual_of(balance, rotations, {}, move);
    report = correct(balance, rotations, residual, {options_.rest_tolerance * scale_, slack}, move);
  }
  if (report.ok()) x = balance.origin + move;
  return report;
}

}  // namespace

RotatedOptions rotated_options(const SolverOptions& solver) {
  RotatedOptions options;
  if (solver.precision) options.precision = *solver.precision;
  return options;
}

std::unique_ptr<Model> make_rotated_model(std::string name, const Body& body, CellRotations rotations,
                                          const RotatedOptions& options) {
  return std::make_unique<RotatedModel>(std::move(name), body, std::move(rotations), options);
}

std::unique_ptr<Model> make_polar_model(std::string name, const Body& body, const RotatedOptions& options) {
  return std::make_unique<RotatedModel>(std::move(name), body, options);
}

}  // namespace sinew::fem
