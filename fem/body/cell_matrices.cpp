#include "fem/body/cell_matrices.h"

#include <cmath>

#include <Eigen/LU>

namespace sinew::fem {

Eigen::Vector3d gauss_point(int k) {
  const double g = 0.5 / std::sqrt(3.0);
  Eigen::Vector3d xi;
  for (int c = 0; c < 3; ++c)
    xi[c] = 0.5 + (lattice::kCorners[static_cast<std::size_t>(k)][static_cast<std::size_t>(c)] ? g : -g);
  return xi;
}

std::array<double, 8> gauss_weights(const lattice::HexCorners& corners, const lattice::FillFractions& fill) {
  std::array<double, 8> weights{};
  for (int q = 0; q < 8; ++q) {
    const double f = fill[static_cast<std::size_t>(q)];
    const double volume = lattice::trilinear_jacobian(corners, gauss_point(q)).determinant() / 8.0;
    weights[static_cast<std::size_t>(q)] = volume * (f + kEmptyShare * (1.0 - f));
  }
  return weights;
}

CellGeometry cell_geometry(const lattice::HexCorners& corners, const lattice::FillFractions& fill) {
  CellGeometry geometry;
  geometry.weights = gauss_weights(corners, fill);
  for (int q = 0; q < 8; ++q) {
    const auto i = static_cast<std::size_t>(q);
    const Eigen::Vector3d xi = gauss_point(q);
    geometry.gradients[i] =
        lattice::trilinear_gradients(xi) * lattice::trilinear_jacobian(corners, xi).inverse();
    geometry.volume += geometry.weights[i];
  }
  return geometry;
}

CellStiffness cell_stiffness(const lattice::HexCorners& corners, const lattice::FillFractions& fill,
                             const Material& material) {
  const std::array<double, 8> weights = gauss_weights(corners, fill);
  const double mu = material.mu();
  CellStiffness stiffness = CellStiffness::Zero();
  lattice::HexGradients mean = lattice::HexGradients::Zero();  // G, one row per corner
  double volume = 0.0;
  for (int q = 0; q < 8; ++q) {
    const Eigen::Vector3d xi = gauss_point(q);
    const Eigen::Matrix3d jacobian = lattice::trilinear_jacobian(corners, xi);
    const lattice::HexGradients g = lattice::trilinear_gradients(xi) * jacobian.inverse();
    const double w = weights[static_cast<std::size_t>(q)];
    mean += w * g;
    volume += w;
    for (int a = 0; a < 8; ++a) {
      for (int b = 0; b < 8; ++b) {
        const Eigen::Vector3d ga = g.row(a).transpose(), gb = g.row(b).transpose();
        Eigen::Matrix3d block = gb * ga.transpose() - (2.0 / 3.0) * ga * gb.transpose();
        block.diagonal().array() += ga.dot(gb);
        stiffness.block<3, 3>(3 * a, 3 * b) += (w * mu) * block;
      }
    }
  }
  mean /= volume;
  Eigen::Matrix<double, 24, 1> dilatation;
  for (int a = 0; a < 8; ++a) dilatation.segment<3>(3 * a) = mean.row(a).transpose();
  stiffness += (material.bulk() * volume) * dilatation * dilatation.transpose();
  return stiffness;
}

CellMass cell_mass(const lattice::HexCorners& corners, const lattice::FillFractions& fill, double density) {
  const std::array<double, 8> weights = gauss_weights(corners, fill);
  CellMass mass = CellMass::Zero();
  for (int q = 0; q < 8; ++q) {
    const lattice::HexWeights phi = lattice::trilinear_weights(gauss_point(q));
    mass += (density * weights[static_cast<std::size_t>(q)]) * phi * phi.transpose();
  }
  return mass;
}

}  // namespace sinew::fem
