#include "fem/time/rest_flesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "fem/body/placement.h"
#include "fem/models/near_rest.h"

namespace sinew::fem {

using lattice::Points;

namespace {

/// How far from its rest the flesh may be left, in sizes of the body [-]: a fifth of what can be told.
constexpr double kClose = 2e-5;

}  // namespace

RestFlesh::RestFlesh(const Body& body, const SimulationOptions& options, PosedFrames pose, Points x)
    : body_(body),
      options_(options),
      info_(find_model(options.model)),
      model_(info_->make(body, options.solver)),
      loads_(body, options.loads),
      pose_(std::move(pose)),
      x_(std::move(x)),
      v_(Points::Zero(x_.rows(), 3)) {
  if (!info_->dynamic) options_.integrator = Integrator::BackwardEuler;
}

SolveReport RestFlesh::follow(const PosedFrames& pose, double elapsed) {
  x_ = carried(body_, x_, pose_, pose);
  v_ = turned(body_, v_, pose_, pose);
  pose_ = pose;
  place_bones(body_, pose_, x_);
  fill_inactive_leaves(body_, x_);
  if (info_->name != "blended") {
    const SolveReport report = find_rest();
    if (report.status != SolveStatus::NoConvergence) {
      v_.setZero();
      return report;
    }
  }
  return settle_for(std::max(1, static_cast<int>(std::lround(elapsed / options_.step))));
}

SolveReport RestFlesh::find_rest() {
  const Points force = loads_.at(x_);
  const PoseProblem problem{&pose_, options_.gravity, options_.loads.empty() ? nullptr : &force};
  if (auto* const near = dynamic_cast<NearRest*>(model_.get()))
    return near->approach_rest(problem, kClose * body_.size, x_);
  return model_->equilibrate(problem, x_);
}

/// As a run settles before its first frame (fem/time/simulation.cpp).
SolveReport RestFlesh::settle_for(int steps) {
  const double h = options_.step, eta = stage_of(options_.integrator).eta;
  const double span = std::min(1.0, 1.5 * eta);
  const double keep = 1.0 / (1.0 + 4.0 * std::numbers::pi * body_.damping.frequency * h);
  PosedFrames earlier = pose_, later = pose_;
  earlier.time = pose_.time - h;
  later.time = pose_.time + eta * h;
  for (int n = 0; n < steps; ++n) {
    SolveReport report = model_->prepare(h, options_.integrator);
    if (!report.ok()) return report;
    State state;
    state.time = pose_.time;
    state.x = x_;
    state.v = v_;
    const Points force = loads_.at(x_);
    StageProblem problem;
    problem.state = &state;
    problem.x_h = &x_;
    problem.v_h = &v_;
    problem.poses = {&earlier, &pose_, &later};
    problem.past = {{1.0, &x_, &pose_}};
    problem.elapsed = eta * h;
    problem.h = h;
    problem.integrator = options_.integrator;
    problem.gravity = options_.gravity;
    if (!options_.loads.empty()) problem.force = &force;
    Points v;
    report = model_->solve_stage(problem, v);
    if (!report.ok()) return report;
    x_ += span * h * v;
    v_ = keep * v;
    place_bones(body_, pose_, x_);
  }
  return {};
}

}  // namespace sinew::fem
