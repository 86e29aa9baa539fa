// What the solver library below sinew::fem must be: CHOLMOD with METIS on a BLAS of one thread, whatever BLAS
// the machine's alternatives name.

#include <fstream>
#include <string>

#include <cholmod.h>
#include <gtest/gtest.h>

extern "C" {
char* openblas_get_config();
int openblas_get_parallel();  // 0: compiled without threads
}

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

}  // namespace
