#include "fem/body/cell_matrices.h"

#include <limits>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "tests/lattice/shapes.h"

namespace sinew::fem {
namespace {

using lattice::FillFractions;
using lattice::HexCorners;
using lattice::kCorners;

constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr FillFractions kFull{1, 1, 1, 1, 1, 1, 1, 1};

HexCorners cube(double edge) {
  HexCorners corners;
  for (int k = 0; k < 8; ++k) {
    for (int c = 0; c < 3; ++c)
      corners(k, c) = edge * kCorners[static_cast<std::size_t>(k)][static_cast<std::size_t>(c)];
  }
  return corners;
}

HexCorners distorted_cell(std::mt19937_64& rng) {
  HexCorners corners = cube(1.0);
  for (int k = 0; k < 8; ++k) corners.row(k) += tests::uniform_point(rng, -0.2, 0.2).transpose();
  return corners;
}

// By hand, on a cube of edge h. Each hat is a product of one-dimensional hats, so every integral is a product
// of
//   int phi_i phi_j = h/3 (i = j) or h/6,   int phi_i' phi_j' = 1/h (i = j) or -1/h,   int phi_i' phi_j = s_i
//   / 2,
// with s = -1 for the hat of the lower end and +1 for the upper. For instance, corner 0 against itself:
//   int g_x g_x = 1/h (h/3)^2 = h/9,   int g_x g_y = (s_x/2)(s_y/2) h/3 = h/12,   int G G V = h^3 / (4h)^2 =
//   h/16 K_xx = mu (3/9 + 1/9 - 2/27) h + kappa h/16 = (10/27 mu + kappa/16) h K_xy = mu (1/12 - 1/18) h +
//   kappa h/16      = (1/36 mu + kappa/16) h
TEST(CellStiffness, OfACubeIsThatWorkedOutByHand) {
  const double h = 0.5;
  const Material material{3e4, 0.4, 1000.0};
  const double mu = material.mu(), kappa = material.bulk();
  const CellStiffness k = cell_stiffness(cube(h), kFull, material);
  // Sums over 8 Gauss points of products of about 10 factors, against entries of size mu h.
  const double tolerance = 100 * kEps * kappa * h;
  EXPECT_NEAR(k(0, 0), (10.0 / 27.0 * mu + kappa / 16.0) * h, tolerance);
  EXPECT_NEAR(k(0, 1), (1.0 / 36.0 * mu + kappa / 16.0) * h, tolerance);

  const auto s = [](std::size_t corner, int axis) {
    return kCorners[corner][static_cast<std::size_t>(axis)] ? 1.0 : -1.0;
  };
  for (std::size_t a = 0; a < 8; ++a) {
    for (std::size_t b = 0; b < 8; ++b) {
      // Integral of d_i phi_a d_j phi_b, one factor per axis.
      const auto integral = [&](int i, int j) {
        double product = 1.0;
        for (int axis = 0; axis < 3; ++axis) {
          const double same = s(a, axis) * s(b, axis);  // +1 or -1
          if (axis == i && axis == j)
            product *= same / h;
          else if (axis == i)
            product *= s(a, axis) / 2.0;
          else if (axis == j)
            product *= s(b, axis) / 2.0;
          else
            product *= same > 0 ? h / 3.0 : h / 6.0;
        }
        return product;
      };
      const double laplace = integral(0, 0) + integral(1, 1) + integral(2, 2);
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          // The mean gradient is s / (4 h) on every axis.
          const double volumetric = kappa * s(a, i) * s(b, j) / (16.0 * h * h) * h * h * h;
          const double shear = mu * ((i == j ? laplace : 0.0) + integral(j, i) - 2.0 / 3.0 * integral(i, j));
          EXPECT_NEAR(k(3 * static_cast<int>(a) + i, 3 * static_cast<int>(b) + j), shear + volumetric,
                      tolerance)
              << "corners " << a << ", " << b << ", components " << i << ", " << j;
        }
      }
    }
  }
}

// int phi_a phi_b = (h/3 or h/6) per axis, by the same table.
TEST(CellMass, OfACubeIsThatWorkedOutByHand) {
  const double h = 0.5, density = 1100.0;
  const CellMass m = cell_mass(cube(h), kFull, density);
  for (std::size_t a = 0; a < 8; ++a) {
    for (std::size_t b = 0; b < 8; ++b) {
      double product = density;
      for (std::size_t axis = 0; axis < 3; ++axis)
        product *= kCorners[a][axis] == kCorners[b][axis] ? h / 3 : h / 6;
      EXPECT_NEAR(m(static_cast<int>(a), static_cast<int>(b)), product, 50 * kEps * density * h * h * h);
    }
  }
}

TEST(CellMass, AddsUpToDensityTimesVolumeOfADistortedCell) {
  std::mt19937_64 rng(31);
  for (int i = 0; i < 20; ++i) {
    const HexCorners corners = distorted_cell(rng);
    // The volume by 5 x 5 x 5 midpoint-free rule: Gauss-Legendre with three points per axis, exact far beyond
    // det J's degree 2.
    const std::array<double, 3> at{0.5 - std::sqrt(0.15), 0.5, 0.5 + std::sqrt(0.15)},
        weight{5.0 / 18, 8.0 / 18, 5.0 / 18};
    double volume = 0.0;
    for (std::size_t k = 0; k < 27; ++k) {
      const Eigen::Vector3d xi(at[k % 3], at[k / 3 % 3], at[k / 9]);
      volume += weight[k % 3] * weight[k / 3 % 3] * weight[k / 9] *
                lattice::trilinear_jacobian(corners, xi).determinant();
    }
    EXPECT_NEAR(cell_mass(corners, kFull, 900.0).sum(), 900.0 * volume, 100 * kEps * 900.0 * volume);
  }
}

