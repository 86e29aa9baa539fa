#include "fem/time/simulation.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "fem/body/placement.h"

namespace sinew::fem {

using lattice::Points;

namespace {

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
  require(settle_speed.value_or(1.0) > 0.0, "settle_speed", settle_speed.value_or(1.0), "> 0 m/s");
  require(key_interval >= 0.0 && std::isfinite(key_interval), "key_interval", key_interval, ">= 0 s");
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
      loads_(body, options.loads) {
  options_.validate();
  // Flesh without inertia stands at the end of every step; a start of BDF2 would extrapolate beyond it.
  if (!info_->dynamic) options_.integrator = Integrator::BackwardEuler;
  // Blending several regions feeds energy in at sharp bends, and these two take too little out.
  if ((options_.integrator == Integrator::TrBdf2 || options_.integrator == Integrator::ImplicitMidpoint) &&
      info_->name == "blended" && body.regions.size() > 1) {
    throw std::invalid_argument(
        "integrator: tr-bdf2 and implicit-midpoint step blended flesh of one region, got " +
        std::to_string(body.regions.size()) +
        " regions; hint: bdf2, or another `model` such as corotational");
  }
  if (model_->may_gain_energy()) energy_cap_.emplace(body, options_.gravity);
  moving_.counter.start = start_time;
  moving_.counter.step = moving_.counter.longest = options_.step;
  moving_.now = pose_at(start_time);
  moving_.past = moving_.now;
  moving_.flesh.time = start_time;
  moving_.flesh.x = skinned_positions(body_, moving_.now);
  moving_.flesh.v = Points::Zero(moving_.flesh.x.rows(), 3);
  moving_.before = moving_.flesh;
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
  report.time = moving_.flesh.time;
  report.message = solve.message + " at " + std::to_string(moving_.flesh.time) + " s";
  return report;
}

std::string Simulation::joint_of(int vertex) const {
  double largest = -1.0;
  int frame = 0;
  for (FrameWeights::InnerIterator it(body_.weights, vertex); it; ++it) {
    if (it.value() > largest) {
      largest = it.value();
      frame = static_cast<int>(it.col());
    }
  }
  return body_.tree.frames[static_cast<std::size_t>(frame)].name;
}

bool Simulation::check(SimulationReport& report) const {
  int worst = -1;
  for (Eigen::Index a = 0; a < moving_.flesh.x.rows() && worst < 0; ++a) {
    const bool finite = moving_.flesh.x.row(a).allFinite() && moving_.flesh.v.row(a).allFinite();
    if (!finite) worst = static_cast<int>(a);
  }
  // Flesh a hundred lengths from its bones has left for good; say so while the numbers still name a place.
  if (worst < 0) {
    const Points home = skinned_frames(body_, moving_.now);
    double farthest = 0.0;
    for (Eigen::Index a = 0; a < moving_.flesh.x.rows(); ++a) {
      const double distance = (moving_.flesh.x.row(a) - home.row(a)).norm();
      if (distance > farthest) {
        farthest = distance;
        if (distance > 100.0 * body_.size) worst = static_cast<int>(a);
      }
    }
  }
  if (worst < 0) return true;
  report.status = SimulationStatus::Diverged;
  report.message = "the flesh of '" + joint_of(worst) + "' diverged at " +
                   std::to_string(moving_.flesh.time) +
                   " s; a smaller `step`, more `damping` or `integrator` backward-euler helps";
  return false;
}

Points Simulation::riding_velocity(double span) const {
  const PosedFrames next = pose_at(moving_.flesh.time + span);
  Points v = (carried(body_, moving_.flesh.x, moving_.now, next) - moving_.flesh.x) / span;
  for (const BoneVertex& bone : body_.bones.vertices) {
    v.row(bone.vertex) =
        (bone_position(bone, next.joints) - bone_position(bone, moving_.now.joints)).transpose() / span;
  }
  fill_inactive_leaves(body_, v);
  return v;
}

void Simulation::set_velocity(const Points& velocity) {
  moving_.step_end.reset();
  Points v = velocity;
  for (const BoneVertex& bone : body_.bones.vertices) v.row(bone.vertex) = moving_.flesh.v.row(bone.vertex);
  fill_inactive_leaves(body_, v);
  moving_.flesh.v = moving_.before.v = v;
}

void Simulation::set_step(double step) {
  SimulationOptions changed = options_;
  changed.step = step;
  changed.validate();
  options_.step = moving_.counter.step = step;
  moving_.counter.longest = std::max(moving_.counter.longest, step);
  moving_.counter.start = moving_.flesh.time;
  moving_.counter.whole = 0;
  moving_.counter.part = 0;
}

int Simulation::halvings_for(double begin, double h) const {
  if (!info_->dynamic) return 0;
  constexpr int kSamples = 4;  // a full turn within one step must not look like standing still
  std::vector<double> angle(body_.tree.frames.size(), 0.0);
  PosedFrames previous = moving_.now;
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
    if ((next.frames[f].from_rest * origin - moving_.now.frames[f].from_rest * origin).norm() >
        kCutJump * body_.size)
      return true;
  }
  return false;
}

void Simulation::forget_history() {
  moving_.flesh.x_past.resize(0, 3);
  moving_.flesh.v_past.resize(0, 3);
  moving_.flesh.a.resize(0, 3);
  moving_.step_end.reset();
  moving_.has_before = false;
  moving_.track.clear();
  if (energy_cap_) energy_cap_->forget();
}

SimulationReport Simulation::carry_through_cut() {
  const double h = options_.step, begin = moving_.flesh.time;
  if (!moving_.relative_velocity) {
    // Before the first step nothing is known of the frames' velocity, and settled flesh has none.
    moving_.relative_velocity = moving_.flesh.v;
    if (moving_.has_before)
      *moving_.relative_velocity -=
          (moving_.flesh.x - carried(body_, moving_.flesh.x, moving_.now, moving_.past)) / moving_.last_h;
  }
  PosedFrames next = pose_at(begin + h);
  moving_.before = moving_.flesh;
  moving_.flesh.time = next.time;
  moving_.flesh.x = carried(body_, moving_.flesh.x, moving_.now, next);
  place_bones(body_, next, moving_.flesh.x);
  fill_inactive_leaves(body_, moving_.flesh.x);
  moving_.flesh.v = *moving_.relative_velocity = turned(body_, *moving_.relative_velocity, moving_.now, next);
  moving_.past = std::move(moving_.now);
  moving_.now = std::move(next);
  forget_history();
  if (!touches_cut(options_.cuts, moving_.now.time, moving_.now.time + h)) {
    const Points riding = riding_velocity(stage_of(options_.integrator).eta * h);
    moving_.flesh.v += riding;
    for (const BoneVertex& bone : body_.bones.vertices)
      moving_.flesh.v.row(bone.vertex) = riding.row(bone.vertex);
    fill_inactive_leaves(body_, moving_.flesh.v);
    moving_.relative_velocity.reset();
  }
  SimulationReport report;
  report.time = moving_.flesh.time;
  report.steps = 1;
  check(report);
  return report;
}

/// The step begins where the frames land, with flesh that stands among them as before, and they stand still.
SimulationReport Simulation::step_after_cut(double h, const PosedFrames& next) {
  const MovingState earlier = moving_;
  moving_.now = next;
  moving_.now.time = earlier.now.time;
  moving_.flesh.x = carried(body_, earlier.flesh.x, earlier.now, moving_.now);
  place_bones(body_, moving_.now, moving_.flesh.x);
  fill_inactive_leaves(body_, moving_.flesh.x);
  moving_.flesh.v = turned(body_, earlier.flesh.v, earlier.now, moving_.now);
  forget_history();
  held_ = next;
  const SimulationReport report = step_once(h);
  held_.reset();
  if (report.steps == 1) {
    moving_.track.clear();  // the clip's poses within this step are not those that the flesh saw
    return report;
  }
  moving_ = earlier;
  return report;
}

SimulationReport Simulation::step_once(double h) {
  PosedFrames next = pose_at(moving_.flesh.time + h);
  if (info_->dynamic && jumps_to(next)) return step_after_cut(h, next);
  SimulationReport report;
  SolveReport solve = model_->prepare(h, options_.integrator);
  if (!solve.ok()) return failed(solve);
  State after;
  after.time = moving_.flesh.time + h;
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
      solve = model_->solve_stage(stage(moving_.flesh, moving_.flesh.x, moving_.flesh.v,
                                        {before_pose(), &moving_.now, &next}, h, h, next.time),
                                  after.v);
      if (!solve.ok()) break;
      after.x = moving_.flesh.x + h * after.v;
      place_bones(body_, next, after.x);
      break;
  }
  if (!solve.ok()) return failed(solve);
  if (energy_cap_) {
    const bool pushed = !options_.loads.empty() || options_.force;
    energy_cap_->limit(moving_.flesh, moving_.now, next, pushed ? &force_ : nullptr, after);
  }
  if (options_.integrator == Integrator::Bdf2) moving_.track.pass(moving_.flesh, moving_.counter.longest);
  moving_.before = moving_.flesh;
  after.x_past = moving_.flesh.x;
  after.v_past = moving_.flesh.v;
  moving_.flesh = std::move(after);
  moving_.past = std::move(moving_.now);
  moving_.now = std::move(next);
  moving_.has_before = true;
  moving_.last_h = h;
  report.time = moving_.flesh.time;
  report.steps = 1;
  check(report);
  return report;
}

