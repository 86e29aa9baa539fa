#include "adapt/deformation.h"

#include <gtest/gtest.h>

#include "tests/fem/bar.h"

namespace sinew {
namespace {

using lattice::Points;

double largest(const std::vector<double>& values) { return *std::max_element(values.begin(), values.end()); }

Points moved(const fem::Body& body, const Eigen::Affine3d& map) {
  Points x = body.mesh.points;
  for (Eigen::Index a = 0; a < x.rows(); ++a) x.row(a) = (map * x.row(a).transpose()).transpose();
  return x;
}

TEST(DeformationMagnitudes, VanishUnderRigidMotion) {
  const fem::Body body = tests::bar_body({});
  Eigen::Affine3d map = Eigen::Affine3d::Identity();
  map.rotate(Eigen::AngleAxisd(2.0, Eigen::Vector3d(1, 2, 3).normalized()))
      .pretranslate(Eigen::Vector3d(5, -7, 9));
  // Positions of size 10 with eps 2.2e-16, divided by cells of 0.05, and eigenvalues good to about 1e-8.
  EXPECT_LT(largest(adapt::deformation_magnitudes(body, moved(body, map))), 1e-7);
}

TEST(DeformationMagnitudes, OfAffineStretchAreTheStretchOnLevelZeroAndNothingInDetails) {
  const fem::Body body = tests::bar_body({});
  Eigen::Affine3d map = Eigen::Affine3d::Identity();
  map.linear().diagonal() << 1.1, 0.97, 1.0;
  const std::vector<double> magnitudes = adapt::deformation_magnitudes(body, moved(body, map));
  for (std::size_t f = 0; f < magnitudes.size(); ++f) {
    const bool coarse = body.hierarchy.level(body.mesh.functions[f]) == 0;
    EXPECT_NEAR(magnitudes[f], coarse ? 0.1 : 0.0, 1e-7)
        << "function " << f;  // eigenvalues good to about 1e-8
  }
}

TEST(DeformationMagnitudes, OfOneDetailAreItsHeightOverItsCells) {
  const fem::Body body = tests::bar_body({});
  for (int f = 0; f < body.mesh.num_functions(); ++f) {
    const int vertex = body.mesh.functions[static_cast<std::size_t>(f)];
    if (body.hierarchy.level(vertex) != 1) continue;
    Points x = body.mesh.points;
    x(body.mesh.leaf_of_vertex[static_cast<std::size_t>(vertex)], 2) += 0.01;
    const std::vector<double> magnitudes = adapt::deformation_magnitudes(body, x);
    // Cells of level 1 are half of the 0.2 m blocks.
    EXPECT_NEAR(magnitudes[static_cast<std::size_t>(f)], 0.01 / 0.1, 1e-12);
    break;
  }
}

TEST(DeformationMagnitudes, RefusePositionsOfAnotherMesh) {
  const fem::Body body = tests::bar_body({});
  EXPECT_THROW(adapt::deformation_magnitudes(body, Points::Zero(3, 3)), std::invalid_argument);
}

}  // namespace
}  // namespace sinew
