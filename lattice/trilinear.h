#pragma once

#include <array>

#include <Eigen/Core>
#include <Eigen/LU>

#include "lattice/points.h"

/// The isoparametric trilinear hexahedron on the unit cube, corners in VTK's order.
///
///        7--------6        corner k sits at kCorners[k]
///       /|       /|        local coordinates xi in [0,1]^3
///      4--------5 |
///      | 3------|-2        y
///      |/       |/        /
///      0--------1        o-- x   (z up)
namespace sinew::lattice {

/// Vertex indices of a hexahedron in VTK's order.
using HexVertices = std::array<int, 8>;
/// Corner positions as rows [m].
using HexCorners = Eigen::Matrix<double, 8, 3>;
using HexWeights = Eigen::Matrix<double, 8, 1>;
/// d weight / d xi, one row per corner.
using HexGradients = Eigen::Matrix<double, 8, 3>;

inline constexpr std::array<std::array<int, 3>, 8> kCorners{
    {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};

/// The eight hats at xi; they sum to 1.
inline HexWeights trilinear_weights(const Eigen::Vector3d& xi) {
  HexWeights weights;
  for (int k = 0; k < 8; ++k) {
    double w = 1.0;
    for (int c = 0; c < 3; ++c) w *= kCorners[k][c] ? xi[c] : 1.0 - xi[c];
    weights[k] = w;
  }
  return weights;
}

/// d weight / d xi at xi; columns sum to 0.
inline HexGradients trilinear_gradients(const Eigen::Vector3d& xi) {
  HexGradients gradients;
  for (int k = 0; k < 8; ++k) {
    for (int d = 0; d < 3; ++d) {
      double g = kCorners[k][d] ? 1.0 : -1.0;
      for (int c = 0; c < 3; ++c) {
        if (c != d) g *= kCorners[k][c] ? xi[c] : 1.0 - xi[c];
      }
      gradients(k, d) = g;
    }
  }
  return gradients;
}

/// Rows of the corners of a hexahedron.
inline HexCorners hex_corners(const Points& points, const HexVertices& hex) {
  HexCorners corners;
  for (int k = 0; k < 8; ++k) corners.row(k) = points.row(hex[static_cast<std::size_t>(k)]);
  return corners;
}

/// Jacobian dx/dxi, 3 x 3, of the trilinear map at xi.
inline Eigen::Matrix3d trilinear_jacobian(const HexCorners& corners, const Eigen::Vector3d& xi) {
  return corners.transpose() * trilinear_gradients(xi);
}

/// Result of inverting the trilinear map.
struct LocalCoordinates {
  Eigen::Vector3d xi{0.5, 0.5, 0.5};
  bool converged = false;
  /// How far xi leaves the unit cube, largest over the axes [-]; 0 inside.
  double outside = 0.0;
};

/// Solves x(xi) = p by Newton's method from the centre. Converges for convex cells and points near them;
/// where it does not, `converged` is false.
LocalCoordinates invert_trilinear(const HexCorners& corners, const Eigen::Vector3d& p);

}  // namespace sinew::lattice
