#include "fem/models/detail/cell_groups.h"

namespace sinew::fem::detail {

CellGroups::CellGroups(const std::vector<lattice::HexVertices>& cells, int num_vertices)
    : num_cells_(static_cast<int>(cells.size())) {
  const int groups = (num_cells_ + kCells - 1) / kCells;
  vertices_.reserve(std::size_t{8} * kCells * to_size(groups));
  for (int g = 0; g < groups; ++g) {
    for (std::size_t k = 0; k < 8; ++k) {
      for (int lane = 0; lane < kCells; ++lane) vertices_.push_back(cells[to_size(cell(g, lane))][k]);
    }
  }
  std::vector<std::vector<std::size_t>> corners(to_size(num_vertices));
  for (int c = 0; c < num_cells_; ++c) {
    for (int k = 0; k < 8; ++k) corners[to_size(cells[to_size(c)][to_size(k)])].push_back(place(c, k));
  }
  start_.push_back(0);
  for (const auto& row : corners) {
    corner_.insert(corner_.end(), row.begin(), row.end());
    start_.push_back(static_cast<int>(corner_.size()));
  }
}

}  // namespace sinew::fem::detail
