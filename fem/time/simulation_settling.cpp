#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "fem/body/placement.h"
#include "fem/models/balance.h"
#include "fem/time/simulation.h"

/// How the flesh comes to rest before the first frame, and what it starts with.
namespace sinew::fem {

using lattice::Points;

namespace {

constexpr double kLongestInterval = 0.05;  ///< between keys that show accelerations [s].

}  // namespace

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
    if (!begin.acceleration.isZero(0.0)) inertial_force_ = -apply_mass(body_.matrices, begin.acceleration);
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

}  // namespace sinew::fem
