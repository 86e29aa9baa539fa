#include "fem/linear/factor.h"

#include <cstdint>
#include <vector>

#include <Eigen/Dense>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/fem/bar.h"
#include "tests/lattice/shapes.h"

namespace sinew::fem {
namespace {

Eigen::SparseMatrix<double> bar_stiffness() {
  tests::BarOptions options;
  options.levels = 1;
  return tests::free_system(tests::bar_body(options)).stiffness;
}

Eigen::VectorXd random_vector(Eigen::Index n, std::uint64_t seed) {
  std::mt19937_64 rng(seed);
  Eigen::VectorXd x(n);
  for (double& value : x) value = tests::uniform(rng, -1.0, 1.0);
  return x;
}

TEST(Factor, SolvesLikeADenseCholesky) {
  const Eigen::SparseMatrix<double> a = bar_stiffness();
  Factor factor;
  ASSERT_TRUE(factor.factorise(a).ok);
  EXPECT_EQ(factor.size(), a.rows());
  const Eigen::VectorXd b = random_vector(a.rows(), 1);
  Eigen::VectorXd x = b, workspace;
  factor.solve(x, workspace);
  const Eigen::VectorXd expected = Eigen::MatrixXd(a).llt().solve(b);
  // Relative error of a Cholesky solve: eps times the condition, below 1e6 for this bar.
  EXPECT_LE((x - expected).norm(), 1e6 * 2.3e-16 * expected.norm());
}

TEST(Factor, InFloatKeepsSixDigitsOfAScaledRightHandSide) {
  const Eigen::SparseMatrix<double> a = bar_stiffness();
  // As in a time step: mass dominates, the condition after scaling is small. M = I stands for it.
  Eigen::SparseMatrix<double> identity(a.rows(), a.cols());
  identity.setIdentity();
  const Eigen::SparseMatrix<double> step = a + 1e4 * identity;
  Factor exact, rounded;
  ASSERT_TRUE(exact.factorise(step).ok);
  ASSERT_TRUE(rounded.factorise(step, Precision::Float).ok);
  for (double size : {1.0, 1e-45, 1e45}) {  // beyond float's range on both sides
    const Eigen::VectorXd b = size * random_vector(a.rows(), 2);
    Eigen::VectorXd x = b, y = b, workspace;
    exact.solve(x, workspace);
    rounded.solve(y, workspace);
    EXPECT_LE((x - y).norm(), 3e-6 * x.norm()) << size;  // float's 6e-8 times a condition below 50
    EXPECT_GT((x - y).norm(), 0.0);
  }
}

// The matrix of a stiff step, mass a hundredth of stiffness: sixteen bits are 1.5e-5 of a column.
TEST(Factor, InShortKeepsThreeDigits) {
  const Eigen::SparseMatrix<double> a = bar_stiffness();
  Eigen::SparseMatrix<double> identity(a.rows(), a.cols());
  identity.setIdentity();
  const Eigen::SparseMatrix<double> step = a + 0.01 * a.diagonal().maxCoeff() * identity;
  Factor exact, rounded;
  ASSERT_TRUE(exact.factorise(step).ok);
  ASSERT_TRUE(rounded.factorise(step, Precision::Short).ok);
  for (double size : {1.0, 1e-45, 1e45}) {
    const Eigen::VectorXd b = size * random_vector(a.rows(), 2);
    Eigen::VectorXd x = b, y = b, workspace;
    exact.solve(x, workspace);
    rounded.solve(y, workspace);
    EXPECT_LE((x - y).norm(), 1e-3 * x.norm()) << size;
    EXPECT_GT((x - y).norm(), 1e-6 * x.norm()) << size;
  }
}

// Rows scaled by 1e-8 are what nearly empty cells give.
TEST(Factor, ScalesRowsOfVeryDifferentSize) {
  Eigen::SparseMatrix<double> a = bar_stiffness();
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(a.rows());
  for (Eigen::Index i = 0; i < scale.size(); i += 3) scale[i] = 1e-4;
  const Eigen::VectorXd b = random_vector(a.rows(), 3);
  Factor plain, scaled;
  ASSERT_TRUE(plain.factorise(a).ok);
  const Eigen::SparseMatrix<double> squeezed = scale.asDiagonal() * a * scale.asDiagonal();
  ASSERT_TRUE(scaled.factorise(squeezed, Precision::Float).ok);
  Eigen::VectorXd x = b, y = scale.asDiagonal() * b, workspace;
  plain.solve(x, workspace);
  scaled.solve(y, workspace);
  y = scale.asDiagonal() * y;
  // Float's 6e-8 times the bar's condition, which scaling restores from 1e14 to below 1e6.
  EXPECT_LE((x - y).norm(), 0.02 * x.norm());
}

TEST(Factor, ReportsWhereAMatrixIsNotPositiveDefinite) {
  Eigen::SparseMatrix<double> a(3, 3);
  a.insert(0, 0) = 1.0;
  a.insert(1, 1) = 1.0;
  a.insert(2, 2) = 1.0;
  a.insert(2, 1) = 2.0;  // rows 1 and 2: [1 2; 2 1] has eigenvalue -1
  Factor factor;
  const Factor::Report indefinite = factor.factorise(a);
  EXPECT_FALSE(indefinite.ok);
  EXPECT_THAT(indefinite.message, testing::HasSubstr("not positive definite at row"));
  EXPECT_TRUE(indefinite.pivot == 1 || indefinite.pivot == 2);
  a.coeffRef(0, 0) = -1.0;
  const Factor::Report negative = factor.factorise(a);
  EXPECT_FALSE(negative.ok);
  EXPECT_EQ(negative.pivot, 0);
  EXPECT_EQ(negative.message, "the diagonal of row 0 is not positive");
}

// The rows that nobody wants cost no sweep back; the others have the very bits of the full solve.
TEST(Factor, GivesWantedRowsTheBitsOfTheFullSolve) {
  const Eigen::SparseMatrix<double> a = bar_stiffness();
  std::vector<std::uint8_t> wanted(static_cast<std::size_t>(a.rows()), 0);
  for (std::size_t i = 0; i < wanted.size() / 4; ++i) wanted[i] = 1;
  for (Precision precision : {Precision::Double, Precision::Float, Precision::Short}) {
    Factor all, some;
    ASSERT_TRUE(all.factorise(a, precision).ok);
    ASSERT_TRUE(some.factorise(a, precision, wanted).ok);
    EXPECT_EQ(all.num_read(), 2 * all.num_nonzeros());
    EXPECT_LT(some.num_read(), all.num_read());
    const Eigen::VectorXd b = random_vector(a.rows(), 4);
    Eigen::VectorXd x = b, y = b, workspace;
    all.solve(x, workspace);
    some.solve(y, workspace);
    EXPECT_TRUE(y.allFinite());
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      if (wanted[i]) {
        EXPECT_EQ(x[row], y[row]) << i;
      }
    }
  }
}

}  // namespace
}  // namespace sinew::fem
