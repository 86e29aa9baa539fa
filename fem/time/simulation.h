#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fem/forces/loads.h"
#include "fem/models/model.h"
#include "fem/report/measures.h"
#include "fem/time/cuts.h"
#include "fem/time/energy_cap.h"
#include "fem/time/motion.h"
#include "fem/time/moving_state.h"
#include "fem/time/track.h"

/// The time loop: settles the flesh, steps it along a motion, and samples it at any time between steps. Knows
/// no files.
namespace sinew::fem {

struct SimulationOptions {
  /// Step h [s]; > 0. Belongs to the scene, never to the frame rate: the held pose depends slightly on it.
  double step = 1.0 / 120.0;
  Integrator integrator = Integrator::Bdf2;
  Eigen::Vector3d gravity{0.0, -9.81, 0.0};  ///< [m/s^2].
  double settle_limit = 5.0;                 ///< longest settling [s]; >= 0.
  /// Settled when nothing moves faster [m/s]; left out: kSettledRate sizes of the body a second.
  std::optional<double> settle_speed;
  /// A frame that turns more in one step halves the step, again and again [rad].
  double largest_turn = 15.0 * 3.14159265358979323846 / 180.0;
  /// Which model of the flesh steps: a name of the registry (fem/models/model.h).
  std::string model{kDefaultModel};
  SolverOptions solver;
  /// From the start on; pressures follow the surface to where its velocity takes it in a stage.
  Loads loads;
  /// Further forces on the leaf vertices at a time, num_vertices x 3 [N]; empty: none.
  std::function<lattice::Points(double time)> force;
  /// How far apart the keys are that the motion moves evenly between [s]; >= 0. Its accelerations are taken
  /// over that time at least, or over a step where it is longer.
  double key_interval = 0.0;
  /// Of the motion; steps that touch one carry the flesh along with its bones, and no time passes for it.
  std::vector<Cut> cuts = {};

  /// Throws std::invalid_argument naming the field, its value and the rule it breaks.
  void validate() const;
};

enum class SimulationStatus { Ok, NotPositiveDefinite, NoConvergence, Diverged, Stopped };

/// How a call ended; `message` names time and place.
struct SimulationReport {
  SimulationStatus status = SimulationStatus::Ok;
  double time = 0.0;    ///< of the last good state [s].
  int steps = 0;        ///< taken by this call.
  double speed = 0.0;   ///< settle: largest speed left [m/s],
  std::string fastest;  ///< and the joint whose flesh has it.
  bool settled = true;  ///< settle: that is slow enough, or nothing was to settle.
  std::string message;
};

/// Flesh that moves by less of the body's size in a second is at rest [1/s]. Twice that would be 0.1 % of the
/// height of a body that is half as high as the diagonal of its box is long.
inline constexpr double kSettledRate = 5e-4;

/// A frame that moves farther than this between two steps, in sizes of the body [-], was not moved but cut,
/// whatever the options say: at the default step nobody means the flesh to be dragged over a hundred of its
/// lengths in a second. Longer steps reach it at lower speeds; the envelope warns of it.
inline constexpr double kCutJump = 1.0;

/// A step is halved at most so often, for fast frames and for solves that fail.
inline constexpr int kMostHalvings = 8;
/// Steps that go well before a longer one is tried: what turned fast may go on to.
inline constexpr int kStepsBetweenChanges = 10;

class Simulation {
 public:
  /// Starts at rest in the pose of `start_time`. `body` must outlive it. `should_stop` is asked after every
  /// step.
  Simulation(const Body& body, Motion motion, double start_time, const SimulationOptions& options,
             std::function<bool()> should_stop = {});

  /// Lets the flesh come to rest in the starting pose, critically damped at the damping frequency, by steps
  /// of the same length and matrices as the run's; they start where the flesh of linear laws rests, by one
  /// solve. Rests under the loads, gravity and the accelerations that the motion begins with; then has the
  /// motion's velocity, so that nothing jolts at the first frame.
  [[nodiscard]] SimulationReport settle();

  /// Steps, or sub-steps where a frame turns fast or the model's solve fails, until flesh().time >= time;
  /// does nothing when it is there already. In a cut, and where a frame jumps by more than kCutJump, the
  /// flesh is carried along with the frames and keeps its velocity: that gives it no push. Throws
  /// std::invalid_argument
  /// naming joint and time where the motion gives a frame that is not finite or has no volume; the state
  /// stays the last good one.
  [[nodiscard]] SimulationReport advance_to(double time);

