#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "fem/linear/lanes.h"
#include "lattice/points.h"
#include "lattice/trilinear.h"

/// Leaf cells four at a time, one per lane: what all cells do alike takes a quarter of the instructions.
namespace sinew::fem::detail {

/// Cells 4 g .. 4 g + 3 are group g; the last group is filled up with its last cell. Vectors of a group, one
/// number per dof and cell, lie as dof 3 * corner + component, then lane.
class CellGroups {
 public:
  static constexpr int kCells = LanesOf<double>::kCount;
  static constexpr int kDofs = 24;

  CellGroups() = default;
  CellGroups(const std::vector<lattice::HexVertices>& cells, int num_vertices);

  int num_cells() const { return num_cells_; }
  int num_groups() const { return static_cast<int>(vertices_.size()) / (8 * kCells); }
  /// The cell in a lane of a group.
  int cell(int group, int lane) const {
    const int c = kCells * group + lane;
    return c < num_cells_ ? c : num_cells_ - 1;
  }
  /// Vertices of the group's corners, 4 * corner + lane.
  const int* vertices(int group) const { return vertices_.data() + std::size_t{8} * kCells * to_size(group); }

  /// Numbers that the vectors of all groups take.
  std::size_t vector_size() const { return vector_of(num_groups()); }
  static std::size_t vector_of(int group) { return std::size_t{kDofs} * kCells * to_size(group); }

  /// What `vectors` has at a corner of a cell.
  static Eigen::Vector3d corner(int cell, int corner, const std::vector<double>& vectors) {
    return three(vectors.data() + place(cell, corner));
  }
  static void add_at(int cell, int corner, const Eigen::Vector3d& force, std::vector<double>& vectors) {
    double* at = vectors.data() + place(cell, corner);
    for (int i = 0; i < 3; ++i) at[i * kCells] += force[i];
  }
  /// Sum over the cells round a leaf vertex, in their order, of what `vectors` has at it.
  Eigen::Vector3d sum_at(int vertex, const std::vector<double>& vectors) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (auto e = to_size(start_[to_size(vertex)]); e < to_size(start_[to_size(vertex) + 1]); ++e) {
      sum += three(vectors.data() + corner_[e]);
    }
    return sum;
  }

 private:
  static std::size_t place(int cell, int corner) {
    return vector_of(cell / kCells) + to_size(3 * kCells * corner + cell % kCells);
  }
  static Eigen::Vector3d three(const double* at) { return {at[0], at[kCells], at[2 * kCells]}; }
  static std::size_t to_size(int i) { return static_cast<std::size_t>(i); }

  int num_cells_ = 0;
  std::vector<int> vertices_;
  std::vector<int> start_;           ///< of the corners round a vertex, num_vertices + 1,
  std::vector<std::size_t> corner_;  ///< as places in a vector.
};

}  // namespace sinew::fem::detail
