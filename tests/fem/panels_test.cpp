#include "fem/linear/detail/panels.h"

#include <random>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "tests/lattice/shapes.h"

namespace sinew::fem::detail {
namespace {

/// A factor of three leaves under one root: rows 0-6, 7-9 and 10 hang on rows 11-25. The leaf of seven
/// columns needs a block of six and one of one; the root has 15. Rows below: no multiple of the lanes.
struct ThreeLeaves {
  static constexpr int kSize = 26;
  Eigen::MatrixXd l = Eigen::MatrixXd::Zero(kSize, kSize);
  std::vector<std::vector<int>> rows;
  std::vector<Eigen::MatrixXd> values;
  std::vector<Supernode> supernodes;

  explicit ThreeLeaves(std::mt19937_64& rng) {
    add(rng, 0, 7, {11, 12, 15, 20, 25});
    add(rng, 7, 3, {12, 13, 14, 15, 16, 17, 18, 19, 21, 22, 24});
    add(rng, 10, 1, {25});
    add(rng, 11, 15, {});
    for (std::size_t k = 0; k < supernodes.size(); ++k) {
      supernodes[k].values = values[k].data();
      supernodes[k].row_indices = rows[k].data();
    }
  }
  void add(std::mt19937_64& rng, int first, int columns, const std::vector<int>& below) {
    std::vector<int> all;
    for (int j = 0; j < columns; ++j) all.push_back(first + j);
    all.insert(all.end(), below.begin(), below.end());
    Eigen::MatrixXd panel(static_cast<int>(all.size()), columns);
    for (int j = 0; j < columns; ++j) {
      for (int i = 0; i < panel.rows(); ++i) {
        // What stands above the triangle is never read.
        panel(i, j) = i < j    ? std::numeric_limits<double>::quiet_NaN()
                      : i == j ? tests::uniform(rng, 1.0, 2.0)
                               : tests::uniform(rng, -0.3, 0.3);
        if (i >= j) l(all[static_cast<std::size_t>(i)], first + j) = panel(i, j);
      }
    }
    supernodes.push_back({first, columns, static_cast<int>(all.size()), nullptr, nullptr, true});
    rows.push_back(std::move(all));
    values.push_back(std::move(panel));
  }
};

template <class Stored>
auto solved(const Panels<Stored>& panels, const Eigen::VectorXd& b, Code code) {
  using Scalar = typename Panels<Stored>::Scalar;
  std::vector<Scalar> x(b.begin(), b.end()), work(static_cast<std::size_t>(panels.work_size()));
  panels.solve(x.data(), work.data(), code);
  return x;
}

TEST(Panels, SolveLikeDenseTriangles) {
  std::mt19937_64 rng(11);
  const ThreeLeaves leaves(rng);
  const Panels<double> panels(ThreeLeaves::kSize, leaves.supernodes);
  const Eigen::VectorXd b = Eigen::VectorXd::NullaryExpr(
      ThreeLeaves::kSize, [&](Eigen::Index) { return tests::uniform(rng, -1.0, 1.0); });
  const Eigen::VectorXd expected = (leaves.l * leaves.l.transpose()).lu().solve(b);
  const std::vector<double> x = solved(panels, b, Code::Portable);
  // eps times the condition of L L^T, below 1e3 for these entries.
  for (int i = 0; i < ThreeLeaves::kSize; ++i)
    EXPECT_NEAR(x[static_cast<std::size_t>(i)], expected[i], 1e-12);
}

// Divided, the leaves are solved side by side; the root, which all of them hang on, after and before them.
TEST(Panels, SolveLikeDenseTrianglesWhereTheyAreDivided) {
  std::mt19937_64 rng(14);
  const ThreeLeaves leaves(rng);
  const Panels<double> panels(ThreeLeaves::kSize, leaves.supernodes, 0);
  EXPECT_GE(panels.num_parts(), 2);
  for (int n = 0; n < 20; ++n) {
    const Eigen::VectorXd b = Eigen::VectorXd::NullaryExpr(
        ThreeLeaves::kSize, [&](Eigen::Index) { return tests::uniform(rng, -1.0, 1.0); });
    const Eigen::VectorXd expected = (leaves.l * leaves.l.transpose()).lu().solve(b);
    const std::vector<double> x = solved(panels, b, best_code());
    for (int i = 0; i < ThreeLeaves::kSize; ++i)
      EXPECT_NEAR(x[static_cast<std::size_t>(i)], expected[i], 1e-12);
    EXPECT_EQ(solved(panels, b, Code::Portable), x);
  }
}

// Half a unit of sixteen bits is 4.6e-6 of entries up to 0.3; up to fifteen of them add up in a row, once
// forward and once backward. Exact entries would leave float's 1e-7.
TEST(Panels, OfPairsSolveLikeDenseTrianglesToSixteenBits) {
  std::mt19937_64 rng(15);
  const ThreeLeaves leaves(rng);
  for (std::size_t divide_from : {std::size_t{0}, std::size_t{1} << 18}) {
    const Panels<Pair> panels(ThreeLeaves::kSize, leaves.supernodes, divide_from);
    double largest = 0.0;
    for (int n = 0; n < 20; ++n) {
      const Eigen::VectorXd b = Eigen::VectorXd::NullaryExpr(
          ThreeLeaves::kSize, [&](Eigen::Index) { return tests::uniform(rng, -1.0, 1.0); });
      const Eigen::VectorXd expected = (leaves.l * leaves.l.transpose()).lu().solve(b);
      const std::vector<float> x = solved(panels, b, best_code());
      for (int i = 0; i < ThreeLeaves::kSize; ++i)
        largest =
            std::max(largest, std::abs(static_cast<double>(x[static_cast<std::size_t>(i)]) - expected[i]));
    }
    EXPECT_LT(largest, 5e-5);
    EXPECT_GT(largest, 1e-6);
  }
}

template <class Stored>
void expect_same_bits_from_both_codes() {
  std::mt19937_64 rng(12);
  const ThreeLeaves leaves(rng);
  const Panels<Stored> panels(ThreeLeaves::kSize, leaves.supernodes);
  for (int n = 0; n < 20; ++n) {
    const Eigen::VectorXd b = Eigen::VectorXd::NullaryExpr(
        ThreeLeaves::kSize, [&](Eigen::Index) { return tests::uniform(rng, -1.0, 1.0); });
    EXPECT_EQ(solved(panels, b, Code::Portable), solved(panels, b, best_code()));
  }
}

TEST(Panels, GiveTheSameBitsOnWideAndNarrowRegisters) {
  expect_same_bits_from_both_codes<double>();
  expect_same_bits_from_both_codes<float>();
  expect_same_bits_from_both_codes<Pair>();
}

// With the middle leaf wanted alone, the sweep back visits it and the root: rows 7 to 25.
TEST(Panels, LeaveOutWhatNoWantedRowDependsOn) {
  std::mt19937_64 rng(13);
  ThreeLeaves leaves(rng);
  const Panels<double> all(ThreeLeaves::kSize, leaves.supernodes);
  for (std::size_t k = 0; k < 4; ++k) leaves.supernodes[k].wanted = k == 1;
  const Panels<double> some(ThreeLeaves::kSize, leaves.supernodes);
  EXPECT_EQ(some.num_values(), all.num_values());
  EXPECT_EQ(all.num_values_read(), 2 * all.num_values());
  EXPECT_LT(some.num_values_read(), all.num_values_read());
  const Eigen::VectorXd b = Eigen::VectorXd::Ones(ThreeLeaves::kSize);
  const std::vector<double> full = solved(all, b, best_code()), part = solved(some, b, best_code());
  for (std::size_t i = 0; i < full.size(); ++i) {
    const bool computed = (i >= 7 && i < 10) || i >= 11;
    EXPECT_EQ(full[i] == part[i], computed) << i;
  }
}

}  // namespace
}  // namespace sinew::fem::detail
