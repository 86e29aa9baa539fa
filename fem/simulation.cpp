#include "fem/simulation.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "fem/placement.h"

namespace sinew::fem {

using lattice::Points;

namespace {

constexpr int kMostHalvings = 8;          ///< of a step: for fast frames and for solves that fail.
constexpr int kStepsBetweenChanges = 10;  ///< before a longer step: what turned fast may go on to.

/// A model by its name, for members that need one at once.
const ModelInfo* model_named(const std::string& name) {
  const ModelInfo* info = find_model(name);
  if (info != nullptr) return info;
  std::string known;
  for (const ModelInfo& model : models()) known.append(known.empty() ? "" : ", ").append(model.name);
  throw std::invalid_argument("model: got " + name + ", expected one of " + known);
}

}  // namespace

void SimulationOptions::validate() const {
  const auto require = [](bool holds, const char* field, double value, const char* rule) {
    if (!holds)
      throw std::invalid_argument(std::string(field) + ": got " + std::to_string(value) + ", expected " +
                                  rule);
  };
  require(step > 0.0 && std::isfinite(step), "step", step, "a positive number of seconds");
  require(settle_limit >= 0.0, "settle", settle_limit, ">= 0 s");
  require(gravity.allFinite(), "gravity", gravity.norm(), "finite numbers");
  require(solver.rings >= 0, "rings", solver.rings, ">= 0");
  model_named(model);
}

Simulation::Simulation(const Body& body, Motion motion, double start_time, const SimulationOptions& options,
                       std::function<bool()> should_stop)
    : body_(body),
      motion_(std::move(motion)),
      options_(options),
      should_stop_(std::move(should_stop)),
      info_(model_named(options.model)),
      model_(info_->make(body, options.solver)),
      loads_(body, options.loads),
      start_(start_time) {
  options_.validate();
  // Flesh without inertia stands at the end of every step; a start of BDF2 would extrapolate beyond it.
  if (!info_->dynamic) options_.integrator = Integrator::BackwardEuler;
  // Blending several regions feeds energy in at sharp bends, and these two take too little out.
  if ((options_.integrator == Integrator::TrBdf2 || options_.integrator == Integrator::ImplicitMidpoint) &&
      info_->name == "blended" && body.regions.size() > 1) {
    throw std::invalid_argument(
        "integrator: tr-bdf2 and implicit-midpoint step blended flesh of one region, got " +
        std::to_string(body.regions.size()) +
        " regions; hint: bdf2, or another --model such as corotational");
  }
  if (model_->may_gain_energy()) energy_cap_.emplace(body, options_.gravity);
  longest_ = options_.step;
  now_ = pose_at(start_time);
  past_ = now_;
  state_.time = start_time;
  state_.x = skinned_positions(body_, now_);
  state_.v = Points::Zero(state_.x.rows(), 3);
  before_ = state_;
}

PosedFrames Simulation::pose_at(double time) const {
  if (!held_) return pose_frames(body_.tree, motion_(time), time);
  PosedFrames held = *held_;
  held.time = time;
  return held;
}

/// The status of a solve that failed, with the time of the state it started from.
SimulationReport Simulation::failed(const SolveReport& solve) const {
  SimulationReport report;
  report.status = solve.status == SolveStatus::NotPositiveDefinite ? SimulationStatus::NotPositiveDefinite
                                                                   : SimulationStatus::NoConvergence;
  report.time = state_.time;
  report.message = solve.message + " at " + std::to_string(state_.time) + " s";
  return report;
}

bool Simulation::check(SimulationReport& report) const {
  int worst = -1;
  for (Eigen::Index a = 0; a < state_.x.rows() && worst < 0; ++a) {
    const bool finite = state_.x.row(a).allFinite() && state_.v.row(a).allFinite();
    if (!finite) worst = static_cast<int>(a);
  }
  // Flesh a hundred lengths from its bones has left for good; say so while the numbers still name a place.
  if (worst < 0) {
    const Points home = skinned_frames(body_, now_);
    double farthest = 0.0;
    for (Eigen::Index a = 0; a < state_.x.rows(); ++a) {
      const double distance = (state_.x.row(a) - home.row(a)).norm();
      if (distance > farthest) {
        farthest = distance;
        if (distance > 100.0 * body_.size) worst = static_cast<int>(a);
      }
    }
  }
  if (worst < 0) return true;
  double largest = -1.0;
  int frame = 0;
  for (FrameWeights::InnerIterator it(body_.weights, worst); it; ++it) {
    if (it.value() > largest) {
      largest = it.value();
      frame = static_cast<int>(it.col());
    }
  }
  report.status = SimulationStatus::Diverged;
  report.message = "the flesh of '" + body_.tree.frames[static_cast<std::size_t>(frame)].name +
                   "' diverged at " + std::to_string(state_.time) + " s (lattice vertex " +
                   std::to_string(worst) +
                   "); a smaller --step, more --damping or --integrator backward-euler helps";
  return false;
}

SimulationReport Simulation::settle() {
  SimulationReport report;
  report.time = state_.time;
  const double eta_h = stage_of(options_.integrator).eta * options_.step;
  // At most one and a half stages at once: a stiff mode that is carried twice as far never comes to rest.
  const double span = std::min(1.0, 1.5 * stage_of(options_.integrator).eta);
  const long limit =
      info_->dynamic ? std::lround(std::ceil(options_.settle_limit / options_.step)) : 0;  // steps
  PosedFrames earlier = now_, later = now_;
  Points v;
  int halvings = 0, good_steps = 0;
  for (long n = 0; n < limit; ++n) {
    const double h = options_.step * std::exp2(-halvings);
    earlier.time = now_.time - h;
    later.time = now_.time + h;
    SolveReport solve = model_->prepare(h, options_.integrator);
    if (solve.ok())
      solve = model_->solve_stage(stage(state_, state_.x, state_.v, {&earlier, &now_, &later},
                                        stage_of(options_.integrator).eta * h, h, start_),
                                  v);
    if (solve.status == SolveStatus::NoConvergence && halvings < kMostHalvings) {
      ++halvings;
      good_steps = 0;
      continue;
    }
    if (!solve.ok()) return failed(solve);
    // Implicit drag at the critical rate 2 w0: the equilibrium is that of the run's own matrices.
    const double keep = 1.0 / (1.0 + 4.0 * std::numbers::pi * body_.damping.frequency * h);
    state_.x += span * h * v;
    state_.v = keep * v;
    place_bones(body_, now_, state_.x);
    ++report.steps;
    report.speed = v.rowwise().norm().maxCoeff();
    if (!check(report)) return report;
    if (should_stop_ && should_stop_()) {
      report.status = SimulationStatus::Stopped;
      return report;
    }
    if (halvings > 0 && ++good_steps == kStepsBetweenChanges) {
      --halvings;
      good_steps = 0;
    }
    if (halvings == 0 && report.speed < options_.settle_speed) break;
  }
  // The motion may start at full speed: flesh that moves with its bones feels no jolt.
  if (touches_cut(options_.cuts, start_, start_ + eta_h))
    state_.v.setZero();
  else
    state_.v = riding_velocity(eta_h);
  before_ = state_;
  return report;
}

Points Simulation::riding_velocity(double span) const {
  const PosedFrames next = pose_at(state_.time + span);
  Points v = (carried(body_, state_.x, now_, next) - state_.x) / span;
  for (const BoneVertex& bone : body_.bones.vertices) {
    v.row(bone.vertex) =
        (bone_position(bone, next.joints) - bone_position(bone, now_.joints)).transpose() / span;
  }
  fill_inactive_leaves(body_, v);
  return v;
}

void Simulation::set_velocity(const Points& velocity) {
  step_end_.reset();
  Points v = velocity;
  for (const BoneVertex& bone : body_.bones.vertices) v.row(bone.vertex) = state_.v.row(bone.vertex);
  fill_inactive_leaves(body_, v);
  state_.v = before_.v = v;
}

void Simulation::set_step(double step) {
  SimulationOptions changed = options_;
  changed.step = step;
  changed.validate();
  options_.step = step;
  longest_ = std::max(longest_, step);
  start_ = state_.time;
  base_step_ = 0;
  part_ = 0;
}

int Simulation::halvings_for(double begin, double h) const {
  if (!info_->dynamic) return 0;
  constexpr int kSamples = 4;  // a full turn within one step must not look like standing still
  std::vector<double> angle(body_.tree.frames.size(), 0.0);
  PosedFrames previous = now_;
  for (int k = 1; k <= kSamples; ++k) {
    const PosedFrames next = pose_at(begin + h * k / kSamples);
    for (std::size_t f = 0; f < angle.size(); ++f) {
      // |A - B|_F = 2 sqrt(2) sin(angle / 2) for rotations.
      const double chord = (previous.frames[f].rotation - next.frames[f].rotation).norm();
      angle[f] += 2.0 * std::asin(std::min(1.0, chord / std::sqrt(8.0)));
    }
    previous = next;
  }
  const double largest = angle.empty() ? 0.0 : *std::max_element(angle.begin(), angle.end());
  int halvings = 0;
  while (halvings < kMostHalvings && largest > options_.largest_turn * std::exp2(halvings)) ++halvings;
  return halvings;
}

bool Simulation::jumps_to(const PosedFrames& next) const {
  for (std::size_t f = 0; f < next.frames.size(); ++f) {
    const Eigen::Vector3d& origin = body_.tree.frames[f].origin_rest;
    if ((next.frames[f].from_rest * origin - now_.frames[f].from_rest * origin).norm() >
        kCutJump * body_.size)
      return true;
  }
  return false;
}

void Simulation::forget_history() {
  state_.x_past.resize(0, 3);
  state_.v_past.resize(0, 3);
  state_.a.resize(0, 3);
  step_end_.reset();
  has_before_ = false;
  track_.clear();
  if (energy_cap_) energy_cap_->forget();
}

SimulationReport Simulation::carry_through_cut() {
  const double h = options_.step, begin = state_.time;
  if (!relative_velocity_) {
    // Before the first step nothing is known of the frames' velocity, and settled flesh has none.
    relative_velocity_ = state_.v;
    if (has_before_) *relative_velocity_ -= (state_.x - carried(body_, state_.x, now_, past_)) / last_h_;
  }
  PosedFrames next = pose_at(begin + h);
  before_ = state_;
  state_.time = next.time;
  state_.x = carried(body_, state_.x, now_, next);
  place_bones(body_, next, state_.x);
  fill_inactive_leaves(body_, state_.x);
  state_.v = *relative_velocity_ = turned(body_, *relative_velocity_, now_, next);
  past_ = std::move(now_);
  now_ = std::move(next);
  forget_history();
  if (!touches_cut(options_.cuts, now_.time, now_.time + h)) {
    const Points riding = riding_velocity(stage_of(options_.integrator).eta * h);
    state_.v += riding;
    for (const BoneVertex& bone : body_.bones.vertices) state_.v.row(bone.vertex) = riding.row(bone.vertex);
    fill_inactive_leaves(body_, state_.v);
    relative_velocity_.reset();
  }
  SimulationReport report;
  report.time = state_.time;
  report.steps = 1;
  check(report);
  return report;
}

/// The step begins where the frames land, with flesh that stands among them as before, and they stand still.
SimulationReport Simulation::step_after_cut(double h, const PosedFrames& next) {
  const State state = state_;
  const PosedFrames now = now_, past = past_;
  const std::optional<StepEnd> step_end = step_end_;
  const bool has_before = has_before_;
  const Track track = track_;

  now_ = next;
  now_.time = now.time;
  state_.x = carried(body_, state.x, now, now_);
  place_bones(body_, now_, state_.x);
  fill_inactive_leaves(body_, state_.x);
  state_.v = turned(body_, state.v, now, now_);
  forget_history();
  held_ = next;
  const SimulationReport report = step_once(h);
  held_.reset();
  if (report.steps == 1) {
    track_.clear();  // the clip's poses within this step are not those that the flesh saw
    return report;
  }
  state_ = state;
  now_ = now;
  past_ = past;
  step_end_ = step_end;
  has_before_ = has_before;
  track_ = track;
  return report;
}

SimulationReport Simulation::step_once(double h) {
  PosedFrames next = pose_at(state_.time + h);
  if (info_->dynamic && jumps_to(next)) return step_after_cut(h, next);
  SimulationReport report;
  SolveReport solve = model_->prepare(h, options_.integrator);
  if (!solve.ok()) return failed(solve);
  State after;
  after.time = state_.time + h;
  switch (options_.integrator) {
    case Integrator::Bdf2:
      solve = bdf2_step(h, next, after);
      break;
    case Integrator::ImplicitMidpoint:
      solve = midpoint_step(h, next, after);
      break;
    case Integrator::TrBdf2:
      solve = tr_bdf2_step(h, next, after);
      break;
    case Integrator::BackwardEuler:
      solve = model_->solve_stage(
          stage(state_, state_.x, state_.v, {before_pose(), &now_, &next}, h, h, next.time), after.v);
      if (!solve.ok()) break;
      after.x = state_.x + h * after.v;
      place_bones(body_, next, after.x);
      break;
  }
  if (!solve.ok()) return failed(solve);
  if (energy_cap_) {
    const bool pushed = !options_.loads.empty() || options_.force;
    energy_cap_->limit(state_, now_, next, pushed ? &force_ : nullptr, after);
  }
  if (options_.integrator == Integrator::Bdf2) track_.pass(state_, longest_);
  before_ = state_;
  after.x_past = state_.x;
  after.v_past = state_.v;
  state_ = std::move(after);
  past_ = std::move(now_);
  now_ = std::move(next);
  has_before_ = true;
  last_h_ = h;
  report.time = state_.time;
  report.steps = 1;
  check(report);
  return report;
}

SimulationReport Simulation::advance_to(double time) {
  SimulationReport total;
  total.time = state_.time;
  while (state_.time < time) {
    if (part_ == 0) {
      state_.time = now_.time = start_ + static_cast<double>(base_step_) * options_.step;
    }
    const bool in_cut =
        part_ == 0 && info_->dynamic && touches_cut(options_.cuts, state_.time, state_.time + options_.step);
    if (part_ == 0 && !in_cut) {
      const int wanted = halvings_for(state_.time, options_.step);
      if (wanted > halvings_ || (wanted < halvings_ && steps_since_change_ >= kStepsBetweenChanges)) {
        halvings_ = wanted;
        steps_since_change_ = 0;
      }
    }
    const int parts = in_cut ? 1 : 1 << halvings_;
    const SimulationReport report = in_cut ? carry_through_cut() : step_once(options_.step / parts);
    if (report.status == SimulationStatus::NoConvergence && halvings_ < kMostHalvings) {
      ++halvings_;
      part_ *= 2;
      steps_since_change_ = 0;
      // A jolt: the start without history damps it more than a step that looks back across it.
      track_.clear();
      continue;
    }
    ++total.steps;
    ++steps_since_change_;
    total.time = report.time;
    total.status = report.status;
    total.message = report.message;
    if (report.status != SimulationStatus::Ok) return total;
    if (++part_ == parts) {
      part_ = 0;
      ++base_step_;
      state_.time = now_.time = start_ + static_cast<double>(base_step_) * options_.step;
    }
    if (should_stop_ && should_stop_()) {
      total.status = SimulationStatus::Stopped;
      return total;
    }
  }
  return total;
}

Points Simulation::positions_at(double time) const {
  const double span = state_.time - before_.time;
  const double theta = span > 0.0 ? std::clamp((time - before_.time) / span, 0.0, 1.0) : 1.0;
  if (theta >= 1.0) return state_.x;
  const PosedFrames posed = pose_at(time);
  if (!info_->dynamic) return skinned_positions(body_, posed);
  Points x = Points::Zero(state_.x.rows(), 3);
  for (Eigen::Index a = 0; a < x.rows(); ++a) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (FrameWeights::InnerIterator it(body_.weights, a); it; ++it) {
      const auto f = static_cast<std::size_t>(it.col());
      const Eigen::Vector3d in_bone =
          (1.0 - theta) * (past_.frames[f].to_rest * before_.x.row(a).transpose()) +
          theta * (now_.frames[f].to_rest * state_.x.row(a).transpose());
      sum += it.value() * (posed.frames[f].from_rest * in_bone);
    }
    x.row(a) = sum.transpose();
  }
  place_bones(body_, posed, x);
  return x;
}

Points Simulation::velocities_at(double time) const {
  const double span = state_.time - before_.time;
  const double theta = span > 0.0 ? std::clamp((time - before_.time) / span, 0.0, 1.0) : 1.0;
  return (1.0 - theta) * before_.v + theta * state_.v;
}

Measures Simulation::measures_at(double time) const {
  const double span = state_.time - before_.time;
  const bool at_end = !(span > 0.0) || time >= state_.time;
  const Points x = positions_at(time);
  const PosedFrames pose = at_end ? now_ : pose_at(time);
  Measures measures = measure(body_, x, velocities_at(time), pose, options_.gravity);
  if (!model_->linear_in_frames()) {
    measures.elastic = 0.0;
    for (double energy : model_->cell_forces(x, pose).energy) measures.elastic += energy;
  }
  return measures;
}

}  // namespace sinew::fem
