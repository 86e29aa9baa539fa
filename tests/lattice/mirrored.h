#pragma once

#include <algorithm>
#include <array>
#include <set>

#include <gtest/gtest.h>

#include "lattice/control_lattice.h"
#include "lattice/mirror_map.h"

namespace sinew::tests {

/// Expects that points and tetrahedra are their own mirror image in a plane to 1e-9 of the lattice's size;
/// copies of a vertex at one place count once.
inline void expect_mirrored(const lattice::ControlLattice& lattice, const lattice::MirrorPlane& plane) {
  const lattice::Points& points = lattice.complex.points;
  const double size = (points.colwise().maxCoeff() - points.colwise().minCoeff()).maxCoeff();
  std::vector<int> image;
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    const Eigen::Vector3d p = points.row(v).transpose();
    const Eigen::Vector3d q = p - 2.0 * (plane.normal.dot(p) - plane.offset) * plane.normal;
    Eigen::Index nearest = 0;
    ASSERT_LT((points.rowwise() - q.transpose()).rowwise().norm().minCoeff(&nearest), 1e-9 * size)
        << "vertex " << v;
    image.push_back(static_cast<int>(nearest));
  }
  const auto place = [&](int v) {  // the lowest vertex there
    Eigen::Index first = 0;
    (points.rowwise() - points.row(v)).rowwise().squaredNorm().minCoeff(&first);
    return static_cast<int>(first);
  };
  std::multiset<std::array<int, 4>> cells, images;
  for (const lattice::Cell& cell : lattice.complex.cells) {
    std::array<int, 4> here, there;
    for (std::size_t k = 0; k < 4; ++k) {
      here[k] = place(cell.vertices[k]);
      there[k] = place(image[static_cast<std::size_t>(cell.vertices[k])]);
    }
    std::sort(here.begin(), here.end());
    std::sort(there.begin(), there.end());
    cells.insert(here);
    images.insert(there);
  }
  EXPECT_EQ(cells, images);
}

}  // namespace sinew::tests
