#pragma once

#include "fem/models/cell_energy.h"
#include "fem/models/model.h"

/// St. Venant-Kirchhoff flesh with mean dilatation (fem/models/detail/green_strain.h). Simple and exact at
/// small strain and any rotation; squeezed below 0.58 of its length it softens, and then it collapses.
namespace sinew::fem {

/// Cells of that law; their viscosity is quadratic in the change of the Green strain.
std::unique_ptr<CellEnergy> stvk_cells(const Body& body);

std::unique_ptr<Model> make_stvk(const Body& body, const SolverOptions& options);

}  // namespace sinew::fem
