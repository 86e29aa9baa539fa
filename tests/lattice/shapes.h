#pragma once

#include <cmath>
#include <numbers>
#include <random>

#include "lattice/surface.h"

/// Surfaces and random numbers for the lattice tests.
namespace sinew::tests {

/// Uniform in [low, high), the same on every library.
inline double uniform(std::mt19937_64& rng, double low, double high) {
  return low + (high - low) * static_cast<double>(rng() >> 11) * 0x1p-53;
}

inline Eigen::Vector3d uniform_point(std::mt19937_64& rng, double low, double high) {
  const double x = uniform(rng, low, high), y = uniform(rng, low, high), z = uniform(rng, low, high);
  return {x, y, z};
}

/// Closed surface of the points centre + radius(direction) * direction, rings x segments quads in triangles,
/// outward; poles along y.
template <class Radius>
lattice::Surface blob(const Eigen::Vector3d& centre, int rings, int segments, const Radius& radius) {
  lattice::Surface s;
  s.points.resize((rings - 1) * segments + 2, 3);
  const auto place = [&](int row, double polar, double azimuth) {
    const Eigen::Vector3d d(std::sin(polar) * std::cos(azimuth), std::cos(polar),
                            std::sin(polar) * std::sin(azimuth));
    s.points.row(row) = (centre + radius(d) * d).transpose();
  };
  for (int i = 1; i < rings; ++i)
    for (int j = 0; j < segments; ++j)
      place((i - 1) * segments + j, std::numbers::pi * i / rings, 2.0 * std::numbers::pi * j / segments);
  const int top = (rings - 1) * segments, bottom = top + 1;
  place(top, 0.0, 0.0);
  place(bottom, std::numbers::pi, 0.0);
  std::vector<Eigen::RowVector3i> triangles;
  for (int j = 0; j < segments; ++j) {
    const int k = (j + 1) % segments;
    triangles.push_back({top, k, j});
    for (int i = 0; i + 2 < rings; ++i) {
      const int a = i * segments + j, b = i * segments + k, c = a + segments, d = b + segments;
      triangles.push_back({a, b, d});
      triangles.push_back({a, d, c});
    }
    triangles.push_back({bottom, (rings - 2) * segments + j, (rings - 2) * segments + k});
  }
  s.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    s.triangles.row(static_cast<Eigen::Index>(t)) = triangles[t];
  return s;
}

/// A sphere with bumps: not convex, closed.
inline lattice::Surface bumpy_sphere(int rings, int segments) {
  return blob({0.1, -0.2, 0.3}, rings, segments, [](const Eigen::Vector3d& d) {
    return 1.0 + 0.25 * std::sin(5.0 * d.x()) * std::sin(4.0 * d.y() + 1.0) * std::cos(3.0 * d.z());
  });
}

}  // namespace sinew::tests
