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

SimulationReport Simulation::settle() {
  SimulationReport report;
  report.time = moving_.flesh.time;
  // At most one and a half stages at once: a stiff mode that is carried twice as far never comes to rest.
  const double span = std::min(1.0, 1.5 * stage_of(options_.integrator).eta);
  const long limit =
      info_->dynamic ? std::lround(std::ceil(options_.settle_limit / options_.step)) : 0;  // steps
  const double slow = options_.settle_speed.value_or(kSettledRate * body_.size);
  const Beginning begin = beginning();
  if (limit > 0) {
    if (!begin.acceleration.isZero(0.0)) inertial_force_ = -mass_times(body_, begin.acceleration);
    moving_.flesh.x = guessed_rest();
  }
  PosedFrames earlier = moving_.now, later = moving_.now;
  Points v;
  int halvings = 0, good_steps = 0;
  report.settled = limit == 0;
  for (long n = 0; n < limit; ++n) {
    const double h = options_.step * std::exp2(-halvings);
    earlier.time = moving_.now.time - h;
    later.time = moving_.now.time + h;
    SolveReport solve = model_->prepare(h, options_.integrator);
    if (solve.ok())
      solve = model_->solve_stage(
          stage(moving_.flesh, moving_.flesh.x, moving_.flesh.v, {&earlier, &moving_.now, &later},
                stage_of(options_.integrator).eta * h, h, moving_.counter.start),
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
    moving_.flesh.x += span * h * v;
    moving_.flesh.v = keep * v;
    place_bones(body_, moving_.now, moving_.flesh.x);
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
  moving_.flesh.v = begin.velocity;
  moving_.before = moving_.flesh;
  return report;
}

/// Where a motion goes on evenly from key to key, its accelerations are differences over keys. One that
/// begins within a key or two, as a start from rest does, is none that the flesh could have settled under: as
/// far as the second such difference is another one than the first, it does not count.
Simulation::Beginning Simulation::beginning() const {
  constexpr double kRounding = 1e-12;  // of places
  const double eta_h = stage_of(options_.integrator).eta * options_.step;
  const double interval = std::max(options_.step, options_.key_interval);
  Beginning begin{Points::Zero(moving_.flesh.x.rows(), 3), Points::Zero(moving_.flesh.x.rows(), 3)};
  if (touches_cut(options_.cuts, moving_.counter.start, moving_.counter.start + eta_h)) return begin;
  // The motion may start at full speed: flesh that moves with its bones feels no jolt.
  begin.velocity = riding_velocity(eta_h);
  if (!info_->dynamic || interval > kLongestInterval ||
      touches_cut(options_.cuts, moving_.counter.start, moving_.counter.start + 3.0 * interval))
    return begin;
  const auto at = [&](int keys) {
    const PosedFrames posed = pose_at(moving_.counter.start + keys * interval);
    Points x = carried(body_, moving_.flesh.x, moving_.now, posed);
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
  const double rounding = kRounding * (body_.size + moving_.flesh.x.cwiseAbs().maxCoeff());
  for (Eigen::Index a = 0; a < x1.rows(); ++a) {
    const Eigen::RowVector3d first = moving_.flesh.x.row(a) - 2.0 * x1.row(a) + x2.row(a);
    const Eigen::RowVector3d second = x1.row(a) - 2.0 * x2.row(a) + x3.row(a);
    if (!(first.dot(second) > rounding * std::max(first.norm(), second.norm()))) continue;
    const double lasts = first.dot(second) / std::max(first.squaredNorm(), second.squaredNorm());
    // Of the cubic through the four places, but for what the first stage, whose bones go the mean of its
    // velocities, would else take for a jolt.
    const Eigen::RowVector3d change = lasts * (second - first);
    const Eigen::RowVector3d acceleration = (first - change) / (interval * interval);
    const Eigen::RowVector3d tangent =
        (x1.row(a) - moving_.flesh.x.row(a) - first / 2.0 + change / 3.0) / interval -
        0.5 * eta_h * acceleration;
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
  Points sum = inertial_force_.rows() > 0 ? inertial_force_ : Points::Zero(moving_.flesh.x.rows(), 3);
  if (!options_.loads.empty()) sum += loads_.at(moving_.flesh.x);
  if (options_.force) sum += options_.force(moving_.counter.start);
  Points x = moving_.flesh.x;
  const bool found = linear->equilibrate({&moving_.now, options_.gravity, &sum}, x).ok() && x.allFinite();
  const bool same_law = info_->name == kLinear || model_->linear_in_frames();
  if (!found || (x - moving_.flesh.x).cwiseAbs().maxCoeff() > body_.size) return moving_.flesh.x;
  if (!same_law && least_stretch(body_, x).stretch < kLeastStretch) return moving_.flesh.x;
  return x;
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
