#include "fem/time/simulation.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "fem/body/placement.h"
#include "fem/models/balance.h"

namespace sinew::fem {

using lattice::Points;

namespace {

constexpr int kMostHalvings = 8;           ///< of a step: for fast frames and for solves that fail.
constexpr double kLongestInterval = 0.05;  ///< between keys that show accelerations [s].
constexpr int kStepsBetweenChanges = 10;   ///< before a longer step: what turned fast may go on to.

/// M a over the leaf vertices [N].
Points mass_times(const Body& body, const Points& a) {
  const LeafMatrices& m = body.matrices;
  Points result = Points::Zero(a.rows(), 3);
  for (int row = 0; row < m.num_vertices(); ++row) {
    for (int e = m.row_start[static_cast<std::size_t>(row)];
         e < m.row_start[static_cast<std::size_t>(row) + 1]; ++e)
      result.row(row) += m.mass[static_cast<std::size_t>(e)] * a.row(m.column[static_cast<std::size_t>(e)]);
  }
  return result;
}

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
  report.status = SimulationStatus::Diverged;
  report.message = "the flesh of '" + joint_of(worst) + "' diverged at " + std::to_string(state_.time) +
                   " s; a smaller --step, more --damping or --integrator backward-euler helps";
  return false;
}

SimulationReport Simulation::settle() {
  SimulationReport report;
  report.time = state_.time;
  // At most one and a half stages at once: a stiff mode that is carried twice as far never comes to rest.
  const double span = std::min(1.0, 1.5 * stage_of(options_.integrator).eta);
  const long limit =
      info_->dynamic ? std::lround(std::ceil(options_.settle_limit / options_.step)) : 0;  // steps
  const double slow = options_.settle_speed.value_or(kSettledRate * body_.size);
  const Beginning begin = beginning();
  if (limit > 0) {
    if (!begin.acceleration.isZero(0.0)) inertial_force_ = -mass_times(body_, begin.acceleration);
    state_.x = guessed_rest();
  }
  PosedFrames earlier = now_, later = now_;
  Points v;
  int halvings = 0, good_steps = 0;
  report.settled = limit == 0;
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
    if (!solve.ok()) {
      inertial_force_.resize(0, 3);
      return failed(solve);
    }
    // Implicit drag at the critical rate 2 w0: the equilibrium is that of the run's own matrices.
    const double keep = 1.0 / (1.0 + 4.0 * std::numbers::pi * body_.damping.frequency * h);
    state_.x += span * h * v;
    state_.v = keep * v;
    place_bones(body_, now_, state_.x);
    ++report.steps;
    Eigen::Index fastest = 0;
    report.speed = v.rowwise().norm().maxCoeff(&fastest);
    report.fastest = joint_of(static_cast<int>(fastest));
    const bool good = check(report);
    if (good && should_stop_ && should_stop_()) report.status = SimulationStatus::Stopped;
    if (report.status != SimulationStatus::Ok) {
      inertial_force_.resize(0, 3);
      return report;
    }
    if (halvings > 0 && ++good_steps == kStepsBetweenChanges) {
      --halvings;
      good_steps = 0;
    }
    report.settled = halvings == 0 && report.speed < slow;
    if (report.settled) break;
  }
  inertial_force_.resize(0, 3);
  state_.v = begin.velocity;
  before_ = state_;
  return report;
}

/// Where a motion goes on evenly from key to key, its accelerations are differences over keys. One that
/// begins within a key or two, as a start from rest does, is none that the flesh could have settled under: as
/// far as the second such difference is another one than the first, it does not count.
Simulation::Beginning Simulation::beginning() const {
  constexpr double kRounding = 1e-12;  // of places
  const double eta_h = stage_of(options_.integrator).eta * options_.step;
  const double interval = std::max(options_.step, options_.key_interval);
  Beginning begin{Points::Zero(state_.x.rows(), 3), Points::Zero(state_.x.rows(), 3)};
  if (touches_cut(options_.cuts, start_, start_ + eta_h)) return begin;
  // The motion may start at full speed: flesh that moves with its bones feels no jolt.
  begin.velocity = riding_velocity(eta_h);
  if (!info_->dynamic || interval > kLongestInterval ||
      touches_cut(options_.cuts, start_, start_ + 3.0 * interval))
    return begin;
  const auto at = [&](int keys) {
    const PosedFrames posed = pose_at(start_ + keys * interval);
    Points x = carried(body_, state_.x, now_, posed);
    place_bones(body_, posed, x);
    return x;
  };
  Points x1, x2, x3;
  try {
    x1 = at(1);
    x2 = at(2);
    x3 = at(3);
  } catch (const std::invalid_argument&) {
    return begin;  // a clip that soon hides the body ends before that, and has no time to show accelerations
  }
  const double rounding = kRounding * (body_.size + state_.x.cwiseAbs().maxCoeff());
  for (Eigen::Index a = 0; a < x1.rows(); ++a) {
    const Eigen::RowVector3d first = state_.x.row(a) - 2.0 * x1.row(a) + x2.row(a);
    const Eigen::RowVector3d second = x1.row(a) - 2.0 * x2.row(a) + x3.row(a);
    if (!(first.dot(second) > rounding * std::max(first.norm(), second.norm()))) continue;
    const double lasts = first.dot(second) / std::max(first.squaredNorm(), second.squaredNorm());
    // Of the cubic through the four places, but for what the first stage, whose bones go the mean of its
    // velocities, would else take for a jolt.
    const Eigen::RowVector3d change = lasts * (second - first);
    const Eigen::RowVector3d acceleration = (first - change) / (interval * interval);
    const Eigen::RowVector3d tangent =
        (x1.row(a) - state_.x.row(a) - first / 2.0 + change / 3.0) / interval - 0.5 * eta_h * acceleration;
    begin.acceleration.row(a) = lasts * acceleration;
    begin.velocity.row(a) += lasts * (tangent - begin.velocity.row(a));
  }
  fill_inactive_leaves(body_, begin.acceleration);
  fill_inactive_leaves(body_, begin.velocity);
  return begin;
}

/// Of a law that is linear in the rotations of the frames: one solve finds the rest. For flesh of other laws
/// that is a good place to start from as long as it is far from where such laws fail.
Points Simulation::guessed_rest() const {
  constexpr std::string_view kLinear = "blended-stiffness";
  constexpr double kLeastStretch = 0.5;
  SolverOptions exact = options_.solver;
  exact.precision = Precision::Double;
  const std::unique_ptr<Model> linear = find_model(kLinear)->make(body_, exact);
  Points sum = inertial_force_.rows() > 0 ? inertial_force_ : Points::Zero(state_.x.rows(), 3);
  if (!options_.loads.empty()) sum += loads_.at(state_.x);
  if (options_.force) sum += options_.force(start_);
  Points x = state_.x;
  const bool found = linear->equilibrate({&now_, options_.gravity, &sum}, x).ok() && x.allFinite();
  const bool same_law = info_->name == kLinear || model_->linear_in_frames();
  if (!found || (x - state_.x).cwiseAbs().maxCoeff() > body_.size) return state_.x;
  if (!same_law && least_stretch(body_, x).stretch < kLeastStretch) return state_.x;
  return x;
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
