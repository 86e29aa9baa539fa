#pragma once

#include <algorithm>

#include <Eigen/Core>

#include "lattice/points.h"

namespace sinew::fem {

/// A square sheet of n x n quads of one unit, each split in two.
struct Sheet {
  lattice::Points points;
  lattice::Triangles triangles;

  explicit Sheet(int n) : points((n + 1) * (n + 1), 3), triangles(2 * n * n, 3) {
    for (int y = 0; y <= n; ++y)
      for (int x = 0; x <= n; ++x) points.row(y * (n + 1) + x) << x, y, 0;
    Eigen::Index t = 0;
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) {
        const int a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
        triangles.row(t++) << a, b, d;
        triangles.row(t++) << a, d, c;
      }
  }
};

/// Longest of the sheet's grid lines' edges, one unit each at rest.
inline double longest_edge(const Sheet& sheet, const lattice::Points& x) {
  double longest = 0.0;
  for (Eigen::Index t = 0; t < sheet.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int a = sheet.triangles(t, k), b = sheet.triangles(t, (k + 1) % 3);
      const bool diagonal = (sheet.points.row(a) - sheet.points.row(b)).norm() > 1.2;
      if (!diagonal) longest = std::max(longest, (x.row(a) - x.row(b)).norm());
    }
  return longest;
}

}  // namespace sinew::fem
