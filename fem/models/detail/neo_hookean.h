#pragma once

#include "fem/models/cell_energy.h"
#include "fem/models/model.h"

/// Neo-Hookean flesh, safe under inversion, with the mean dilatation of a leaf cell:
///   psi = mu/2 (I_C - 3) - mu (J - 1) + mu/6 (J - 1)^2 + kappa_b/2 (Jbar - 1)^2,
/// I_C = tr F^T F, J = det F, Jbar the mean of J over the flesh of the cell. At rest stress-free, at small
/// strain B-bar's linear elasticity: the terms in J are what is left of mu/2 (I_C - 3) to second order.
namespace sinew::fem {

double neo_hookean_energy(const CellGeometry& geometry, const Material& material, const CellPoints& x);
/// d energy / d x.
CellVector neo_hookean_gradient(const CellGeometry& geometry, const Material& material, const CellPoints& x);
/// Adds d^2 energy / d x^2.
void add_neo_hookean_hessian(const CellGeometry& geometry, const Material& material, const CellPoints& x,
                             CellStiffness& hessian);

/// Cells of that law; their viscosity is quadratic in the change of the Green strain.
std::unique_ptr<CellEnergy> neo_hookean_cells(const Body& body);

std::unique_ptr<Model> make_neo_hookean(const Body& body, const SolverOptions& options);

}  // namespace sinew::fem
