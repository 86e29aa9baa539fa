#pragma once

#include <array>

#include <Eigen/Core>

#include "fem/material/material.h"
#include "lattice/fill.h"
#include "lattice/trilinear.h"

/// Matrices of one trilinear hexahedron, partly filled, with mean dilatation (B-bar).
namespace sinew::fem {

using CellStiffness = Eigen::Matrix<double, 24, 24>;  ///< dof 3 * corner + component [N/m].
using CellMass = Eigen::Matrix<double, 8, 8>;         ///< one value per pair of corners [kg].

/// Share of stiffness and mass kept on the unfilled part of a cell, eps: it changes
/// results by less than 0.2 % there and keeps every function's diagonal away from zero.
inline constexpr double kEmptyShare = 1e-4;

/// Gauss point of the octant of corner k on the unit cube.
Eigen::Vector3d gauss_point(int k);

/// Gauss weights [m^3] of a cell: det J / 8 times the filled share of the octant, plus kEmptyShare of the
/// rest. A negative entry means an inverted cell.
std::array<double, 8> gauss_weights(const lattice::HexCorners& corners, const lattice::FillFractions& fill);

/// Corner positions as columns: the flat vector of a cell, dof 3 * corner + component, is its map.
using CellPoints = Eigen::Matrix<double, 3, 8>;
using CellVector = Eigen::Matrix<double, 24, 1>;

/// What a nonlinear energy needs of a cell at rest: deformation gradients are F_q = x gradients[q], x as
/// CellPoints.
struct CellGeometry {
  std::array<lattice::HexGradients, 8> gradients;  ///< g_a at Gauss point q, one row per corner [1/m].
  std::array<double, 8> weights{};                 ///< gauss_weights [m^3].
  double volume = 0.0;                             ///< their sum [m^3].
};
CellGeometry cell_geometry(const lattice::HexCorners& corners, const lattice::FillFractions& fill);

/// K with mean dilatation [Hughes80]:
///   K_ab = sum_q w_q [ mu (g_a.g_b I + g_b g_a^T) - 2 mu/3 g_a g_b^T + kappa_b G_a G_b^T ],
/// g_a the gradient of hat a at Gauss point q, G_a its mean over the filled part of the cell ([Hughes80]
/// B-bar).
CellStiffness cell_stiffness(const lattice::HexCorners& corners, const lattice::FillFractions& fill,
                             const Material& material);

/// Consistent mass, rho sum_q w_q phi_a phi_b.
CellMass cell_mass(const lattice::HexCorners& corners, const lattice::FillFractions& fill, double density);

}  // namespace sinew::fem
