#pragma once

#include "fem/time/rest_flesh.h"
#include "tools/session/character.h"

namespace sinew::tools {

/// `--offset A`: the rig's own skinning plus A times what tells the flesh from its rest in the same pose.
/// Where nothing moves that is the artist's own shape.
class OffsetFlesh {
 public:
  /// For a share A that is not 0. All of them must outlive it; the simulation stands where the first frame
  /// will be.
  OffsetFlesh(double share, const Character& character, const fem::Simulation& simulation,
              const fem::SimulationOptions& options);

  /// Moves the flesh of a frame, which holds the simulation's at a time [s] in a pose: `simulated` and
  /// `skinned` are num_vertices x 3 [m]. Times must grow. Throws NumericalError where the flesh finds no
  /// rest.
  void apply(double time, const std::vector<Eigen::Affine3d>& pose, const lattice::Points& skinned,
             lattice::Points& simulated);

 private:
  double share_;
  const Character& character_;
  const fem::Simulation& simulation_;
  fem::RestFlesh rest_;
  double last_;  ///< time of the last frame, of a step before the first [s].
};

}  // namespace sinew::tools
