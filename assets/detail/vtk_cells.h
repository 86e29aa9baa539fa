#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "assets/vtu.h"

namespace sinew::assets::detail {

/// Cells as VTK stores them: cell c has the points connectivity[offsets[c-1] .. offsets[c]).
struct VtkCells {
  std::vector<std::int64_t> connectivity, offsets, types;
};

/// In VTK's numbers: all cells of the grid, then its lines as poly-lines.
VtkCells vtk_cells(const VtuGrid& grid);

/// Checks every index and fills cells, lines and cell numbers of the grid. Returns, for every entry of
/// grid.cells and then of grid.lines, its place among the file's cells. `fail` throws.
std::vector<std::int64_t> read_vtk_cells(const VtkCells& cells, std::int64_t num_points, VtuGrid& grid,
                                         const std::function<void(const std::string&)>& fail);

/// Adds an array over the file's `num_cells` cells to the grid, for its own cells and lines alone (`places`
/// from read_vtk_cells). An array of another length, such as strings that were not decoded, is left out.
void add_cell_array(const VtuArray& array, std::int64_t num_cells, const std::vector<std::int64_t>& places,
                    VtuGrid& grid);

}  // namespace sinew::assets::detail
