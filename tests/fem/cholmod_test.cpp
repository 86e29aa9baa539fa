// What the solver library below sinew::fem must be: CHOLMOD with METIS on a BLAS of one thread, whatever BLAS
// the machine's alternatives name.

#include <fstream>
#include <string>
#include <vector>

#include <Eigen/SparseCore>
#include <cholmod.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "fem/linear/factor.h"
#include "fem/linear/repeated_factor.h"

extern "C" {
char* openblas_get_config();
int openblas_get_parallel();  // 0: compiled without threads
}

namespace sinew {
namespace {

TEST(CholmodLibrary, RunsOnSerialOpenBlas) {
  RecordProperty("openblas", openblas_get_config());
  EXPECT_EQ(openblas_get_parallel(), 0) << openblas_get_config();
}

TEST(CholmodLibrary, LoadsNoSharedBlasThatTheMachineCouldExchange) {
  std::ifstream maps("/proc/self/maps");
  ASSERT_TRUE(maps) << "/proc is needed to see which libraries are loaded";
  std::string line;
  int num_metis = 0;
  while (std::getline(maps, line)) {
    const std::string file = line.substr(line.rfind('/') + 1);
    EXPECT_EQ(file.find("blas"), std::string::npos) << line;
    EXPECT_EQ(file.find("lapack"), std::string::npos) << line;
    if (file.find("libmetis") != std::string::npos) ++num_metis;
  }
  EXPECT_GT(num_metis, 0) << "the listing does not show shared libraries at all";
}

// The matrix of second differences with fixed ends, n = 400: tridiagonal (-1, 2, -1); the solution of A x = 1
// is x_i = (i + 1)(n - i) / 2, as the second difference of that parabola is -1 and it vanishes at i = -1 and
// i = n.
TEST(CholmodLibrary, SolvesSecondDifferencesSupernodallyInMetisOrder) {
  constexpr int kSize = 400;
  cholmod_common common;
  cholmod_start(&common);
  common.supernodal = CHOLMOD_SUPERNODAL;
  common.nmethods = 1;
  common.method[0].ordering = CHOLMOD_METIS;

  cholmod_triplet* triplets = cholmod_allocate_triplet(kSize, kSize, 2 * kSize, 1, CHOLMOD_REAL, &common);
  auto add = [&](int row, int column, double value) {
    static_cast<int*>(triplets->i)[triplets->nnz] = row;
    static_cast<int*>(triplets->j)[triplets->nnz] = column;
    static_cast<double*>(triplets->x)[triplets->nnz++] = value;
  };
  for (int i = 0; i < kSize; ++i) {
    add(i, i, 2.0);
    if (i + 1 < kSize) add(i, i + 1, -1.0);
  }
  cholmod_sparse* matrix = cholmod_triplet_to_sparse(triplets, triplets->nnz, &common);
  cholmod_factor* factor = cholmod_analyze(matrix, &common);
  ASSERT_NE(factor, nullptr);
  EXPECT_EQ(factor->ordering, CHOLMOD_METIS);
  EXPECT_NE(factor->is_super, 0);
  ASSERT_NE(cholmod_factorize(matrix, factor, &common), 0);
  EXPECT_EQ(common.status, CHOLMOD_OK);

  cholmod_dense* ones = cholmod_ones(kSize, 1, CHOLMOD_REAL, &common);
  cholmod_dense* x = cholmod_solve(CHOLMOD_A, factor, ones, &common);
  ASSERT_NE(x, nullptr);
  // Backward stable, so the relative error is at most a few eps times the condition number 4 (n+1)^2 / pi^2 =
  // 6.5e4, that is about 1e-10 of the largest value, n^2 / 8.
  const double tolerance = 1e-10 * kSize * kSize / 8.0;
  for (int i = 0; i < kSize; ++i) {
    EXPECT_NEAR(static_cast<double*>(x->x)[i], 0.5 * (i + 1) * (kSize - i), tolerance) << "row " << i;
  }
  cholmod_free_dense(&x, &common);
  cholmod_free_dense(&ones, &common);
  cholmod_free_factor(&factor, &common);
  cholmod_free_sparse(&matrix, &common);
  cholmod_free_triplet(&triplets, &common);
  cholmod_finish(&common);
}

/// (n^3 unknowns) Seven-point Laplacian plus the identity on a grid of n x n x n points.
Eigen::SparseMatrix<double> grid_matrix(int n) {
  std::vector<Eigen::Triplet<double>> entries;
  const auto index = [n](int x, int y, int z) { return (x * n + y) * n + z; };
  const auto couple = [&](int a, int b) {
    entries.emplace_back(a, b, -1.0);
    entries.emplace_back(b, a, -1.0);
  };
  for (int x = 0; x < n; ++x) {
    for (int y = 0; y < n; ++y) {
      for (int z = 0; z < n; ++z) {
        entries.emplace_back(index(x, y, z), index(x, y, z), 7.0);
        if (x + 1 < n) couple(index(x, y, z), index(x + 1, y, z));
        if (y + 1 < n) couple(index(x, y, z), index(x, y + 1, z));
        if (z + 1 < n) couple(index(x, y, z), index(x, y, z + 1));
      }
    }
  }
  Eigen::SparseMatrix<double> matrix(n * n * n, n * n * n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

/// Factors and solves with a right side of ones.
Eigen::VectorXd solve_ones(const Eigen::SparseMatrix<double>& matrix) {
  fem::Factor factor;
  const auto report = factor.factorise(matrix);
  EXPECT_TRUE(report.ok) << report.message;
  Eigen::VectorXd x = Eigen::VectorXd::Ones(matrix.rows());
  Eigen::VectorXd workspace;
  factor.solve(x, workspace);
  return x;
}

Eigen::VectorXd solve_ones_repeatedly(const Eigen::SparseMatrix<double>& matrix) {
  fem::RepeatedFactor factor;
  const auto report = factor.factorise(Eigen::SparseMatrix<double>(matrix.triangularView<Eigen::Lower>()));
  EXPECT_TRUE(report.ok) << report.message;
  Eigen::VectorXd x = Eigen::VectorXd::Ones(matrix.rows());
  factor.solve(x);
  return x;
}

// Rounding times the condition of this matrix, below 30, and no better than the precision asked for.
TEST(RepeatedFactor, SolvesToTheAccuracyOfItsPanels) {
  struct Case {
    fem::Precision precision;
    double rounding;
  };
  for (const Case& c : {Case{fem::Precision::Double, 1.1e-16},
                        {fem::Precision::Float, 6e-8},
                        {fem::Precision::Short, 1.5e-5}}) {
    Eigen::SparseMatrix<double> matrix = grid_matrix(12);
    fem::RepeatedFactor factor(c.precision);
    for (double scale : {1.0, 1e-90}) {  // a pattern again, with numbers beyond floats
      matrix *= scale;
      ASSERT_TRUE(factor.factorise(Eigen::SparseMatrix<double>(matrix.triangularView<Eigen::Lower>())).ok);
      Eigen::VectorXd x = Eigen::VectorXd::Ones(matrix.rows());
      factor.solve(x);
      const double left =
          (matrix * x - Eigen::VectorXd::Ones(matrix.rows())).norm() / std::sqrt(matrix.rows());
      EXPECT_LE(left, 30.0 * c.rounding);
      EXPECT_GE(left, 0.01 * c.rounding);
    }
  }
}

// METIS draws its random numbers from the C library's one generator, which threads that order at the same
// time would share. Several matrices of several sizes, as regions are, and both kinds of factor side by side;
// many rounds, as the clash is a matter of chance.
TEST(FactorsInParallel, HaveTheSameBitsAsOneAfterTheOther) {
  std::vector<Eigen::SparseMatrix<double>> matrices;
  for (int i = 0; i < 8; ++i) matrices.push_back(grid_matrix(9 + i % 4));
  const auto solve = [&](std::size_t i) {
    return i % 3 == 0 ? solve_ones_repeatedly(matrices[i]) : solve_ones(matrices[i]);
  };
  std::vector<Eigen::VectorXd> expected;
  for (std::size_t i = 0; i < matrices.size(); ++i) expected.push_back(solve(i));
  for (int round = 0; round < 10; ++round) {
    std::vector<Eigen::VectorXd> solutions(matrices.size());
    tbb::task_arena(4).execute([&] {
      tbb::parallel_for(std::size_t{0}, matrices.size(), [&](std::size_t i) { solutions[i] = solve(i); });
    });
    for (std::size_t i = 0; i < matrices.size(); ++i) {
      EXPECT_TRUE(solutions[i] == expected[i]) << "matrix " << i << ", round " << round << ", difference "
                                               << (solutions[i] - expected[i]).cwiseAbs().maxCoeff();
    }
  }
}

int num_threads_of_process() {
  std::ifstream status("/proc/self/status");
  std::string word;
  int threads = -1;
  while (status >> word) {
    if (word == "Threads:") status >> threads;
  }
  return threads;
}

TEST(Factor, StartsNoThreadsOfItsOwn) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism,
                                1);  // large solves share theirs
  const int before = num_threads_of_process();
  ASSERT_GT(before, 0);
  solve_ones(grid_matrix(20));  // supernodes of several hundred rows, where CHOLMOD's loops become parallel
  EXPECT_EQ(num_threads_of_process(), before);
}

}  // namespace
}  // namespace sinew
