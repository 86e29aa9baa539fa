#pragma once

#include <functional>
#include <string>

#include "fem/forces/loads.h"
#include "fem/models/model.h"

/// Statics: where the flesh comes to rest under loads in a pose, by load stepping.
namespace sinew::fem {

struct EquilibriumOptions {
  std::string model{kDefaultModel};          ///< a name of the registry.
  Eigen::Vector3d gravity{0.0, -9.81, 0.0};  ///< [m/s^2].
  Loads loads;
  int steps = 4;  ///< wanted load steps; >= 1. Fewer where a step converges at once, more where it does not.
  int max_halvings = 10;  ///< of a load step before giving up; 0 .. 30.
  SolverOptions solver;
  /// Told before every load step, also of one that is tried again, which factor is reached [-]. What it
  /// throws ends the search.
  std::function<void(double factor)> before_step;

  /// Throws std::invalid_argument naming the field, its value and the rule it breaks.
  void validate() const;
};

/// pose_from_rest of every joint at a load factor in [0, 1]: the rest pose at 0, the wanted one at 1. It
/// should turn joints as rotations: flesh squeezed on a straight way between two poses may never find back.
using PosePath = std::function<std::vector<Eigen::Affine3d>(double factor)>;

struct Equilibrium {
  SolveReport report;        ///< of the last load step; its message names the load factor where it failed.
  double load_factor = 0.0;  ///< reached [-]; 1 where all went well.
  int load_steps = 0;        ///< converged ones.
  lattice::Points x;         ///< leaf positions at that load factor [m].
  PosedFrames pose;          ///< at that load factor.
};

/// Applies pose, gravity and loads in steps and lets the model find its balance at each. `body` is only read.
Equilibrium find_equilibrium(const Body& body, const PosePath& path, const EquilibriumOptions& options = {});

/// A path that holds one pose: only the loads grow.
PosePath held_pose(std::vector<Eigen::Affine3d> pose_from_rest);

}  // namespace sinew::fem
