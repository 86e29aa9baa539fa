#pragma once

#include <vector>

#include "fem/models/cell_energy.h"
#include "fem/models/model.h"

/// The classic baseline: springs along the edges and the diagonals of the leaf cells, k/2 (l - L)^2 each.
///
/// Stiffnesses are matched to E per cell: springs that strain with the cell have the elasticity tensor
/// sum_s k_s L_s^2 n_s n_s n_s n_s / V. Central forces fix Poisson's ratio at 1/4 (Cauchy's relations),
/// whatever the material says; k >= 0 is the least-squares fit of that tensor to the isotropic one with E and
/// 1/4. In a cube of side a, shared with its neighbours, it is exact with k = 2/5 E a on edges and on face
/// diagonals.
namespace sinew::fem {

/// Poisson's ratio of springs [-].
inline constexpr double kSpringPoisson = 0.25;

/// A spring of one cell between two of its corners.
struct Spring {
  int a = 0, b = 0;        ///< corners.
  double length = 0.0;     ///< at rest [m].
  double stiffness = 0.0;  ///< k [N/m]; >= 0.
};

/// 12 edges, 12 face diagonals and 4 space diagonals of a cell with corners x (columns) and `volume` of flesh
/// [m^3], matched to `young` [Pa]. Those without a
/// billionth of the stiffest one's stiffness are left out.
std::vector<Spring> matched_springs(const CellPoints& x, double volume, double young);

/// Cells as springs; their viscosity damps changes of length.
std::unique_ptr<CellEnergy> spring_cells(const Body& body);

std::unique_ptr<Model> make_springs(const Body& body, const SolverOptions& options);

}  // namespace sinew::fem
