#include "lattice/trilinear.h"

#include <gtest/gtest.h>

#include "tests/lattice/lattices.h"

namespace sinew::lattice {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

TEST(TrilinearWeights, SumToOneAndAreOneAtTheirCorner) {
  std::mt19937_64 rng(20021);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d xi = tests::uniform_point(rng, 0.0, 1.0);
    // Each weight is a product of 3 rounded factors and 8 are summed: at most 6 eps to first order.
    EXPECT_NEAR(trilinear_weights(xi).sum(), 1.0, 8 * kEps) << "xi = " << xi.transpose();
    EXPECT_LE(trilinear_gradients(xi).colwise().sum().cwiseAbs().maxCoeff(), 8 * kEps);
  }
  for (std::size_t k = 0; k < 8; ++k) {
    const Eigen::Vector3d corner(kCorners[k][0], kCorners[k][1], kCorners[k][2]);
    EXPECT_EQ(trilinear_weights(corner), (HexWeights::Unit(static_cast<Eigen::Index>(k))));
  }
}

TEST(TrilinearGradients, MatchDifferences) {
  std::mt19937_64 rng(5);
  const Eigen::Vector3d xi = tests::uniform_point(rng, 0.0, 1.0);
  const HexGradients gradients = trilinear_gradients(xi);
  // Linear in each coordinate: central differences have no truncation error, rounding is eps / step.
  constexpr double kStep = 0.125;
  for (int c = 0; c < 3; ++c) {
    const Eigen::Vector3d d = kStep * Eigen::Vector3d::Unit(c);
    const HexWeights difference = (trilinear_weights(xi + d) - trilinear_weights(xi - d)) / (2.0 * kStep);
    EXPECT_LE((difference - gradients.col(c)).cwiseAbs().maxCoeff(), 16 * kEps);
  }
}

TEST(InvertTrilinear, FindsTheLocalCoordinatesOfDistortedCells) {
  std::mt19937_64 rng(11);
  HexCorners cube;
  for (int k = 0; k < 8; ++k) {
    for (int c = 0; c < 3; ++c)
      cube(k, c) = kCorners[static_cast<std::size_t>(k)][static_cast<std::size_t>(c)];
  }
  for (int i = 0; i < 200; ++i) {
    HexCorners corners = 3.0 * cube;
    for (int k = 0; k < 8; ++k) corners.row(k) += tests::uniform_point(rng, 9.5, 10.5).transpose();
    const Eigen::Vector3d xi = tests::uniform_point(rng, -0.1, 1.1);
    const Eigen::Vector3d p = corners.transpose() * trilinear_weights(xi);
    const LocalCoordinates found = invert_trilinear(corners, p);
    ASSERT_TRUE(found.converged);
    // The point is known to eps |p| = 20 eps; the inverse map divides by the smallest stretch, here above 1.
    EXPECT_LE((found.xi - xi).norm(), 100 * kEps) << "xi = " << xi.transpose();
    const double outside = std::max({0.0, -xi.minCoeff(), xi.maxCoeff() - 1.0});
    EXPECT_NEAR(found.outside, outside, 100 * kEps);
  }
}

}  // namespace
}  // namespace sinew::lattice
