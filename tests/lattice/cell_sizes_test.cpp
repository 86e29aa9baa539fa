// Cells of other sizes where the user wants them.
#include "lattice/detail/cell_sizes.h"

#include <algorithm>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lattice/detail/rig_input.h"
#include "tests/lattice/limbs.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

/// A thick limb along y of three joints, each with a third of the skin, weights blended over a tenth of it.
tests::Character trunk() {
  tests::Character c;
  c.add_joint("low", -1, {0, 0.1, 0});
  c.add_joint("middle", 0, {0, 0.7, 0});
  c.add_joint("high", 1, {0, 1.4, 0.02});
  c.skin = tests::blob({0, 1, 0}, 32, 24, [](const Vector3d& d) {
    return 1.0 / std::sqrt(d.y() * d.y() + (d.x() * d.x() + d.z() * d.z()) / (0.4 * 0.4));
  });
  for (Eigen::Index v = 0; v < c.skin.points.rows(); ++v) {
    const double y = c.skin.points(v, 1);
    const double above_low = std::clamp((y - 0.6) / 0.2, 0.0, 1.0);
    const double above_middle = std::clamp((y - 1.3) / 0.2, 0.0, 1.0);
    c.skin.weights.push_back({{0, 1.0 - above_low}, {1, above_low - above_middle}, {2, above_middle}});
  }
  return c;
}

/// Median over the cells with their middle at low < y < high of the edge of a regular tetrahedron of their
/// volume [m].
double median_edge(const CellComplex& complex, double low, double high) {
  std::vector<double> edges;
  for (const Cell& cell : complex.cells) {
    double y = 0.0;
    for (int k = 0; k < 4; ++k) y += 0.25 * complex.points(cell.vertices[k], 1);
    if (y > low && y < high) edges.push_back(std::cbrt(6.0 * std::sqrt(2.0) * cell_volume(complex, cell)));
  }
  EXPECT_GE(edges.size(), 10u);
  std::nth_element(edges.begin(), edges.begin() + static_cast<std::ptrdiff_t>(edges.size() / 2), edges.end());
  return edges[edges.size() / 2];
}

void expect_same_bits(const ControlLattice& a, const ControlLattice& b) {
  EXPECT_EQ(a.complex.points, b.complex.points);
  ASSERT_EQ(a.complex.cells.size(), b.complex.cells.size());
  for (std::size_t c = 0; c < a.complex.cells.size(); ++c)
    EXPECT_EQ(a.complex.cells[c].vertices, b.complex.cells[c].vertices);
}

TEST(CellSizes, AreTheFactorsInTheFleshAndGrowSlowlyAwayFromIt) {
  const tests::Character c = trunk();
  const detail::RigInput input =
      detail::make_rig_input(c.skin, c.joints, {.size_factors = {{1, 0.5}, {2, 2.0}}});
  const double h = 0.06;
  const auto at = [&](double x, double y, double z) {
    return input.sizes.edge_at(input.unit_skin.to_unit({x, y, z}), h);
  };
  EXPECT_NEAR(at(0, 1.05, 0.01), 0.5 * h, 1e-12) << "on the bone";
  EXPECT_NEAR(at(0.4, 1.0, 0), 0.5 * h, 0.1 * h) << "on the skin";
  EXPECT_NEAR(at(0.2, 1.0, 0), 0.5 * h, 0.1 * h) << "between";
  EXPECT_DOUBLE_EQ(at(0, 0.1, 0), h) << "flesh of a joint that nobody named";
  EXPECT_NEAR(at(0, 1.95, 0), 2.0 * h, 0.1 * h) << "the far end of the coarse flesh";
  std::mt19937_64 rng(20021);
  for (int i = 0; i < 2000; ++i) {
    const Vector3d p = tests::uniform_point(rng, -0.6, 0.6), q = p + 0.1 * tests::uniform_point(rng, -1, 1);
    const double a = input.sizes.edge_at(p, h), b = input.sizes.edge_at(q, h);
    EXPECT_GE(a, 0.5 * h);
    EXPECT_LE(a, 2.0 * h);
    // Distances are rounded to 1e-16.
    EXPECT_LE(std::abs(a - b), detail::CellSizes::kGrowth * (p - q).norm() + 1e-14);
  }
}

TEST(CellSizes, MakeCellsFinerWhereTheUserWantsThem) {
  const tests::Character c = trunk();
  const auto built = [&](double factor) {
    const BuildResult result =
        build(c.skin, c.joints, {.cells = 2400, .size_factors = {{1, factor}}, .symmetry = Symmetry::Off});
    EXPECT_THAT(result.failures, testing::IsEmpty());
    EXPECT_NO_THROW(validate(result.lattice));
    EXPECT_NEAR(static_cast<double>(result.lattice.complex.cells.size()), 2400, 0.12 * 2400);
    return result.lattice;
  };
  const auto ratio = [&](double factor) {
    const CellComplex complex = built(factor).complex;
    return median_edge(complex, 0.9, 1.2) / median_edge(complex, 0.0, 0.35);
  };
  // Towards its ends the flesh is neither, as edges grow by no more than 0.35 per length.
  EXPECT_NEAR(ratio(0.5), 0.5, 0.12);
  EXPECT_GT(ratio(2.0), 1.4);
}

