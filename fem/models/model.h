#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "fem/body/body.h"
#include "fem/models/stage_problem.h"

/// The ladder: models of the flesh from skinning to full nonlinear elasticity behind one interface. All of
/// them move the same State along the same poses; the time loop (fem/time/simulation.h) does not know which
/// one it steps. Adding a model takes a file pair in this folder and one line in registry.cpp.
namespace sinew::fem {

/// Why a solve ended. Everything but Ok leaves the caller's state as it was.
enum class SolveStatus {
  Ok,
  NotPositiveDefinite,  ///< no factor, and no fallback helped.
  NoConvergence,        ///< iterations ran out or no step made progress: a smaller time step may help.
};

/// Message of a solve that went well but could not reach its tolerance: nothing moved any more.
inline constexpr std::string_view kStagnated = "stagnated at round-off";

/// What a model did; `message` is one sentence that names the place.
struct [[nodiscard]] SolveReport {
  SolveStatus status = SolveStatus::Ok;
  int iterations = 0;     ///< of the outermost loop; 0 for one direct solve.
  double residual = 0.0;  ///< left over, relative to the forces that balance [-].
  int cell = -1;          ///< leaf cell with the largest residual or the most inverted; -1 where ok.
  std::string message;

  bool ok() const { return status == SolveStatus::Ok; }
};

/// A pose in which the flesh is to come to rest.
struct PoseProblem {
  const PosedFrames* pose = nullptr;
  Eigen::Vector3d gravity{0, 0, 0};        ///< [m/s^2].
  const lattice::Points* force = nullptr;  ///< further forces on the leaf vertices [N]; null for none.
};

/// What a model keeps of stages that it has solved and that later results depend on, to the last bit.
struct ModelMemory {
  /// A system whose factor still preconditions: enough to make that very factor again.
  struct EarlierSystem {
    double inertia = -1.0, damping = -1.0;   ///< of the balance (fem/models/balance.h); -1: there is none.
    std::vector<Eigen::Matrix3d> rotations;  ///< of the leaf cells.
  };
  std::vector<EarlierSystem> systems;
};

/// Elastic energy and forces of every leaf cell.
struct CellForces {
  std::vector<double> energy;     ///< [J].
  std::vector<CellVector> force;  ///< its gradient by the corners, dof 3 * corner + component [N].
};

class Model {
 public:
  virtual ~Model() = default;

  /// Makes what stages of step h [s] need; cheap where it is there already.
  virtual SolveReport prepare(double h, Integrator integrator) = 0;

  /// v+ [m/s] of all leaf vertices at the end of the stage; those on bones get the velocity that puts them on
  /// the clip. prepare(h, integrator) must have succeeded. `velocity` is untouched unless the report is ok.
  virtual SolveReport solve_stage(const StageProblem& problem, lattice::Points& velocity) = 0;

  /// Puts the flesh where it rests in the pose; `x`: a first guess (num_vertices x 3 [m]) and the result,
  /// untouched unless the report is ok.
  virtual SolveReport equilibrate(const PoseProblem& problem, lattice::Points& x) = 0;

  /// What the model's law says of leaf positions x in a pose, without viscosity.
  virtual CellForces cell_forces(const lattice::Points& x, const PosedFrames& pose) = 0;

  /// The law is linear in the rotations of the cells' frames, as fem/report/measures.h has it.
  virtual bool linear_in_frames() const { return false; }

  /// Its steps may give the flesh energy that nothing put in.
  virtual bool may_gain_energy() const { return false; }

  virtual SolverCounts counts() const = 0;

  /// All that a solve depends on besides its problem; empty where there is no such thing.
  virtual ModelMemory memory() const { return {}; }
  /// Goes on as the model of the same body and options did that had this memory; an empty one: as a new one.
  virtual SolveReport recall(const ModelMemory&) { return {}; }
};

/// A line of the registry.
struct ModelInfo {
  std::string_view name;         ///< as flags and scenes write it.
  std::string_view description;  ///< one line.
  /// False: flesh has no inertia and stands at every instant where the pose alone puts it.
  bool dynamic = true;
  /// Its factors last over many steps, so that SolverOptions::precision counts.
  bool keeps_factors = false;
  std::unique_ptr<Model> (*make)(const Body& body, const SolverOptions& options) = nullptr;
};

/// All models, cheapest first.
std::span<const ModelInfo> models();

/// nullptr where there is none of that name.
const ModelInfo* find_model(std::string_view name);

/// The name of the model that is used unless another one is asked for.
inline constexpr std::string_view kDefaultModel = "blended-stiffness";

}  // namespace sinew::fem
