#include "fem/models/detail/couples.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/fem/bar.h"
#include "tests/lattice/shapes.h"

namespace sinew::fem::detail {
namespace {

struct Applied {
  lattice::Points expected, portable, best;
};

/// M a + K b + P c for random a, b, c over a bar, by the plain products and by the packed couples.
Applied apply_to_bar() {
  LeafMatrices matrices = tests::bar_body({}).matrices;
  std::mt19937_64 rng(21);
  // The bar has no twist penalty: any numbers do for P.
  for (double& tie : matrices.tie) tie = tests::uniform(rng, 0.0, 1.0);
  const int n = matrices.num_vertices();
  lattice::Points a(n, 3), b(n, 3), c(n, 3);
  std::vector<CoupleInputs> inputs(static_cast<std::size_t>(n));
  for (int v = 0; v < n; ++v) {
    a.row(v) = tests::uniform_point(rng, -1.0, 1.0).transpose();
    b.row(v) = tests::uniform_point(rng, -1.0, 1.0).transpose();
    c.row(v) = tests::uniform_point(rng, -1.0, 1.0).transpose();
    CoupleInputs& in = inputs[static_cast<std::size_t>(v)];
    in.inertia.head<3>() = a.row(v).transpose();
    in.elastic.head<3>() = b.row(v).transpose();
    in.tie.head<3>() = c.row(v).transpose();
  }
  Applied applied;
  applied.expected = apply_mass(matrices, a) + apply_stiffness(matrices, b) + apply_tie(matrices, c);
  applied.portable.resize(n, 3);
  applied.best.resize(n, 3);
  const Couples couples(matrices);
  for (int v = 0; v < n; ++v) {
    const auto first = static_cast<std::size_t>(matrices.row_start[static_cast<std::size_t>(v)]);
    const auto end = static_cast<std::size_t>(matrices.row_start[static_cast<std::size_t>(v) + 1]);
    const std::span<const int> columns(matrices.column.data() + first, end - first);
    applied.portable.row(v) = couples.apply(first, columns, inputs.data(), Code::Portable).transpose();
    applied.best.row(v) = couples.apply(first, columns, inputs.data(), best_code()).transpose();
  }
  return applied;
}

TEST(Couples, ApplyAllThreeMatrices) {
  const Applied applied = apply_to_bar();
  // Sums of some 27 x 5 products, in another order than the plain products take them.
  const double size = applied.expected.cwiseAbs().maxCoeff();
  EXPECT_LE((applied.portable - applied.expected).cwiseAbs().maxCoeff(), 150 * 2.3e-16 * size);
}

TEST(Couples, GiveTheSameBitsOnWideAndNarrowRegisters) {
  const Applied applied = apply_to_bar();
  EXPECT_EQ(applied.portable, applied.best);
}

}  // namespace
}  // namespace sinew::fem::detail