/// Strain energy by its definition, int mu dev(eps):dev(eps) + kappa/2 (mean tr eps)^2, from posed corners.
double strain_energy(const HexCorners& rest, const HexCorners& u, const FillFractions& fill,
                     const Material& m) {
  const std::array<double, 8> weights = gauss_weights(rest, fill);
  double energy = 0.0, volume = 0.0, trace = 0.0;
  for (int q = 0; q < 8; ++q) {
    const Eigen::Vector3d xi = gauss_point(q);
    const Eigen::Matrix3d gradient =
        lattice::trilinear_jacobian(u, xi) * lattice::trilinear_jacobian(rest, xi).inverse();
    const Eigen::Matrix3d strain = 0.5 * (gradient + gradient.transpose());
    const Eigen::Matrix3d deviator = strain - strain.trace() / 3.0 * Eigen::Matrix3d::Identity();
    const double w = weights[static_cast<std::size_t>(q)];
    energy += w * m.mu() * deviator.squaredNorm();
    trace += w * strain.trace();
    volume += w;
  }
  return energy + 0.5 * m.bulk() * trace * trace / volume;
}

TEST(CellStiffness, IsTheGradientOfTheStrainEnergy) {
  std::mt19937_64 rng(32);
  const Material material{2e4, 0.45, 1000.0};
  for (int i = 0; i < 10; ++i) {
    const HexCorners rest = distorted_cell(rng);
    FillFractions fill;
    for (double& f : fill) f = i == 0 ? 1.0 : tests::uniform(rng, 0.0, 1.0);
    HexCorners u;
    for (int k = 0; k < 8; ++k) u.row(k) = tests::uniform_point(rng, -1.0, 1.0).transpose();
    Eigen::Matrix<double, 24, 1> flat;
    for (int k = 0; k < 8; ++k) flat.segment<3>(3 * k) = u.row(k).transpose();
    const CellStiffness stiffness = cell_stiffness(rest, fill, material);
    const Eigen::Matrix<double, 24, 1> force = stiffness * flat;
    const double energy = strain_energy(rest, u, fill, material);
    EXPECT_NEAR(0.5 * flat.dot(force), energy, 1e3 * kEps * energy);
    // The energy is quadratic: central differences have no truncation error whatever the step, so take it
    // large and keep rounding, eps E / step, small.
    constexpr double kStep = 0.5;
    for (int d = 0; d < 24; ++d) {
      HexCorners plus = u, minus = u;
      plus(d / 3, d % 3) += kStep;
      minus(d / 3, d % 3) -= kStep;
      const double difference =
          (strain_energy(rest, plus, fill, material) - strain_energy(rest, minus, fill, material)) /
          (2.0 * kStep);
      EXPECT_NEAR(difference, force[d], 1e3 * kEps * energy / kStep);
    }
  }
}

TEST(CellStiffness, HasExactlySixModesWithoutEnergy) {
  std::mt19937_64 rng(33);
  const Material material{1e5, 0.45, 1000.0};
  for (int i = 0; i < 10; ++i) {
    const HexCorners corners = distorted_cell(rng);
    const CellStiffness k = cell_stiffness(corners, kFull, material);
    const Eigen::SelfAdjointEigenSolver<CellStiffness> eigen(k);
    const double largest = eigen.eigenvalues()[23];
    for (int m = 0; m < 6; ++m) EXPECT_LE(std::abs(eigen.eigenvalues()[m]), 100 * kEps * largest);
    // The softest of the others is an hourglass-like bending mode; on a cube it is mu h / 6 against 3 kappa h
    // / 2.
    EXPECT_GT(eigen.eigenvalues()[6], 1e-3 * largest);
    // And they are the rigid ones.
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Matrix<double, 24, 2> rigid;
      for (int a = 0; a < 8; ++a) {
        rigid.block<3, 1>(3 * a, 0) = Eigen::Vector3d::Unit(axis);
        rigid.block<3, 1>(3 * a, 1) =
            Eigen::Vector3d::Unit(axis).cross(Eigen::Vector3d(corners.row(a).transpose()));
      }
      EXPECT_LE((k * rigid).cwiseAbs().maxCoeff(), 100 * kEps * largest);
    }
  }
}

TEST(GaussWeights, ScaleWithTheFillOfTheirOctantAndKeepAShareOfTheRest) {
  FillFractions fill = kFull;
  fill[3] = 0.0;
  fill[6] = 0.25;
  const auto weights = gauss_weights(cube(2.0), fill);  // each octant is 1 m^3
  EXPECT_NEAR(weights[0], 1.0, 4 * kEps);
  EXPECT_NEAR(weights[3], kEmptyShare, 4 * kEps);
  EXPECT_NEAR(weights[6], 0.25 + 0.75 * kEmptyShare, 4 * kEps);
}

}  // namespace
}  // namespace sinew::fem
