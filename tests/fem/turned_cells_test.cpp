#include "fem/models/detail/turned_cells.h"

#include <random>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <gtest/gtest.h>

#include "tests/lattice/shapes.h"

namespace sinew::fem::detail {
namespace {

using lattice::Points;
using Rotations = std::vector<Eigen::Matrix3d>;

constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr int kVertices = 30;

Eigen::Matrix3d random_rotation(std::mt19937_64& rng) {
  const Eigen::Vector3d axis = tests::uniform_point(rng, -1.0, 1.0).normalized();
  return Eigen::AngleAxisd(tests::uniform(rng, 0.0, 3.0), axis).toRotationMatrix();
}

Points random_points(std::mt19937_64& rng) {
  Points x(kVertices, 3);
  for (Eigen::Index a = 0; a < x.rows(); ++a) x.row(a) = tests::uniform_point(rng, -1.0, 1.0).transpose();
  return x;
}

/// Cells on any vertices with any symmetric matrices: nothing here asks what they mean.
struct Cells {
  std::vector<lattice::HexVertices> cells;
  std::vector<CellStiffness> stiffness;
  Rotations rotations, past_rotations;
  Points x, past, rest;

  Cells(std::mt19937_64& rng, int count)
      : x(random_points(rng)), past(random_points(rng)), rest(random_points(rng)) {
    for (int c = 0; c < count; ++c) {
      lattice::HexVertices cell;
      for (int& vertex : cell) vertex = static_cast<int>(rng() % kVertices);
      cells.push_back(cell);
      const CellStiffness any = CellStiffness::NullaryExpr([&] { return tests::uniform(rng, -1.0, 1.0); });
      stiffness.push_back(any + any.transpose());
      rotations.push_back(random_rotation(rng));
      past_rotations.push_back(random_rotation(rng));
    }
  }

  TurnedCells turned() const {
    return TurnedCells(CellGroups(cells, kVertices),
                       [&](int c) { return stiffness[static_cast<std::size_t>(c)]; });
  }

  /// R K u with u = 1.3 R^T x - 0.3 R'^T x' - X, corners relative to the first one's.
  CellVector expected(std::size_t c) const {
    CellVector u, force;
    const auto corner = [&](const Points& p, std::size_t k) -> Eigen::Vector3d {
      return (p.row(cells[c][k]) - p.row(cells[c][0])).transpose();
    };
    for (std::size_t k = 0; k < 8; ++k) {
      u.segment<3>(3 * static_cast<Eigen::Index>(k)) = 1.3 * rotations[c].transpose() * corner(x, k) -
                                                       0.3 * past_rotations[c].transpose() * corner(past, k) -
                                                       corner(rest, k);
    }
    const CellVector local = stiffness[c] * u;
    for (int k = 0; k < 8; ++k) force.segment<3>(3 * k) = rotations[c] * local.segment<3>(3 * k);
    return force;
  }