SimulationReport Simulation::advance_to(double time) {
  SimulationReport total;
  total.time = moving_.flesh.time;
  while (moving_.flesh.time < time) {
    if (moving_.counter.part == 0) {
      moving_.flesh.time = moving_.now.time =
          moving_.counter.start + static_cast<double>(moving_.counter.whole) * options_.step;
    }
    const bool in_cut = moving_.counter.part == 0 && info_->dynamic &&
                        touches_cut(options_.cuts, moving_.flesh.time, moving_.flesh.time + options_.step);
    if (moving_.counter.part == 0 && !in_cut) {
      const int wanted = halvings_for(moving_.flesh.time, options_.step);
      if (wanted > moving_.counter.halvings ||
          (wanted < moving_.counter.halvings && moving_.counter.since_change >= kStepsBetweenChanges)) {
        moving_.counter.halvings = wanted;
        moving_.counter.since_change = 0;
      }
    }
    const int parts = in_cut ? 1 : 1 << moving_.counter.halvings;
    const SimulationReport report = in_cut ? carry_through_cut() : step_once(options_.step / parts);
    if (report.status == SimulationStatus::NoConvergence && moving_.counter.halvings < kMostHalvings) {
      ++moving_.counter.halvings;
      moving_.counter.part *= 2;
      moving_.counter.since_change = 0;
      // A jolt: the start without history damps it more than a step that looks back across it.
      moving_.track.clear();
      continue;
    }
    ++total.steps;
    ++moving_.counter.since_change;
    total.time = report.time;
    total.status = report.status;
    total.message = report.message;
    if (report.status != SimulationStatus::Ok) return total;
    if (++moving_.counter.part == parts) {
      moving_.counter.part = 0;
      ++moving_.counter.whole;
      moving_.flesh.time = moving_.now.time =
          moving_.counter.start + static_cast<double>(moving_.counter.whole) * options_.step;
    }
    if (should_stop_ && should_stop_()) {
      total.status = SimulationStatus::Stopped;
      return total;
    }
  }
  return total;
}

