#include "fem/models/blended.h"

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "fem/blended_solver.h"
#include "fem/models/balance.h"
#include "fem/models/rotated_stiffness.h"
#include "fem/placement.h"

namespace sinew::fem {
namespace {

class Blended final : public Model {
 public:
  Blended(const Body& body, const SolverOptions& options) : body_(body), solver_(body, options) {}

  SolveReport prepare(double h, Integrator integrator) override {
    const Factor::Report factor = solver_.prepare(h, integrator);
    SolveReport report;
    report.message = factor.message;
    if (!factor.ok) report.status = SolveStatus::NotPositiveDefinite;
    return report;
  }

  SolveReport solve_stage(const StageProblem& p, lattice::Points& velocity) override {
    // Forces enter the systems as M v_h does: theta h M^-1 f more velocity is theta h f more momentum.
    lattice::Points pushed;
    if (p.force != nullptr) pushed = *p.v_h + stage_of(p.integrator).theta * p.h * acceleration(*p.force);
    velocity = solver_.stage_velocity(*p.state, *p.x_h, p.force != nullptr ? pushed : *p.v_h, p.poses, p.h,
                                      p.integrator, p.gravity, p.use_past);
    return {};
  }

  SolveReport equilibrate(const PoseProblem& problem, lattice::Points& x) override;

  CellForces cell_forces(const lattice::Points& x, const PosedFrames& pose) override {
    return RotatedStiffness(body_).forces(x, frame_rotations(body_, pose));
  }

  bool linear_in_frames() const override { return true; }

  SolverCounts counts() const override { return solver_.counts(); }

 private:
  const lattice::Points& acceleration(const lattice::Points& force);

  const Body& body_;
  BlendedSolver solver_;
  Factor mass_;                           ///< of M over the leaf vertices; empty until a force comes.
  lattice::Points force_, acceleration_;  ///< the last one asked for.
};

/// M^-1 force over the leaf vertices.
const lattice::Points& Blended::acceleration(const lattice::Points& force) {
  if (force_.rows() == force.rows() && force_ == force) return acceleration_;
  const LeafMatrices& m = body_.matrices;
  if (mass_.size() == 0) {
    std::vector<Eigen::Triplet<double>> triplets;
    for (int a = 0; a < m.num_vertices(); ++a) {
      for (int e = m.row_start[static_cast<std::size_t>(a)]; e < m.row_start[static_cast<std::size_t>(a) + 1];
           ++e)
        triplets.emplace_back(a, m.column[static_cast<std::size_t>(e)], m.mass[static_cast<std::size_t>(e)]);
    }
    Eigen::SparseMatrix<double> mass(m.num_vertices(), m.num_vertices());
    mass.setFromTriplets(triplets.begin(), triplets.end());
    // A sum of positive definite cell masses, scaled to unit diagonal: it has a factor.
    if (const Factor::Report report = mass_.factorise(mass); !report.ok)
      throw std::logic_error("the mass matrix of the leaf vertices: " + report.message);
  }
  acceleration_.resize(force.rows(), 3);
  Eigen::VectorXd workspace;
  for (Eigen::Index c = 0; c < 3; ++c) {
    Eigen::VectorXd column = force.col(c);
    mass_.solve(column, workspace);
    acceleration_.col(c) = column;
  }
  force_ = force;
  return acceleration_;
}

/// The blend of the regions' answers is no one system's solution: it is found by letting the flesh come to
/// rest, with the drag and the default step of a run, as the pose held there depends slightly on the step.
SolveReport Blended::equilibrate(const PoseProblem& problem, lattice::Points& x) {
  constexpr double kStep = 1.0 / 120.0, kLongest = 20.0, kRest = 1e-9;  // s, s, shares of the size per second
  SolveReport report = prepare(kStep, Integrator::BackwardEuler);
  if (!report.ok()) return report;
  PosedFrames earlier = *problem.pose, now = *problem.pose, later = *problem.pose;
  earlier.time = -kStep;
  now.time = 0.0;
  later.time = kStep;
  State state;
  state.x = x;
  place_bones(body_, now, state.x);
  fill_inactive_leaves(body_, state.x);
  state.v = lattice::Points::Zero(x.rows(), 3);
  const double keep = 1.0 / (1.0 + 4.0 * std::numbers::pi * body_.damping.frequency * kStep);
  for (; report.iterations * kStep < kLongest; ++report.iterations) {
    StageProblem stage;
    stage.state = &state;
    stage.x_h = &state.x;
    stage.v_h = &state.v;
    stage.poses = {&earlier, &now, &later};
    stage.h = kStep;
    stage.integrator = Integrator::BackwardEuler;
    stage.gravity = problem.gravity;
    stage.force = problem.force;
    lattice::Points v;
    report.status = solve_stage(stage, v).status;
    state.x += kStep * v;
    state.v = keep * v;
    place_bones(body_, now, state.x);
    report.residual = v.rowwise().norm().maxCoeff() / body_.size;
    if (!std::isfinite(report.residual)) break;
    if (report.residual > kRest) continue;
    x = state.x;
    return report;
  }
  report.status = SolveStatus::NoConvergence;
  report.message = fmt::format("blended: not at rest after {} steps, moves by {:.2g} of its size per second",
                               report.iterations, report.residual);
  name_worst_cell(body_, state.x, state.v, report);
  return report;
}

}  // namespace

std::unique_ptr<Model> make_blended(const Body& body, const SolverOptions& options) {
  return std::make_unique<Blended>(body, options);
}

}  // namespace sinew::fem
