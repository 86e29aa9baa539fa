#include "fem/simulation.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace sinew::fem {

using lattice::Points;

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
}

namespace {

/// x = sum_f s_f T_f X: the skinned lattice.
Points skinned(const Body& body, const PosedFrames& posed) {
  Points x = Points::Zero(body.mesh.num_vertices(), 3);
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (FrameWeights::InnerIterator it(body.weights, a); it; ++it) {
      sum += it.value() * (posed.frames[static_cast<std::size_t>(it.col())].from_rest *
                           body.mesh.points.row(a).transpose());
    }
    x.row(a) = sum.transpose();
  }
  return x;
}

/// Inactive vertices at the mean of their parents, so that the state lies in the space of the active
/// functions.
void fill_inactive_leaves(const Body& body, Points& x) {
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    const int vertex = body.mesh.vertices[static_cast<std::size_t>(a)];
    if (body.hierarchy.level(vertex) == 0) continue;
    if (std::binary_search(body.mesh.functions.begin(), body.mesh.functions.end(), vertex)) continue;
    Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
    const auto parents = body.hierarchy.parents(vertex);
    for (int p : parents) mean += x.row(body.mesh.leaf_of_vertex[static_cast<std::size_t>(p)]);
    x.row(a) = mean / static_cast<double>(parents.size());
  }
}

}  // namespace

Simulation::Simulation(const Body& body, Motion motion, double start_time, const SimulationOptions& options,
                       std::function<bool()> should_stop)
    : body_(body),
      motion_(std::move(motion)),
      options_(options),
      should_stop_(std::move(should_stop)),
      solver_(body, options.solver),
      start_(start_time) {
  options_.validate();
  now_ = pose_at(start_time);
  past_ = now_;
  state_.time = start_time;
  state_.x = skinned(body_, now_);
  set_bones(now_, state_.x);
  fill_inactive_leaves(body_, state_.x);
  state_.v = Points::Zero(state_.x.rows(), 3);
  before_ = state_;
}

void Simulation::set_bones(const PosedFrames& posed, Points& x) const {
  for (const BoneVertex& bone : body_.bones.vertices)
    x.row(bone.vertex) = bone_position(bone, posed.joints).transpose();
}