Points Simulation::positions_at(double time) const {
  const double span = moving_.flesh.time - moving_.before.time;
  const double theta = span > 0.0 ? std::clamp((time - moving_.before.time) / span, 0.0, 1.0) : 1.0;
  if (theta >= 1.0) return moving_.flesh.x;
  const PosedFrames posed = pose_at(time);
  if (!info_->dynamic) return skinned_positions(body_, posed);
  Points x = Points::Zero(moving_.flesh.x.rows(), 3);
  for (Eigen::Index a = 0; a < x.rows(); ++a) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (FrameWeights::InnerIterator it(body_.weights, a); it; ++it) {
      const auto f = static_cast<std::size_t>(it.col());
      const Eigen::Vector3d in_bone =
          (1.0 - theta) * (moving_.past.frames[f].to_rest * moving_.before.x.row(a).transpose()) +
          theta * (moving_.now.frames[f].to_rest * moving_.flesh.x.row(a).transpose());
      sum += it.value() * (posed.frames[f].from_rest * in_bone);
    }
    x.row(a) = sum.transpose();
  }
  place_bones(body_, posed, x);
  return x;
}

Points Simulation::velocities_at(double time) const {
  const double span = moving_.flesh.time - moving_.before.time;
  const double theta = span > 0.0 ? std::clamp((time - moving_.before.time) / span, 0.0, 1.0) : 1.0;
  return (1.0 - theta) * moving_.before.v + theta * moving_.flesh.v;
}

Measures Simulation::measures_at(double time) const {
  const double span = moving_.flesh.time - moving_.before.time;
  const bool at_end = !(span > 0.0) || time >= moving_.flesh.time;
  const Points x = positions_at(time);
  const PosedFrames pose = at_end ? moving_.now : pose_at(time);
  Measures measures = measure(body_, x, velocities_at(time), pose, options_.gravity);
  if (!model_->linear_in_frames()) {
    measures.elastic = 0.0;
    for (double energy : model_->cell_forces(x, pose).energy) measures.elastic += energy;
  }
  return measures;
}

}  // namespace sinew::fem
