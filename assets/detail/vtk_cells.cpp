#include "assets/detail/vtk_cells.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

namespace sinew::assets::detail {
namespace {

using lattice::CellType;

constexpr std::int64_t kLine = 3, kPolyLine = 4, kTetrahedron = 10, kHexahedron = 12, kWedge = 13,
                       kPyramid = 14;

std::int64_t vtk_type(CellType type) {
  return type == CellType::Tetrahedron ? kTetrahedron : type == CellType::Wedge ? kWedge : kHexahedron;
}

std::optional<CellType> cell_type(std::int64_t type) {
  if (type == kTetrahedron) return CellType::Tetrahedron;
  if (type == kWedge) return CellType::Wedge;
  if (type == kHexahedron) return CellType::Hexahedron;
  return std::nullopt;
}

/// VTK's wedge has its first triangle's normal pointing away from the second.
template <class Iterator>
void swap_wedge(Iterator first) {
  std::swap(first[1], first[2]);
  std::swap(first[4], first[5]);
}

}  // namespace

VtkCells vtk_cells(const VtuGrid& grid) {
  VtkCells out;
  for (const lattice::Cell& cell : grid.cells) {
    out.connectivity.insert(out.connectivity.end(), cell.vertices.begin(),
                            cell.vertices.begin() + num_corners(cell.type));
    if (cell.type == CellType::Wedge) swap_wedge(out.connectivity.end() - 6);
    out.offsets.push_back(static_cast<std::int64_t>(out.connectivity.size()));
    out.types.push_back(vtk_type(cell.type));
  }
  for (const std::vector<int>& line : grid.lines) {
    out.connectivity.insert(out.connectivity.end(), line.begin(), line.end());
    out.offsets.push_back(static_cast<std::int64_t>(out.connectivity.size()));
    out.types.push_back(kPolyLine);
  }
  return out;
}

std::vector<std::int64_t> read_vtk_cells(const VtkCells& cells, std::int64_t num_points, VtuGrid& grid,
                                         const std::function<void(const std::string&)>& fail) {
  const auto& [connectivity, offsets, types] = cells;
  std::vector<std::int64_t> line_numbers;
  std::int64_t begin = 0;
  for (std::size_t c = 0; c < types.size(); ++c) {
    const std::int64_t end = offsets[c], type = types[c];
    if (end < begin || end > static_cast<std::int64_t>(connectivity.size()))
      fail(fmt::format("cell {}: offset, got {}, expected {}..{}", c, end, begin, connectivity.size()));
    for (std::int64_t i = begin; i < end; ++i)
      if (connectivity[static_cast<std::size_t>(i)] < 0 ||
          connectivity[static_cast<std::size_t>(i)] >= num_points)
        fail(fmt::format("cell {}: point, got {}, expected 0..{}", c,
                         connectivity[static_cast<std::size_t>(i)], num_points - 1));
    const auto first = connectivity.begin() + begin, last = connectivity.begin() + end;
    begin = end;
    if (type == kPyramid)
      fail(
          fmt::format("cell {}: is a pyramid, whose apex has four edges; hint: split it into tetrahedra", c));
    if (type == kLine || type == kPolyLine) {
      grid.lines.emplace_back(first, last);
      line_numbers.push_back(static_cast<std::int64_t>(c));
    }
    if (type >= 0 && type <= 9) continue;  // nothing, vertices, lines and faces
    const std::optional<CellType> known = cell_type(type);
    if (!known) {
      fail(fmt::format(
          "cell {}: VTK cell type, got {}, expected 10 (tetrahedron), 12 (hexahedron) or 13 (wedge)", c,
          type));
      continue;
    }
    lattice::Cell cell;
    cell.type = *known;
    if (last - first != num_corners(cell.type))
      fail(fmt::format("cell {}: got {} points, expected {}", c, last - first, num_corners(cell.type)));
    std::copy(first, last, cell.vertices.begin());
    if (cell.type == CellType::Wedge) swap_wedge(cell.vertices.begin());
    grid.cells.push_back(cell);
    grid.cell_numbers.push_back(static_cast<std::int64_t>(c));
  }
  std::vector<std::int64_t> places = grid.cell_numbers;
  places.insert(places.end(), line_numbers.begin(), line_numbers.end());
  return places;
}

void add_cell_array(const VtuArray& array, std::int64_t num_cells, const std::vector<std::int64_t>& places,
                    VtuGrid& grid) {
  const auto components = static_cast<std::size_t>(array.components);
  std::visit(
      [&](const auto& values) {
        if (values.size() != static_cast<std::size_t>(num_cells) * components) return;
        auto chosen = values;
        chosen.clear();
        for (std::int64_t place : places)
          for (std::size_t k = 0; k < components; ++k)
            chosen.push_back(values[static_cast<std::size_t>(place) * components + k]);
        grid.cell_arrays.push_back({array.name, array.components, std::move(chosen)});
      },
      array.values);
}

}  // namespace sinew::assets::detail
