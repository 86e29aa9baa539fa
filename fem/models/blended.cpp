#include "fem/models/blended.h"

#include <cmath>
#include <numbers>

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
    velocity =
        solver_.stage_velocity(*p.state, *p.x_h, *p.v_h, p.poses, p.h, p.integrator, p.gravity, p.use_past);
    return {};
  }

  SolveReport equilibrate(const PoseProblem& problem, lattice::Points& x) override;

  CellForces cell_forces(const lattice::Points& x, const PosedFrames& pose) override {
    return RotatedStiffness(body_).forces(x, frame_rotations(body_, pose));
  }

  SolverCounts counts() const override { return solver_.counts(); }

 private:
  const Body& body_;
  BlendedSolver solver_;
};

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
    const lattice::Points v = solver_.stage_velocity(state, state.x, state.v, {&earlier, &now, &later}, kStep,
                                                     Integrator::BackwardEuler, problem.gravity, false);
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
