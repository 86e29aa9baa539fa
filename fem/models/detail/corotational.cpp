#include "fem/models/detail/corotational.h"

#include "fem/models/detail/rotated_model.h"

namespace sinew::fem {

std::unique_ptr<Model> make_corotational(const Body& body, const SolverOptions& options) {
  return make_polar_model("corotational", body, rotated_options(options));
}

}  // namespace sinew::fem
