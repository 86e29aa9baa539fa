#include "assets/volume_mesh.h"

#include <algorithm>

namespace sinew::assets {

void drop_idle_regions(VolumeMesh& mesh) {
  if (std::all_of(mesh.regions.begin(), mesh.regions.end(), [](int r) { return r == 0; }))
    mesh.regions.clear();
  if (mesh.regions.empty()) mesh.region_names.clear();
}

void drop_idle_vertices(VolumeMesh& mesh) {
  lattice::Points& points = mesh.complex.points;
  std::vector<int> new_index(static_cast<std::size_t>(points.rows()), -1);
  for (const lattice::Cell& cell : mesh.complex.cells)
    for (int k = 0; k < num_corners(cell.type); ++k)
      new_index[static_cast<std::size_t>(cell.vertices[k])] = 0;
  if (std::count(new_index.begin(), new_index.end(), -1) == 0) return;
  std::vector<std::int64_t> numbers;
  int count = 0;
  for (std::size_t v = 0; v < new_index.size(); ++v) {
    if (new_index[v] < 0) continue;
    points.row(count) = points.row(static_cast<Eigen::Index>(v)).eval();
    numbers.push_back(mesh.numbering.vertex(v));
    new_index[v] = count++;
  }
  points.conservativeResize(count, 3);
  mesh.numbering.vertices = std::move(numbers);
  for (lattice::Cell& cell : mesh.complex.cells)
    for (int k = 0; k < num_corners(cell.type); ++k)
      cell.vertices[k] = new_index[static_cast<std::size_t>(cell.vertices[k])];
  const auto is_idle = [&](const VolumeMesh::Line& line) {
    return std::any_of(line.vertices.begin(), line.vertices.end(),
                       [&](int v) { return new_index[static_cast<std::size_t>(v)] < 0; });
  };
  mesh.lines.erase(std::remove_if(mesh.lines.begin(), mesh.lines.end(), is_idle), mesh.lines.end());
  for (VolumeMesh::Line& line : mesh.lines)
    for (int& v : line.vertices) v = new_index[static_cast<std::size_t>(v)];
}

}  // namespace sinew::assets