bool Simulation::check(SimulationReport& report) const {
  int worst = -1;
  for (Eigen::Index a = 0; a < state_.x.rows() && worst < 0; ++a) {
    const bool finite = state_.x.row(a).allFinite() && state_.v.row(a).allFinite();
    // Flesh a hundred lengths from its bones has left for good; say so while the numbers still name a place.
    if (!finite) worst = static_cast<int>(a);
  }
  if (worst < 0) {
    const Points home = skinned(body_, now_);
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
  const double h = options_.step;
  const Factor::Report factor = solver_.prepare(h, options_.integrator);
  if (!factor.ok) {
    report.status = SimulationStatus::NotPositiveDefinite;
    report.message = factor.message;
    return report;
  }
  const double eta_h = stage_of(options_.integrator).eta * h;
  // Implicit drag at the critical rate 2 w0: the equilibrium is that of the run's own matrices.
  const double keep = 1.0 / (1.0 + 4.0 * std::numbers::pi * body_.damping.frequency * h);
  const long limit = std::lround(std::ceil(options_.settle_limit / h));
  PosedFrames earlier = now_, later = now_;
  earlier.time -= h;
  later.time += h;
  for (long n = 0; n < limit; ++n) {
    const StagePoses poses{&earlier, &now_, &later};
    const Points v = solver_.stage_velocity(state_, state_.x, state_.v, poses, h, options_.integrator,
                                            options_.gravity, false);
    state_.x += h * v;
    state_.v = keep * v;
    set_bones(now_, state_.x);
    ++report.steps;
    report.speed = v.rowwise().norm().maxCoeff();
    if (!check(report)) return report;
    if (should_stop_ && should_stop_()) {
      report.status = SimulationStatus::Stopped;
      return report;
    }
    if (report.speed < options_.settle_speed) break;
  }
  // The motion may start at full speed: flesh that moves with its bones feels no jolt.
  const PosedFrames next = pose_at(start_ + eta_h);
  for (int a = 0; a < body_.mesh.num_vertices(); ++a) {
    const Eigen::Vector3d x = state_.x.row(a).transpose();
    Eigen::Vector3d moved = Eigen::Vector3d::Zero();
    for (FrameWeights::InnerIterator it(body_.weights, a); it; ++it) {
      const auto f = static_cast<std::size_t>(it.col());
      moved += it.value() * (next.frames[f].from_rest * (now_.frames[f].to_rest * x));
    }
    state_.v.row(a) = (moved - x).transpose() / eta_h;
  }
  for (const BoneVertex& bone : body_.bones.vertices) {
    state_.v.row(bone.vertex) =
        (bone_position(bone, next.joints) - bone_position(bone, now_.joints)).transpose() / eta_h;
  }
  fill_inactive_leaves(body_, state_.v);
  before_ = state_;
  return report;
}

int Simulation::halvings_for(double begin, double h) const {
  constexpr int kSamples = 4;  // a full turn within one step must not look like standing still
  constexpr int kMost = 8;
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
  while (halvings < kMost && largest > options_.largest_turn * std::exp2(halvings)) ++halvings;
  return halvings;
}

SimulationReport Simulation::step_once(double h) {
  SimulationReport report;
  const Factor::Report factor = solver_.prepare(h, options_.integrator);
  if (!factor.ok) {
    report.status = SimulationStatus::NotPositiveDefinite;
    report.message = factor.message + " at " + std::to_string(state_.time) + " s";
    report.time = state_.time;
    return report;
  }
  const double end = state_.time + h;
  const bool bdf2 = options_.integrator == Integrator::Bdf2;
  const bool regular = bdf2 && state_.has_past() && last_h_ == h;
  const PosedFrames next = pose_at(end);
  const Stage stage = stage_of(options_.integrator);
  const StagePoses poses{has_before_ ? &past_ : nullptr, &now_, &next};
  State after;
  after.time = end;
  if (regular) {
    const Points x_h = (4.0 * state_.x - state_.x_past) / 3.0;
    const Points v_h = (4.0 * state_.v - state_.v_past) / 3.0;
    after.v = solver_.stage_velocity(state_, x_h, v_h, poses, h, options_.integrator, options_.gravity, true);
    after.x = x_h + stage.eta * h * after.v;
  } else if (bdf2) {
    // Start and restart: one theta step to t + 2h/3 with the same factor, extrapolated to the end of the
    // step.
    const PosedFrames middle = pose_at(state_.time + stage.eta * h);
    const StagePoses start{poses.before, &now_, &middle};
    const Points v = solver_.stage_velocity(state_, state_.x, state_.v, start, h, options_.integrator,
                                            options_.gravity, false);
    after.x = state_.x + h * v;
    after.v = state_.v + (v - state_.v) / stage.theta;
  } else {
    after.v = solver_.stage_velocity(state_, state_.x, state_.v, poses, h, options_.integrator,
                                     options_.gravity, false);
    after.x = state_.x + h * after.v;
  }
  set_bones(next, after.x);
  before_ = std::move(state_);
  if (bdf2) {
    after.x_past = before_.x;
    after.v_past = before_.v;
  }
  state_ = std::move(after);
  past_ = std::move(now_);
  now_ = next;
  has_before_ = true;
  last_h_ = h;
  report.time = state_.time;
  report.steps = 1;
  check(report);
  return report;
}

SimulationReport Simulation::advance_to(double time) {
  constexpr int kStepsBetweenChanges = 10;  // each change restarts BDF2, and a restart is first order
  SimulationReport total;
  total.time = state_.time;
  while (state_.time < time) {
    if (part_ == 0) {
      state_.time = now_.time = start_ + static_cast<double>(base_step_) * options_.step;
      const int wanted = halvings_for(state_.time, options_.step);
      if (wanted > halvings_ || (wanted < halvings_ && steps_since_change_ >= kStepsBetweenChanges)) {
        halvings_ = wanted;
        steps_since_change_ = 0;
      }
    }
    const int parts = 1 << halvings_;
    const SimulationReport report = step_once(options_.step / parts);
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
  set_bones(posed, x);
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
  return measure(body_, positions_at(time), velocities_at(time), at_end ? now_ : pose_at(time),
                 options_.gravity);
}

}  // namespace sinew::fem