  /// Gives the flesh a velocity [m/s], num_vertices x 3, before the first step; bone vertices keep the
  /// clip's.
  void set_velocity(const lattice::Points& velocity);

  /// Steps by `step` [s] from the last state on; > 0, else throws std::invalid_argument. Every integrator
  /// keeps its order at any ratio to the step before, BDF2 as far as the steps since the start or the last
  /// cut reach back; beyond that it starts anew, by one step of first order. A step of a length that was not
  /// taken before makes the models factor anew.
  void set_step(double step);

  const Body& body() const { return body_; }
  const State& flesh() const { return moving_.flesh; }
  /// All that moves, between two calls.
  MovingState state() const;
  /// Goes on from a state of a run with this body and motion and these options, of this simulation or another
  /// one: bit for bit as that run did. Steps take the state's length. Throws std::invalid_argument naming the
  /// part that does not fit the body, and then leaves all as it was.
  void set_state(MovingState state);
  /// Leaf vertices at a time between the last two states, moved in bone coordinates; bone vertices exactly on
  /// the clip.
  lattice::Points positions_at(double time) const;
  /// Velocities there, linear between the states [m/s].
  lattice::Points velocities_at(double time) const;
  Measures measures_at(double time) const;
  /// The embedded skin: rows of `positions`.
  lattice::Points skin_of(const lattice::Points& positions) const { return body_.skin_rows * positions; }
  SolverCounts counts() const { return model_->counts(); }
  /// What blending made of energy while the bones stood still, and was taken out again.
  EnergyCap::Taken energy_taken() const { return energy_cap_ ? energy_cap_->taken() : EnergyCap::Taken{}; }

 private:
  PosedFrames pose_at(double time) const;
  int halvings_for(double begin, double h) const;
  SimulationReport step_once(double h);
  /// Of flesh that rides on its frames, on average over a time from now on [m/s].
  lattice::Points riding_velocity(double span) const;
  /// How the motion begins, of flesh that rides on its frames: accelerations as far as they last, and
  /// velocities [m/s^2], [m/s].
  struct Beginning {
    lattice::Points acceleration, velocity;
  };
  Beginning beginning() const;
  /// A guess of where the flesh rests, by one linear solve; as skinned where there is none.
  lattice::Points guessed_rest() const;
  std::string joint_of(int vertex) const;
  /// One whole step in which the flesh keeps its place in its frames and its velocity relative to them.
  SimulationReport carry_through_cut();
  void forget_history();
  bool jumps_to(const PosedFrames& next) const;
  SimulationReport step_after_cut(double h, const PosedFrames& next);
  /// One stage to now + eta h, extrapolated to now + span with the pose `next`.
  SolveReport stage_without_history(double span, double h, const PosedFrames& next, State& after);
  /// One stage of BDF2 to poses.stage from a state and the one before it.
  SolveReport bdf2_stage(const State& from, const StagePoses& poses, double h, State& after);
  SolveReport bdf2_step(double h, const PosedFrames& next, State& after);
  SolveReport midpoint_step(double h, const PosedFrames& next, State& after);
  /// The first part of TR-BDF2, to the pose `middle`: the trapezoidal rule, from how the last step ended.
  SolveReport trapezoidal_stage(double h, const PosedFrames& middle, State& after);
  SolveReport tr_bdf2_step(double h, const PosedFrames& next, State& after);
  StageProblem stage(const State& from, const lattice::Points& x_h, const lattice::Points& v_h,
                     const StagePoses& poses, double elapsed, double h, double time);
  const PosedFrames* before_pose() const { return moving_.has_before ? &moving_.past : nullptr; }
  SimulationReport failed(const SolveReport& solve) const;
  bool check(SimulationReport& report) const;

  const Body& body_;
  Motion motion_;
  SimulationOptions options_;
  std::function<bool()> should_stop_;
  const ModelInfo* info_;
  std::unique_ptr<Model> model_;
  LoadForces loads_;
  lattice::Points force_;  ///< of loads and options_.force, in the stage under way.
  /// While the flesh settles: what the frames' acceleration takes from its weight [N]; else empty.
  lattice::Points inertial_force_;
  /// Without what the energy cap and the model remember, which they keep themselves.
  MovingState moving_;
  std::optional<EnergyCap> energy_cap_;
  std::optional<PosedFrames> held_;  ///< during a step after a cut: the pose that stands still.
};

}  // namespace sinew::fem