TEST(CellSizes, MeasureTheCellSizeWhereTheFactorIsOne) {
  const tests::Character c = trunk();
  const ControlLattice lattice =
      build(c.skin, c.joints, {.cell_size = 0.18, .size_factors = {{1, 0.5}}, .symmetry = Symmetry::Off})
          .lattice;
  const double plain = median_edge(
      build(c.skin, c.joints, {.cell_size = 0.18, .symmetry = Symmetry::Off}).lattice.complex, 0.0, 0.35);
  EXPECT_NEAR(median_edge(lattice.complex, 0.0, 0.35), plain, 0.15 * plain);
  EXPECT_LT(lattice.edge_length, 0.18) << "the mean of fine and plain cells";
  EXPECT_GT(lattice.edge_length, 0.09);
}

TEST(CellSizes, ChangeNothingWithFactorsOfOne) {
  const tests::Character c = trunk();
  expect_same_bits(build(c.skin, c.joints, {.cells = 300}).lattice,
                   build(c.skin, c.joints, {.cells = 300, .size_factors = {{0, 1.0}, {2, 1.0}}}).lattice);
}

TEST(CellSizes, AreIdleAtJointsWithoutSkinAndInAGrid) {
  tests::Character c = trunk();
  const int bare = c.add_joint("bare", 1, {0, 1.0, 0.1});
  BuildOptions options{.cells = 300, .size_factors = {{bare, 0.5}, {1, 0.5}, {2, 0.5}}};
  const BuildResult sized = build(c.skin, c.joints, options);
  EXPECT_EQ(sized.idle_sizes, std::vector<int>{bare});
  options.size_factors = {{1, 0.5}, {2, 0.5}};
  const BuildResult without = build(c.skin, c.joints, options);
  EXPECT_THAT(without.idle_sizes, testing::IsEmpty());
  expect_same_bits(sized.lattice, without.lattice);
  options.exclude = {2};
  EXPECT_EQ(build(c.skin, c.joints, options).idle_sizes, std::vector<int>{2}) << "its skin hangs on another";
  options.exclude = {};
  options.construction = Construction::Grid;
  EXPECT_EQ(build(c.skin, c.joints, options).idle_sizes, (std::vector<int>{1, 2})) << "all cubes are alike";
}

TEST(CellSizes, DependOnNeitherUnitsNorTheOrderOfTriangles) {
  const tests::Character c = trunk();
  const BuildOptions options{.cells = 300, .size_factors = {{1, 0.5}}};
  const ControlLattice lattice = build(c.skin, c.joints, options).lattice;
  tests::Character other = c;
  other.skin.points *= 64.0;
  other.joints.positions *= 64.0;
  ControlLattice scaled = build(other.skin, other.joints, options).lattice;
  scaled.complex.points /= 64.0;
  expect_same_bits(lattice, scaled);
  other = c;
  other.skin.triangles = c.skin.triangles.colwise().reverse().eval();
  expect_same_bits(lattice, build(other.skin, other.joints, options).lattice);
}

TEST(CellSizes, KeepTheMirrorWhereBothSidesHaveTheSame) {
  const tests::Character legs = tests::two_legs();
  const int left = 2, right = 5;  // knees
  ASSERT_EQ(legs.joints.names[left], "left_knee");
  ASSERT_EQ(legs.joints.names[right], "right_knee");
  const BuildResult both =
      build(legs.skin, legs.joints, {.cells = 400, .size_factors = {{left, 0.5}, {right, 0.5}}});
  EXPECT_THAT(both.failures, testing::IsEmpty());
  ASSERT_TRUE(both.mirror) << both.no_mirror;
  const Points& points = both.lattice.complex.points;
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    const Eigen::RowVector3d image(-points(v, 0), points(v, 1), points(v, 2));
    EXPECT_LT((points.rowwise() - image).rowwise().norm().minCoeff(), 1e-9 * 2.0);
  }
  const BuildResult one = build(legs.skin, legs.joints, {.cells = 400, .size_factors = {{left, 0.5}}});
  EXPECT_THAT(one.failures, testing::IsEmpty());
  EXPECT_FALSE(one.mirror);
  EXPECT_EQ(one.no_mirror, "cells are sized by 0.5 at 'left_knee' and by 1 at its mirror image 'right_knee'");
}

TEST(CellSizes, AreLargerOnRequestWhereTheSkinFollowsOneJoint) {
  const tests::Character c = trunk();
  const BuildOptions options{.cells = 1500, .coarsen_rigid = CoarsenRigid::On, .symmetry = Symmetry::Off};
  const BuildResult result = build(c.skin, c.joints, options);
  EXPECT_THAT(result.failures, testing::IsEmpty());
  // Blended from 0.6 to 0.8 and from 1.3 to 1.5; the ends of the trunk are stiff.
  const double blended = median_edge(result.lattice.complex, 0.6, 0.8),
               stiff = median_edge(result.lattice.complex, 1.75, 2.0);
  EXPECT_GT(stiff, 1.3 * blended);
  const ControlLattice plain = build(c.skin, c.joints, {.cells = 1500, .symmetry = Symmetry::Off}).lattice;
  EXPECT_LT(blended, median_edge(plain.complex, 0.6, 0.8)) << "the cells saved serve elsewhere";
}

}  // namespace
}  // namespace sinew::lattice
