#include "lattice/detail/tet_mesh.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lattice/detail/triangle_grid.h"
#include "lattice/quality.h"
#include "tests/lattice/shapes.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

double volume(const TetMesh& mesh) {
  double sum = 0.0;
  for (const TetMesh::Tet& t : mesh.cells())
    sum += (mesh.points[t[1]] - mesh.points[t[0]])
               .cross(mesh.points[t[2]] - mesh.points[t[0]])
               .dot(mesh.points[t[3]] - mesh.points[t[0]]) /
           6.0;
  return sum;
}

TEST(TetrahedronQuality, OfTheRegularTetrahedronIsTheSineOfItsDihedral) {
  const Vector3d a(1, 1, 1), b(1, -1, -1), c(-1, 1, -1), d(-1, -1, 1);
  // cos(dihedral) = 1/3; the corner Jacobian is 1/sqrt(2), times 1.4 it is larger.
  EXPECT_NEAR(tetrahedron_quality(a, c, b, d), std::sqrt(8.0) / 3.0, 1e-15);
  EXPECT_EQ(tetrahedron_quality(a, b, c, d), -1.0);
  EXPECT_EQ(tetrahedron_quality(a, c, b, Vector3d(1, 0, 0)), -1.0);  // flat: d in the plane of a, b, c
}

TEST(Level1Jacobian, IsThatOfTheHexahedraOfASubdivision) {
  std::mt19937_64 rng(11);
  CellComplex complex;
  complex.points.resize(4, 3);
  complex.cells.push_back({CellType::Tetrahedron, {0, 1, 2, 3, -1, -1, -1, -1}});
  for (int i = 0; i < 1000; ++i) {
    for (int k = 0; k < 4; ++k) complex.points.row(k) = tests::uniform_point(rng, -1, 1).transpose();
    if (cell_volume(complex, complex.cells[0]) < 0.0) complex.points.row(0).swap(complex.points.row(1));
    const auto p = [&](int k) -> Vector3d { return complex.points.row(k).transpose(); };
    // Thin cells have small edges from differences of coordinates below 1: 1e-16 over the flatness.
    EXPECT_NEAR(level1_jacobian(p(0), p(1), p(2), p(3)), min_scaled_jacobian(complex, complex.cells[0]),
                1e-12);
  }
}

/// A double cone: `n` points round the axis from a = (0, 0, -1) to b = (0, 0, 1), and the cells round that
/// edge.
TetMesh double_cone(int n, double radius) {
  std::vector<Vector3d> points{{0, 0, -1}, {0, 0, 1}};
  std::vector<TetMesh::Tet> tets;
  for (int i = 0; i < n; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / n;
    points.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0.0);
    tets.push_back({0, 1, 2 + i, 2 + (i + 1) % n});
  }
  return {points, tets};
}

TEST(RemoveEdge, KeepsTheVolumeAndRaisesTheQuality) {
  for (const auto& [n, after] : {std::pair(3, 2), std::pair(4, 4), std::pair(5, 6)}) {
    TetMesh mesh = double_cone(n, 0.3 + 0.1 * n);
    const double before = volume(mesh), quality = mesh.star_quality(0);
    ASSERT_TRUE(remove_edge(mesh, 0, 1, {})) << n;
    EXPECT_EQ(static_cast<int>(mesh.cells().size()), after);  // 2 (n - 2)
    EXPECT_NEAR(volume(mesh), before, 1e-14);
    EXPECT_GT(mesh.star_quality(0), quality);
  }
}

TEST(RemoveEdge, LeavesBonesAndBoundaryEdgesAlone) {
  TetMesh mesh = double_cone(4, 0.7);
  EXPECT_FALSE(remove_edge(mesh, 0, 1, {{0, 1}}));
  EXPECT_FALSE(remove_edge(mesh, 0, 2, {}));  // on the boundary
}

/// Two cells on either side of an equilateral triangle, their apexes at distance `apex` from it.
TetMesh bipyramid(double apex) {
  std::vector<Vector3d> points{{0, 0, -apex}, {0, 0, apex}};
  for (int i = 0; i < 3; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 3;
    points.emplace_back(std::cos(angle), std::sin(angle), 0.0);
  }
  return {points, {{1, 2, 4, 3}, {0, 2, 3, 4}}};
}

