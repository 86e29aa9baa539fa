#pragma once

#include "fem/models/model.h"

namespace sinew::fem {

/// What a model may be besides: able to go from a place near a rest to about that rest, for less than the
/// balance to the last digit costs that Model::equilibrate finds from anywhere.
class NearRest {
 public:
  virtual ~NearRest() = default;

  /// `x`: where the flesh is and where it comes to (num_vertices x 3 [m]), no farther from its rest than
  /// about `slack` [m; > 0]; untouched unless the report is ok.
  virtual SolveReport approach_rest(const PoseProblem& problem, double slack, lattice::Points& x) = 0;
};

}  // namespace sinew::fem
