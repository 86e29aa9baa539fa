#pragma once

#include <vector>

#include "lattice/control_lattice.h"

namespace sinew::lattice::detail {

/// True where p lies in the cell or within `slack` (a share of the cell's size) of it. Hexahedra and wedges
/// are the union of the tetrahedra between their faces (each split about its mean) and the cell's mean.
bool cell_contains(const CellComplex& complex, const Cell& cell, const Eigen::Vector3d& p, double slack);

/// Finds the cell that holds a point.
class CellLocator {
 public:
  /// `complex` must outlive the locator.
  explicit CellLocator(const CellComplex& complex);

  /// Index of the first cell that holds p, or -1.
  int find(const Eigen::Vector3d& p, double slack) const;
  /// All cells that hold p, ascending.
  void find_all(const Eigen::Vector3d& p, double slack, std::vector<int>& cells) const;
  /// All cells whose box meets the box from low to high, and some near it, ascending.
  void find_near(const Eigen::Vector3d& low, const Eigen::Vector3d& high, std::vector<int>& cells) const;

 private:
  Eigen::Vector3i grid_cell(const Eigen::Vector3d& p) const;

  const CellComplex& complex_;
  Eigen::Vector3d low_{0, 0, 0};
  double side_ = 1.0;
  Eigen::Vector3i count_{1, 1, 1};
  std::vector<std::vector<int>> cells_;  ///< cells whose box meets each grid cell.
};

}  // namespace sinew::lattice::detail