TEST(RemoveFace, TurnsTwoFlatCellsIntoThree) {
  TetMesh mesh = bipyramid(0.25);
  const double before = volume(mesh), quality = mesh.star_quality(2);
  ASSERT_GT(quality, 0.0);
  EXPECT_TRUE(remove_face(mesh, 0, 0));
  EXPECT_EQ(mesh.cells().size(), 3u);
  EXPECT_NEAR(volume(mesh), before, 1e-14);
  EXPECT_GT(mesh.star_quality(2), quality);
}

TEST(RemoveFace, LeavesTallCellsAndTheBoundaryAlone) {
  TetMesh mesh = bipyramid(2.0);
  for (int k = 0; k < 4; ++k) EXPECT_FALSE(remove_face(mesh, 0, k)) << k;
  EXPECT_EQ(mesh.cells().size(), 2u);
}

TEST(TetrahedronContains, AgreesWithBarycentricCoordinates) {
  std::mt19937_64 rng(20024);
  for (int i = 0; i < 300; ++i) {
    const Vector3d a = tests::uniform_point(rng, -1, 1), b = tests::uniform_point(rng, -1, 1);
    Vector3d c = tests::uniform_point(rng, -1, 1), d = tests::uniform_point(rng, -1, 1);
    if ((b - a).cross(c - a).dot(d - a) < 0.0) std::swap(c, d);
    Eigen::Vector4d w;
    for (int k = 0; k < 4; ++k) w[k] = tests::uniform(rng, -0.5, 1.0);
    w /= w.sum();
    const Vector3d p = w[0] * a + w[1] * b + w[2] * c + w[3] * d;
    if (std::abs(w.minCoeff()) < 1e-9) continue;
    EXPECT_EQ(tetrahedron_contains(a, b, c, d, p, 0.0), w.minCoeff() > 0.0) << w.transpose();
  }
}

TEST(TrianglesCross, ThroughAndBesideButNotWhereTheyTouch) {
  const TriangleCorners floor{Vector3d(0, 0, 0), Vector3d(2, 0, 0), Vector3d(0, 2, 0)};
  const auto upright = [](double x, double low) {
    return TriangleCorners{Vector3d(x, 0.3, low), Vector3d(x, 0.6, low), Vector3d(x, 0.4, low + 1)};
  };
  EXPECT_TRUE(triangles_cross(floor, upright(0.5, -0.5), 0.0));
  EXPECT_FALSE(triangles_cross(floor, upright(2.5, -0.5), 0.0));
  EXPECT_FALSE(triangles_cross(floor, upright(0.5, 0.0), 0.0));     // stands on it
  EXPECT_FALSE(triangles_cross(floor, upright(0.5, -1e-9), 1e-8));  // dips in by less than eps
  EXPECT_FALSE(triangles_cross(floor, floor, 0.0));
}

TEST(TriangleGrid, AgreesWithTestingEveryTriangle) {
  std::mt19937_64 rng(20025);
  std::vector<TriangleCorners> triangles;
  const auto random_triangle = [&](double size) {
    const Vector3d at = tests::uniform_point(rng, -1, 1);
    return TriangleCorners{at, at + size * tests::uniform_point(rng, -1, 1),
                           at + size * tests::uniform_point(rng, -1, 1)};
  };
  for (int i = 0; i < 200; ++i) triangles.push_back(random_triangle(i % 10 == 0 ? 1.0 : 0.1));
  const TriangleGrid grid(triangles, 0.13);
  int crossings = 0;
  for (int i = 0; i < 300; ++i) {
    const TriangleCorners t = random_triangle(0.2);
    bool any = false;
    for (const TriangleCorners& other : triangles) any = any || triangles_cross(t, other, 0.0);
    EXPECT_EQ(grid.crosses(t, 0.0), any);
    crossings += any;
  }
  EXPECT_GT(crossings, 10);  // else the test would say nothing
}

}  // namespace
}  // namespace sinew::lattice::detail