  std::vector<double> forces(Code code) const {
    const std::array<TurnedPlace, 3> places{
        {{1.3, &x, &rotations}, {-0.3, &past, &past_rotations}, {-1.0, &rest}}};
    std::vector<double> result;
    turned().forces(rotations, places, result, code);
    return result;
  }
};

// The last group has one cell, two, three and four.
TEST(TurnedCells, GiveTheForcesOfDenseProducts) {
  std::mt19937_64 rng(31);
  for (int count : {1, 6, 7, 8}) {
    const Cells cells(rng, count);
    const std::vector<double> forces = cells.forces(best_code());
    Points sums = Points::Zero(kVertices, 3);
    for (int c = 0; c < count; ++c) {
      const CellVector expected = cells.expected(static_cast<std::size_t>(c));
      for (int k = 0; k < 8; ++k) {
        // 24 products of numbers up to 2 and 5 each, turned.
        EXPECT_LE((CellGroups::corner(c, k, forces) - expected.segment<3>(3 * k)).norm(),
                  24 * 10 * 10 * kEps);
        sums.row(cells.cells[static_cast<std::size_t>(c)][static_cast<std::size_t>(k)]) +=
            expected.segment<3>(3 * k).transpose();
      }
    }
    const CellGroups groups(cells.cells, kVertices);
    for (int a = 0; a < kVertices; ++a)
      EXPECT_LE((groups.sum_at(a, forces) - sums.row(a).transpose()).norm(), 8 * 24 * 10 * 10 * kEps);
  }
}

TEST(TurnedCells, GiveTheSameBitsOnWideAndNarrowRegisters) {
  std::mt19937_64 rng(32);
  const Cells cells(rng, 11);
  EXPECT_EQ(cells.forces(Code::Portable), cells.forces(best_code()));
}

// What polar forces are the slope of is asked in models_test.cpp.
TEST(TurnedCells, GivePolarForcesOfTheSameBitsOnWideAndNarrowRegisters) {
  std::mt19937_64 rng(36);
  const Cells cells(rng, 11);
  std::vector<lattice::HexGradients> mean(11);
  for (lattice::HexGradients& g : mean)
    g = lattice::HexGradients::NullaryExpr([&] { return tests::uniform(rng, -1.0, 1.0); });
  const TurnedCells turned = cells.turned();
  const std::vector<double> gradients = packed(turned.groups(), mean);
  const std::array<TurnedPlace, 2> places{{{1.3, &cells.x, &cells.rotations}, {-1.0, &cells.rest}}};
  std::vector<double> portable, best;
  std::vector<char> slim_portable, slim_best;
  turned.polar_forces(gradients, places, portable, slim_portable, Code::Portable);
  turned.polar_forces(gradients, places, best, slim_best, best_code());
  EXPECT_EQ(portable, best);
  EXPECT_EQ(slim_portable, slim_best);
}

TEST(TurnedCells, GiveTheirMatricesBack) {
  std::mt19937_64 rng(33);
  const Cells cells(rng, 6);
  const TurnedCells turned = cells.turned();
  for (int c = 0; c < 6; ++c) EXPECT_EQ(turned.stiffness(c), cells.stiffness[static_cast<std::size_t>(c)]);
}

/// R and stretches that turn into R S: sound cells, cells of a hundredth or a hundredfold of their size, and
/// ones that are mirrored or flat, where Newton's iteration does not help.
struct Stretched {
  Rotations matrices, expected;

  explicit Stretched(std::mt19937_64& rng) {
    for (int n = 0; n < 42; ++n) {
      const double size = std::pow(10.0, tests::uniform(rng, -2.0, 2.0));
      Eigen::Vector3d stretch = size * tests::uniform_point(rng, 0.2, 1.5);
      if (n % 7 == 3) stretch[1] = -stretch[1];
      if (n % 7 == 5) stretch[2] *= 1e-7;
      const Eigen::Matrix3d matrix =
          random_rotation(rng) * stretch.asDiagonal() * random_rotation(rng).transpose();
      matrices.push_back(matrix);
      const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
      Eigen::Matrix3d u = svd.matrixU();
      if ((u * svd.matrixV().transpose()).determinant() < 0.0) u.col(2) = -u.col(2);
      expected.push_back(u * svd.matrixV().transpose());
    }
  }
};

TEST(PolarRotations, AreThoseOfTheSingularValueDecomposition) {
  std::mt19937_64 rng(34);
  for (int round = 0; round < 20; ++round) {
    const Stretched stretched(rng);
    Rotations rotations = stretched.matrices;
    polar_rotations(rotations);
    for (std::size_t n = 0; n < rotations.size(); ++n) {
      // Rounding of the matrix, over the sum of the two smallest stretches: 0.2 of the largest 1.5, and of
      // mirrored ones their difference.
      const double tolerance = n % 7 == 3 ? 1e-11 : 1e-13;
      EXPECT_LE((rotations[n] - stretched.expected[n]).cwiseAbs().maxCoeff(), tolerance) << n;
    }
  }
}

TEST(PolarRotations, HaveTheSameBitsOnWideAndNarrowRegisters) {
  std::mt19937_64 rng(35);
  const Stretched stretched(rng);
  Rotations portable = stretched.matrices, best = stretched.matrices;
  polar_rotations(portable, Code::Portable);
  polar_rotations(best, best_code());
  EXPECT_EQ(portable, best);
}

}  // namespace
}  // namespace sinew::fem::detail
