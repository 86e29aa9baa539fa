#include "lattice/detail/cell_locator.h"

#include <algorithm>
#include <cmath>

#include "lattice/detail/tet_mesh.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// Grid cells per lattice cell: about one.
constexpr int kLargestGrid = 200;
/// Points this near a cell's box look at it, in units of the grid: more than any slack of the callers.
constexpr double kMargin = 1e-6;

}  // namespace

bool cell_contains(const CellComplex& complex, const Cell& cell, const Vector3d& p, double slack) {
  const auto point = [&](int k) -> Vector3d { return complex.points.row(cell.vertices[k]).transpose(); };
  if (cell.type == CellType::Tetrahedron)
    return tetrahedron_contains(point(0), point(1), point(2), point(3), p, slack);
  const int n = num_corners(cell.type);
  Vector3d mean = Vector3d::Zero();
  for (int k = 0; k < n; ++k) mean += point(k) / n;
  for (const std::array<int, 4>& face : cell_faces(cell.type)) {
    if (face[3] < 0) {
      if (tetrahedron_contains(point(face[0]), point(face[2]), point(face[1]), mean, p, slack)) return true;
      continue;
    }
    const Vector3d centre = 0.25 * (point(face[0]) + point(face[1]) + point(face[2]) + point(face[3]));
    for (int k = 0; k < 4; ++k)
      if (tetrahedron_contains(point(face[(k + 1) % 4]), point(face[k]), centre, mean, p, slack)) return true;
  }
  return false;
}

CellLocator::CellLocator(const CellComplex& complex) : complex_(complex) {
  if (complex.cells.empty()) {
    cells_.resize(1);
    return;
  }
  low_ = complex.points.colwise().minCoeff();
  const Vector3d size = complex.points.colwise().maxCoeff().transpose() - low_;
  const double volume = size.cwiseMax(1e-3 * size.maxCoeff()).prod();
  side_ =
      std::max(std::cbrt(volume / static_cast<double>(complex.cells.size())), size.maxCoeff() / kLargestGrid);
  count_ = (size / side_).array().floor().cast<int>() + 1;
  cells_.resize(count_.prod());
  for (int c = 0; c < static_cast<int>(complex.cells.size()); ++c) {
    const Cell& cell = complex.cells[c];
    Vector3d low = complex.points.row(cell.vertices[0]).transpose(), high = low;
    for (int k = 1; k < num_corners(cell.type); ++k) {
      low = low.cwiseMin(complex.points.row(cell.vertices[k]).transpose());
      high = high.cwiseMax(complex.points.row(cell.vertices[k]).transpose());
    }
    const Vector3d margin = Vector3d::Constant(kMargin * side_);
    const Eigen::Vector3i first = grid_cell(low - margin), last = grid_cell(high + margin);
    for (int i = first.x(); i <= last.x(); ++i)
      for (int j = first.y(); j <= last.y(); ++j)
        for (int k = first.z(); k <= last.z(); ++k)
          cells_[(i * count_.y() + j) * count_.z() + k].push_back(c);
  }
}

Eigen::Vector3i CellLocator::grid_cell(const Vector3d& p) const {
  const Eigen::Array3d scaled = ((p - low_) / side_).array().floor();
  return scaled.max(0.0).min((count_.array() - 1).cast<double>()).cast<int>();
}

void CellLocator::find_near(const Vector3d& low, const Vector3d& high, std::vector<int>& cells) const {
  cells.clear();
  const Eigen::Vector3i first = grid_cell(low), last = grid_cell(high);
  for (int i = first.x(); i <= last.x(); ++i)
    for (int j = first.y(); j <= last.y(); ++j)
      for (int k = first.z(); k <= last.z(); ++k) {
        const std::vector<int>& here = cells_[(i * count_.y() + j) * count_.z() + k];
        cells.insert(cells.end(), here.begin(), here.end());
      }
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
}

int CellLocator::find(const Vector3d& p, double slack) const {
  const Eigen::Vector3i g = grid_cell(p);
  for (int c : cells_[(g.x() * count_.y() + g.y()) * count_.z() + g.z()])
    if (cell_contains(complex_, complex_.cells[c], p, slack)) return c;
  return -1;
}

void CellLocator::find_all(const Vector3d& p, double slack, std::vector<int>& cells) const {
  cells.clear();
  const Eigen::Vector3i g = grid_cell(p);
  for (int c : cells_[(g.x() * count_.y() + g.y()) * count_.z() + g.z()])
    if (cell_contains(complex_, complex_.cells[c], p, slack)) cells.push_back(c);
}

}  // namespace sinew::lattice::detail
