#include "lattice/surface_query.h"

#include <limits>

#include <gtest/gtest.h>

#include "tests/lattice/shapes.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

Vector3d corner(const Surface& s, int triangle, int k) {
  return s.points.row(s.triangles(triangle, k)).transpose();
}

/// Closest point by a dense search over barycentric coordinates followed by shrinking: independent of the
/// region tests in closest_on_triangle.
double sampled_distance(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  double u = 1.0 / 3, v = 1.0 / 3, best = std::numeric_limits<double>::infinity();
  for (double width = 1.0; width > 1e-9; width *= 0.6) {
    double bu = u, bv = v;
    for (int i = -5; i <= 5; ++i)
      for (int j = -5; j <= 5; ++j) {
        const double tu = std::clamp(u + width * i / 5, 0.0, 1.0);
        const double tv = std::clamp(v + width * j / 5, 0.0, 1.0 - tu);
        const double d = (a + tu * (b - a) + tv * (c - a) - p).norm();
        if (d < best) best = d, bu = tu, bv = tv;
      }
    u = bu, v = bv;
  }
  return best;
}

TEST(ClosestOnTriangle, AgreesWithADenseSearch) {
  std::mt19937_64 rng(20021);
  for (int i = 0; i < 200; ++i) {
    const Vector3d p = tests::uniform_point(rng, -2, 2), a = tests::uniform_point(rng, -1, 1),
                   b = tests::uniform_point(rng, -1, 1), c = tests::uniform_point(rng, -1, 1);
    const double distance = (closest_on_triangle(p, a, b, c) - p).norm();
    // The search stops at a parameter step of 1e-9; distance is flat there, edges are shorter than 4.
    EXPECT_NEAR(distance, sampled_distance(p, a, b, c), 1e-7) << "sample " << i;
  }
}

TEST(ClosestOnTriangle, TakesTheEdgesOfATriangleWithoutArea) {
  const Vector3d a(0, 0, 0), b(1, 0, 0), c(3, 0, 0), p(2, 1, 0);
  EXPECT_NEAR((closest_on_triangle(p, a, b, c) - Vector3d(2, 0, 0)).norm(), 0.0, 1e-15);
  EXPECT_EQ(closest_on_triangle(p, a, a, a), a);
}

TEST(SolidAngle, OfAnOctantIsHalfPi) {
  // The triangle of the three unit axes cuts one octant of the sphere: 4 pi / 8.
  EXPECT_NEAR(solid_angle(Vector3d::Zero(), Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()),
              std::numbers::pi / 2, 1e-15);
}

TEST(SurfaceQuery, ClosestAgreesWithBruteForce) {
  const Surface s = tests::bumpy_sphere(24, 36);
  const SurfaceQuery query(s.points, s.triangles);
  std::mt19937_64 rng(20022);
  for (int i = 0; i < 500; ++i) {
    const Vector3d p = tests::uniform_point(rng, -2, 2);
    double best = std::numeric_limits<double>::infinity();
    for (int t = 0; t < s.triangles.rows(); ++t)
      best = std::min(best,
                      (closest_on_triangle(p, corner(s, t, 0), corner(s, t, 1), corner(s, t, 2)) - p).norm());
    const SurfaceQuery::Closest found = query.closest(p);
    EXPECT_EQ(found.distance, best) << "point " << p.transpose();  // the same function on the same triangle
    EXPECT_EQ((found.point - p).norm(), best);
    ASSERT_GE(found.triangle, 0);
    EXPECT_EQ((closest_on_triangle(p, corner(s, found.triangle, 0), corner(s, found.triangle, 1),
                                   corner(s, found.triangle, 2)) -
               p)
                  .norm(),
              best);
    EXPECT_TRUE(query.is_within(p, best * (1 + 1e-12)));
    EXPECT_FALSE(query.is_within(p, best * (1 - 1e-12)));
  }
}

TEST(SurfaceQuery, WindingNumberAgreesWithTheSumOfSolidAngles) {
  for (const bool open : {false, true}) {
    Surface s = tests::bumpy_sphere(40, 60);
    if (open) s.triangles.conservativeResize(s.triangles.rows() * 2 / 3, 3);
    const SurfaceQuery query(s.points, s.triangles);
    std::mt19937_64 rng(20023);
    double worst = 0.0;
    for (int i = 0; i < 1500; ++i) {
      Vector3d p = tests::uniform_point(rng, -1.6, 1.6);
      if (i % 3 == 0) p = query.closest(p).point + 1e-3 * tests::uniform_point(rng, -1, 1);
      double sum = 0.0;
      for (int t = 0; t < s.triangles.rows(); ++t)
        sum += solid_angle(p, corner(s, t, 0), corner(s, t, 1), corner(s, t, 2));
      worst = std::max(worst, std::abs(query.winding_number(p) - sum / (4 * std::numbers::pi)));
    }
    EXPECT_LT(worst, 0.02) << (open ? "open" : "closed");  // the promise of the header
    RecordProperty(open ? "worst_open" : "worst_closed", std::to_string(worst));
  }
}

TEST(SurfaceQuery, WindingNumberTellsInsideFromOutside) {
  const Surface s = tests::bumpy_sphere(40, 60);
  const SurfaceQuery query(s.points, s.triangles);
  EXPECT_NEAR(query.winding_number({0.1, -0.2, 0.3}), 1.0, 0.02);
  EXPECT_NEAR(query.winding_number({3, 0, 0}), 0.0, 0.02);
}

TEST(SurfaceQuery, RefusesWhatIsNoSurface) {
  const Surface s = tests::bumpy_sphere(6, 6);
  EXPECT_THROW(SurfaceQuery(s.points, Triangles(0, 3)), std::invalid_argument);
  Triangles wrong = s.triangles;
  wrong(0, 0) = static_cast<int>(s.points.rows());
  EXPECT_THROW(SurfaceQuery(s.points, wrong), std::invalid_argument);
  Points infinite = s.points;
  infinite(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(SurfaceQuery(infinite, s.triangles), std::invalid_argument);
}

}  // namespace
}  // namespace sinew::lattice
