#pragma once

#include <vector>

#include "fem/models/integrator.h"
#include "fem/models/state.h"

/// What every model of the flesh is given for one implicit stage.
namespace sinew::fem {

/// A place of the flesh in the past, with its share in the history that the rates of damping are measured
/// against: u_h = sum_k share_k u_k, each u in the frames of its own time.
struct PastPlace {
  double share = 1.0;                  ///< [-]; the shares of one history sum to 1.
  const lattice::Points* x = nullptr;  ///< num_vertices x 3 [m].
  const PosedFrames* pose = nullptr;   ///< of that time.
};

/// One implicit stage, x+ = x_h + eta h v+ (fem/models/integrator.h), about to be solved for v+.
struct StageProblem {
  const State* state = nullptr;          ///< where the stage starts from.
  const lattice::Points* x_h = nullptr;  ///< stage predictor of positions, num_vertices x 3 [m].
  const lattice::Points* v_h = nullptr;  ///< stage predictor of velocities [m/s].
  StagePoses poses;
  std::vector<PastPlace> past;  ///< the damping's history; at least one.
  double elapsed = 0.0;         ///< from `state` to the stage [s].
  double h = 0.0;               ///< step [s].
  Integrator integrator = Integrator::Bdf2;
  Eigen::Vector3d gravity{0, 0, 0};        ///< [m/s^2].
  const lattice::Points* force = nullptr;  ///< further forces on the leaf vertices [N]; null for none.
};

}  // namespace sinew::fem
