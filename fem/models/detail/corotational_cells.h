#pragma once

#include <memory>

#include "fem/models/cell_energy.h"

/// The potential of corotational flesh. A cell with corners x and mean deformation gradient
/// F = sum_i x_i G_i^T = R S stands at y = R^T x in axes that turn with it, and has
///   E(x) = 1/2 (y - X)^T K (y - X).
/// K makes no difference between small turns and no strain, but feels turns of a cell that is deformed, so
/// the forces are more than R K (y - X): the turn that a move dx makes is R (w x), with
///   A w = sum_i G_i x R^T dx_i,  A = tr(S) I - S,
/// and with the spin p = A^-1 sum_i y_i x k_i, k = K (y - X), the forces that are E's slope ([Barbic12]) are
///   f_i = R (k_i - p x G_i):
/// no net torque is left of them. Where A is singular there is no turn, and fem/models/detail/collapse.h adds
/// an energy that keeps cells away.
namespace sinew::fem {

/// Cells of that law. Their viscosity is quadratic in the change of y, so that the forces of both turn alike.
std::unique_ptr<CellEnergy> corotational_cells(const Body& body);

}  // namespace sinew::fem
