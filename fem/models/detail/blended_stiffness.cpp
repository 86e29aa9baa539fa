#include "fem/models/detail/blended_stiffness.h"

#include "fem/models/detail/rotated_model.h"

namespace sinew::fem {

std::unique_ptr<Model> make_blended_stiffness(const Body& body, const SolverOptions& options) {
  return make_rotated_model(
      "blended-stiffness", body,
      [&body](const lattice::Points&, const PosedFrames& pose) { return frame_rotations(body, pose); },
      rotated_options(options));
}

}  // namespace sinew::fem
