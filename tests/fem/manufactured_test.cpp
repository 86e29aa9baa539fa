// Manufactured static solutions: a smooth displacement is chosen, the body force that holds it follows from
// the law by its own formula, and the error of what a model finds must fall as linear elements promise.
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "fem/models/model.h"
#include "tests/fem/bar.h"

namespace sinew::fem {
namespace {

using lattice::Points;

constexpr double kYoung = 1e4, kPoisson = 0.3;
constexpr double kMu = kYoung / (2.0 * (1.0 + kPoisson));
constexpr double kBulk = kYoung / (3.0 * (1.0 - 2.0 * kPoisson));

using Stress = std::function<Eigen::Matrix3d(const Eigen::Matrix3d& f)>;  ///< first Piola-Kirchhoff.

Eigen::Matrix3d stvk_stress(const Eigen::Matrix3d& f) {
  const Eigen::Matrix3d e = 0.5 * (f.transpose() * f - Eigen::Matrix3d::Identity());
  return f * ((kBulk - 2.0 / 3.0 * kMu) * e.trace() * Eigen::Matrix3d::Identity() + 2.0 * kMu * e);
}

/// psi = mu/2 (I_C - 3) - mu (J - 1) + (mu/6 + kappa/2) (J - 1)^2.
Eigen::Matrix3d neo_hookean_stress(const Eigen::Matrix3d& f) {
  const double j = f.determinant();
  return kMu * f + (-kMu + (kMu / 3.0 + kBulk) * (j - 1.0)) * j * f.inverse().transpose();
}

/// The chosen displacement on the unit cube and its gradient.
struct Field {
  double amplitude;

