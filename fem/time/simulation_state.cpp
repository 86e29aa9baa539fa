#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "fem/time/simulation.h"

namespace sinew::fem {

using lattice::Points;

MovingState Simulation::state() const {
  MovingState state = moving_;
  if (energy_cap_) state.energy = energy_cap_->memory();
  state.model = model_->memory();
  return state;
}

void Simulation::set_state(MovingState state) {
  const auto require = [](bool holds, const std::string& part, const std::string& rule) {
    if (!holds) throw std::invalid_argument("moving state: " + part + ": expected " + rule);
  };
  const Eigen::Index n = body_.mesh.num_vertices();
  const auto require_flesh = [&](const State& flesh, const std::string& name) {
    const std::string rule = std::to_string(n) + " rows, one for every leaf vertex of the body";
    require(flesh.x.rows() == n && flesh.v.rows() == n, name, rule);
    for (const Points* p : {&flesh.x_past, &flesh.v_past, &flesh.a})
      require(p->rows() == n || p->rows() == 0, name, rule + ", or none");
  };
  const auto require_pose = [&](const PosedFrames& pose, const std::string& name) {
    require(pose.frames.size() == body_.tree.frames.size() && pose.joints.size() == moving_.now.joints.size(),
            name, "the joints and frames of the body and its motion");
  };
  require_flesh(state.flesh, "flesh");
  require_flesh(state.before, "before");
  require_pose(state.now, "now");
  require_pose(state.past, "past");
  for (const Track::Passed& passed : state.track.passed())
    require(passed.x.rows() == n && passed.v.rows() == n && (passed.a.rows() == n || passed.a.rows() == 0),
            "track", "rows for every leaf vertex of the body");
  if (state.step_end) {
    require(state.step_end->x_middle.rows() == n, "step_end", "rows for every leaf vertex of the body");
    require_pose(state.step_end->middle, "step_end");
  }
  if (state.relative_velocity)
    require(state.relative_velocity->rows() == n, "relative_velocity",
            "rows for every leaf vertex of the body");
  if (state.energy.still) require_pose(*state.energy.still, "energy.still");
  const StepCounter& counter = state.counter;
  require(counter.step > 0.0 && std::isfinite(counter.step), "counter.step", "a positive number of seconds");
  require(counter.halvings >= 0 && counter.halvings <= kMostHalvings && counter.part >= 0 &&
              counter.part < 1 << counter.halvings,
          "counter", "a sub-step of at most " + std::to_string(1 << kMostHalvings));
  for (const ModelMemory::EarlierSystem& system : state.model.systems)
    require(system.rotations.empty() || system.rotations.size() == body_.mesh.cells.size(), "model",
            "a rotation for every leaf cell of the body");

  const SolveReport recalled = model_->recall(state.model);
  require(recalled.ok(), "model", "a system that has a factor: " + recalled.message);
  if (energy_cap_) energy_cap_->recall(state.energy);
  state.model = {};
  state.energy = {};
  moving_ = std::move(state);
  options_.step = moving_.counter.step;
}

}  // namespace sinew::fem
