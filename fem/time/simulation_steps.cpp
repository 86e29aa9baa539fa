#include "fem/body/placement.h"
#include "fem/time/simulation.h"

/// How every integrator puts a step together from the stages of fem/models/integrator.h.
namespace sinew::fem {

using lattice::Points;

/// `time`: when forces are asked for.
StageProblem Simulation::stage(const State& from, const Points& x_h, const Points& v_h,
                               const StagePoses& poses, double elapsed, double h, double time) {
  StageProblem problem;
  problem.state = &from;
  problem.x_h = &x_h;
  problem.v_h = &v_h;
  problem.poses = poses;
  problem.past = {{1.0, &from.x, poses.now}};
  problem.elapsed = elapsed;
  problem.h = h;
  problem.integrator = options_.integrator;
  problem.gravity = options_.gravity;
  // What follows the surface is taken where that will be at the end of the stage: of second order, like the
  // rest.
  if (!options_.loads.empty())
    force_ = loads_.at(loads_.follow() ? Points(from.x + elapsed * from.v) : from.x);
  if (options_.force) {
    const Points further = options_.force(time);
    force_ = options_.loads.empty() ? further : Points(force_ + further);
  }
  const bool pushed = !options_.loads.empty() || options_.force;
  if (inertial_force_.rows() > 0) force_ = pushed ? Points(force_ + inertial_force_) : inertial_force_;
  if (pushed || inertial_force_.rows() > 0) problem.force = &force_;
  return problem;
}

SolveReport Simulation::stage_without_history(double span, double h, const PosedFrames& next, State& after) {
  const Stage scheme = stage_of(options_.integrator);
  const PosedFrames middle = pose_at(moving_.flesh.time + scheme.eta * h);
  Points v;
  const SolveReport solve =
      model_->solve_stage(stage(moving_.flesh, moving_.flesh.x, moving_.flesh.v,
                                {before_pose(), &moving_.now, &middle}, scheme.eta * h, h, middle.time),
                          v);
  if (!solve.ok()) return solve;
  after.x = moving_.flesh.x + span * v;
  after.a = (v - moving_.flesh.v) / (scheme.theta * h);
  after.v = moving_.flesh.v + span * after.a;
  place_bones(body_, next, after.x);
  return solve;
}

SolveReport Simulation::bdf2_stage(const State& from, const StagePoses& poses, double h, State& after) {
  const Stage scheme = stage_of(options_.integrator);
  const Points x_h = from.x + scheme.look_back * (from.x - from.x_past);
  const Points v_h = from.v + scheme.look_back * (from.v - from.v_past);
  StageProblem problem = stage(from, x_h, v_h, poses, scheme.reach * h, h, poses.stage->time);
  problem.past = {{1.0 + scheme.look_back, &from.x, poses.now},
                  {-scheme.look_back, &from.x_past, poses.before}};
  const SolveReport solve = model_->solve_stage(problem, after.v);
  if (!solve.ok()) return solve;
  after.x = x_h + scheme.eta * h * after.v;
  place_bones(body_, *poses.stage, after.x);
  after.a = (after.v - v_h) / (scheme.theta * h);
  if (options_.integrator == Integrator::TrBdf2) moving_.step_end = StepEnd{from.x, *poses.now, h};
  return solve;
}

SolveReport Simulation::bdf2_step(double h, const PosedFrames& next, State& after) {
  if (moving_.flesh.has_past() && moving_.last_h == h)
    return bdf2_stage(moving_.flesh, {&moving_.past, &moving_.now, &next}, h, after);
  // After a change of step the same formula and the same factor, with the place of one such step earlier.
  std::optional<State> from = moving_.track.looking_back(moving_.flesh, h);
  if (!from) return stage_without_history(h, h, next, after);
  const PosedFrames before = pose_at(moving_.flesh.time - h);
  place_bones(body_, before, from->x_past);
  fill_inactive_leaves(body_, from->x_past);
  return bdf2_stage(*from, {&before, &moving_.now, &next}, h, after);
}

SolveReport Simulation::midpoint_step(double h, const PosedFrames& next, State& after) {
  // The rule's own middle: halfway along the chord, for the bones as for the flesh. Where they are on their
  // arcs instead, bones have the velocity of the step's first quarter, and the rule is of first order.
  const std::optional<PosedFrames> middle = mean_pose(body_.tree, moving_.now, next);
  if (!middle) return stage_without_history(h, h, next, after);
  // The rate of strain is that of the whole step, (u_n+1 - u_n) / h with each u in its own frames, but for
  // what the prediction of x_n+1 lacks, which is taken at the middle. Flesh that only moves with its frames
  // has none.
  const Points to_next = carried(body_, moving_.flesh.x, moving_.now, next);
  const bool centred =
      moving_.has_before && moving_.last_h == h;  // the frames' velocity at the begin, else after it
  const Points since = centred ? carried(body_, moving_.flesh.x, moving_.now, moving_.past) : moving_.flesh.x;
  Points end = to_next + h * (moving_.flesh.v - (to_next - since) / (centred ? 2.0 * h : h));
  place_bones(body_, next, end);
  fill_inactive_leaves(body_, end);
  const Points half_way = 0.5 * (moving_.flesh.x + end);
  StageProblem problem = stage(moving_.flesh, moving_.flesh.x, moving_.flesh.v,
                               {before_pose(), &moving_.now, &*middle}, 0.5 * h, h, middle->time);
  problem.past = {{1.0, &half_way, &*middle}, {0.5, &moving_.flesh.x, &moving_.now}, {-0.5, &end, &next}};
  Points v;
  const SolveReport solve = model_->solve_stage(problem, v);
  if (!solve.ok()) return solve;
  after.x = moving_.flesh.x + h * v;
  after.v = 2.0 * v - moving_.flesh.v;
  place_bones(body_, next, after.x);
  return solve;
}

SolveReport Simulation::trapezoidal_stage(double h, const PosedFrames& middle, State& after) {
  const Stage scheme = stage_of(Integrator::TrBdf2);
  const double half = 0.5 * kTrBdf2Break * h;
  const Points x_h = moving_.flesh.x + half * moving_.flesh.v;
  const Points v_h = moving_.flesh.v + half * moving_.flesh.a;
  StageProblem problem =
      stage(moving_.flesh, x_h, v_h, {before_pose(), &moving_.now, &middle}, 2.0 * half, h, middle.time);
  // The rate of strain with which the last step ended, (u - u_h) / (kappa h_last), goes on for half the
  // stage.
  const double ratio = h / moving_.step_end->h;
  problem.past = {{1.0 + ratio, &moving_.flesh.x, &moving_.now},
                  {-ratio * (1.0 + scheme.look_back), &moving_.step_end->x_middle, &moving_.step_end->middle},
                  {ratio * scheme.look_back, &moving_.flesh.x_past, &moving_.past}};
  const SolveReport solve = model_->solve_stage(problem, after.v);
  if (!solve.ok()) return solve;
  after.x = x_h + half * after.v;
  place_bones(body_, middle, after.x);
  return solve;
}

SolveReport Simulation::tr_bdf2_step(double h, const PosedFrames& next, State& after) {
  State middle;
  middle.time = moving_.flesh.time + kTrBdf2Break * h;
  const PosedFrames posed = pose_at(middle.time);
  const SolveReport solve = moving_.step_end ? trapezoidal_stage(h, posed, middle)
                                             : stage_without_history(kTrBdf2Break * h, h, posed, middle);
  if (!solve.ok()) return solve;
  middle.x_past = moving_.flesh.x;
  middle.v_past = moving_.flesh.v;
  return bdf2_stage(middle, {&moving_.now, &posed, &next}, h, after);
}

}  // namespace sinew::fem
