#include "fem/models/corotational.h"

#include "fem/models/rotated_model.h"

namespace sinew::fem {

std::unique_ptr<Model> make_corotational(const Body& body, const SolverOptions&) {
  return make_rotated_model(
      "corotational", body,
      [polar = PolarRotations(body)](const lattice::Points& x, const PosedFrames&) { return polar(x); });
}

}  // namespace sinew::fem
