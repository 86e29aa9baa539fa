#include "fem/models/detail/stvk.h"

#include "fem/models/detail/green_strain.h"
#include "fem/models/detail/newton_model.h"

namespace sinew::fem {

std::unique_ptr<CellEnergy> stvk_cells(const Body& body) {
  return std::make_unique<GreenStrainEnergy>(body, 1.0);
}

std::unique_ptr<Model> make_stvk(const Body& body, const SolverOptions&) {
  return make_newton_model("stvk", body, stvk_cells(body));
}

}  // namespace sinew::fem