  Eigen::Vector3d u(const Eigen::Vector3d& x) const {
    return amplitude * Eigen::Vector3d(std::sin(2.0 * x[1]) * x[2], std::cos(3.0 * x[0]) * x[1] * x[1],
                                       std::exp(x[0]) * x[2] * x[1]);
  }
  Eigen::Matrix3d gradient(const Eigen::Vector3d& x) const {  // F = I + du/dX
    Eigen::Matrix3d g;
    g << 0.0, 2.0 * std::cos(2.0 * x[1]) * x[2], std::sin(2.0 * x[1]),                      //
        -3.0 * std::sin(3.0 * x[0]) * x[1] * x[1], 2.0 * std::cos(3.0 * x[0]) * x[1], 0.0,  //
        std::exp(x[0]) * x[2] * x[1], std::exp(x[0]) * x[2], std::exp(x[0]) * x[1];
    return Eigen::Matrix3d::Identity() + amplitude * g;
  }
  /// -Div P by central differences: truncation 1e-8, far below the elements' error.
  Eigen::Vector3d force(const Stress& stress, const Eigen::Vector3d& x) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    const double h = 1e-4;
    for (int j = 0; j < 3; ++j) {
      Eigen::Vector3d up = x, down = x;
      up[j] += h;
      down[j] -= h;
      sum -= (stress(gradient(up)) - stress(gradient(down))).col(j) / (2.0 * h);
    }
    return sum;
  }
};

struct Error {
  double l2 = 0.0, energy = 0.0;
};

Error error_of(const std::string& model, const Stress& stress, double amplitude, int blocks) {
  const Field field{amplitude};
  tests::BarOptions options;
  options.box = {{0, 0, 0}, {1, 1, 1}, {blocks, blocks, blocks}, lattice::CellType::Hexahedron, {}};
  options.material = {kYoung, kPoisson, 1000.0};
  options.held = [](const Eigen::Vector3d& x) {
    return (x.array() < 1e-9).any() || (x.array() > 1.0 - 1e-9).any();
  };
  Body body = tests::bar_body(options);
  for (BoneVertex& vertex : body.bones.vertices) {  // the boundary is held where the field puts it
    vertex.x_a += field.u(vertex.x_a);
    vertex.x_b = vertex.x_a;
  }
  Points force = Points::Zero(body.mesh.num_vertices(), 3);
  const auto each_gauss_point = [&](const auto& action) {
    for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
      const lattice::HexCorners corners = lattice::hex_corners(body.mesh.points, body.mesh.cells[c]);
      const CellGeometry geometry = cell_geometry(corners, body.fill[c]);
      for (int q = 0; q < 8; ++q) {
        const lattice::HexWeights phi = lattice::trilinear_weights(gauss_point(q));
        action(body.mesh.cells[c], geometry, static_cast<std::size_t>(q), phi,
               Eigen::Vector3d(corners.transpose() * phi));
      }
    }
  };
  each_gauss_point([&](const lattice::HexVertices& cell, const CellGeometry& g, std::size_t q,
                       const lattice::HexWeights& phi, const Eigen::Vector3d& x) {
    const Eigen::Vector3d f = g.weights[q] * field.force(stress, x);
    for (int a = 0; a < 8; ++a) force.row(cell[static_cast<std::size_t>(a)]) += phi[a] * f.transpose();
  });
  const PosedFrames pose = pose_frames(body.tree, {Eigen::Affine3d::Identity()}, 0.0);
  Points x = body.mesh.points;
  const std::unique_ptr<Model> instance = find_model(model)->make(body, {});
  const SolveReport report = instance->equilibrate({&pose, {0, 0, 0}, &force}, x);
  EXPECT_TRUE(report.ok()) << model << ": " << report.message;
  Error error;
  each_gauss_point([&](const lattice::HexVertices& cell, const CellGeometry& g, std::size_t q,
                       const lattice::HexWeights& phi, const Eigen::Vector3d& at) {
    CellPoints corners;
    for (int a = 0; a < 8; ++a) corners.col(a) = x.row(cell[static_cast<std::size_t>(a)]).transpose();
    const Eigen::Vector3d e = corners * phi - at - field.u(at);
    error.l2 += g.weights[q] * e.squaredNorm();
  });
  // At Gauss points gradients of linear elements are of second order; at corners they show their own.
  for (const auto& cell : body.mesh.cells) {
    const lattice::HexCorners corners = lattice::hex_corners(body.mesh.points, cell),
                              posed = lattice::hex_corners(x, cell);
    for (int k = 0; k < 8; ++k) {
      Eigen::Vector3d xi;
      for (int c = 0; c < 3; ++c)
        xi[c] = lattice::kCorners[static_cast<std::size_t>(k)][static_cast<std::size_t>(c)];
      const Eigen::Matrix3d jacobian = lattice::trilinear_jacobian(corners, xi);
      const Eigen::Matrix3d slope = lattice::trilinear_jacobian(posed, xi) * jacobian.inverse() -
                                    field.gradient(corners.row(k).transpose());
      const Eigen::Matrix3d strain = 0.5 * (slope + slope.transpose());
      error.energy +=
          jacobian.determinant() / 8.0 *
          (2.0 * kMu * strain.squaredNorm() + (kBulk - 2.0 / 3.0 * kMu) * strain.trace() * strain.trace());
    }
  }
  return {std::sqrt(error.l2), std::sqrt(error.energy)};
}

/// Orders from cells of 1/4 to cells of 1/8.
void expect_orders(const std::string& model, const Stress& stress, double amplitude) {
  const Error coarse = error_of(model, stress, amplitude, 2), fine = error_of(model, stress, amplitude, 4);
  const double l2 = std::log2(coarse.l2 / fine.l2), energy = std::log2(coarse.energy / fine.energy);
  EXPECT_GT(l2, 1.9) << model;
  EXPECT_LT(l2, 2.3) << model;
  EXPECT_GT(energy, 0.9) << model;
  EXPECT_LT(energy, 1.3) << model;
}

// Linear elements: displacements of second order, energies of first.
TEST(ManufacturedSolutions, ConvergeAtTheOrderOfLinearElementsAtFiniteStrain) {
  expect_orders("stvk", stvk_stress, 0.1);
  expect_orders("neo-hookean", neo_hookean_stress, 0.1);
}

// So small that every law is the linear one.
TEST(ManufacturedSolutions, ConvergeAtTheOrderOfLinearElementsAtSmallStrain) {
  for (const std::string model : {"blended-stiffness", "corotational", "stvk", "neo-hookean"})
    expect_orders(model, stvk_stress, 1e-6);
}

}  // namespace
}  // namespace sinew::fem
