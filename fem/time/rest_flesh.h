#pragma once

#include <memory>

#include "fem/forces/loads.h"
#include "fem/models/model.h"
#include "fem/time/simulation.h"

/// Where the flesh of a run would rest if the pose of a frame stood still: what tells its motion from its
/// sag.
namespace sinew::fem {

class RestFlesh {
 public:
  /// From flesh that stands at `x` (num_vertices x 3 [m]) in a pose. The model, its loads and its step are
  /// those of a run with the same options, so that what the run comes to in a held pose is what this finds.
  /// `body` must outlive it.
  RestFlesh(const Body& body, const SimulationOptions& options, PosedFrames pose, lattice::Points x);

  /// Goes on to the rest in `pose`, `elapsed` seconds after the last one [s; > 0]. Found to within 2e-5 of
  /// the body's size, from the last rest carried along by the frames. `blended`, whose balance is that of its
  /// steps and costly to find, comes to it by as many steps as the run takes, critically damped, and so does
  /// a model that finds none: in a pose that is held they come as close within a second.
  SolveReport follow(const PosedFrames& pose, double elapsed);

  const lattice::Points& positions() const { return x_; }

 private:
  SolveReport find_rest();
  SolveReport settle_for(int steps);

  const Body& body_;
  SimulationOptions options_;
  const ModelInfo* info_;
  std::unique_ptr<Model> model_;
  LoadForces loads_;
  PosedFrames pose_;
  lattice::Points x_, v_;
};

}  // namespace sinew::fem
