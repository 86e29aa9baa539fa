#pragma once

#include <memory>
#include <string>

#include "fem/models/cell_energy.h"
#include "fem/models/detail/newton_solver.h"
#include "fem/models/model.h"

namespace sinew::fem {

/// A model given by the energy of its cells, solved by fem/models/detail/newton_solver.h.
std::unique_ptr<Model> make_newton_model(std::string name, const Body& body,
                                         std::unique_ptr<CellEnergy> energy,
                                         const NewtonOptions& options = {});

}  // namespace sinew::fem
