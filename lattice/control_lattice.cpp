#include "lattice/control_lattice.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <Eigen/Geometry>

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

using Edge = std::pair<int, int>;

Edge ordered(int a, int b) { return a < b ? Edge{a, b} : Edge{b, a}; }

double tetrahedron_volume(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  return (b - a).cross(c - a).dot(d - a) / 6.0;
}

std::string cell_name(std::size_t cell) { return "cell " + std::to_string(cell); }

void check_cells(const CellComplex& complex) {
  for (std::size_t c = 0; c < complex.cells.size(); ++c) {
    const Cell& cell = complex.cells[c];
    for (int k = 0; k < num_corners(cell.type); ++k) {
      if (cell.vertices[k] < 0 || cell.vertices[k] >= complex.points.rows()) {
        throw std::invalid_argument(cell_name(c) + ": vertex index " + std::to_string(cell.vertices[k]) +
                                    " is not in 0.." + std::to_string(complex.points.rows() - 1));
      }
    }
    const double volume = cell_volume(complex, cell);
    if (!(volume > 0.0)) {
      throw std::invalid_argument(cell_name(c) + ": volume is " + std::to_string(volume) +
                                  ", must be positive");
    }
  }
}

void check_chain(const ControlLattice& lattice, const LatticeBone& bone, const std::vector<Edge>& edges) {
  const std::string name = "bone '" + bone.name + "'";
  if (bone.soft) {
    if (!bone.chain.empty()) throw std::invalid_argument(name + ": is soft but has a chain of vertices");
    return;
  }
  if (bone.chain.size() < 2) throw std::invalid_argument(name + ": is hard but has no chain of edges");
  for (std::size_t i = 0; i < bone.chain.size(); ++i) {
    if (bone.chain[i] < 0 || bone.chain[i] >= lattice.complex.points.rows()) {
      throw std::invalid_argument(name + ": chain vertex " + std::to_string(bone.chain[i]) +
                                  " does not exist");
    }
    if (i == 0) continue;
    if (!std::binary_search(edges.begin(), edges.end(), ordered(bone.chain[i - 1], bone.chain[i]))) {
      throw std::invalid_argument(name + ": vertices " + std::to_string(bone.chain[i - 1]) + " and " +
                                  std::to_string(bone.chain[i]) + " of its chain are not joined by an edge");
    }
  }
}

}  // namespace

std::span<const std::array<int, 2>> cell_edges(CellType type) {
  static constexpr std::array<std::array<int, 2>, 6> kTetrahedron{
      {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}};
  static constexpr std::array<std::array<int, 2>, 9> kWedge{
      {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}}};
  static constexpr std::array<std::array<int, 2>, 12> kHexahedron{
      {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6}, {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}}};
  if (type == CellType::Tetrahedron) return kTetrahedron;
  if (type == CellType::Wedge) return kWedge;
  return kHexahedron;
}

std::span<const std::array<int, 4>> cell_faces(CellType type) {
  static constexpr std::array<std::array<int, 4>, 4> kTetrahedron{
      {{0, 2, 1, -1}, {0, 1, 3, -1}, {1, 2, 3, -1}, {2, 0, 3, -1}}};
  static constexpr std::array<std::array<int, 4>, 5> kWedge{
      {{0, 2, 1, -1}, {3, 4, 5, -1}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}}};
  static constexpr std::array<std::array<int, 4>, 6> kHexahedron{
      {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}}};
  if (type == CellType::Tetrahedron) return kTetrahedron;
  if (type == CellType::Wedge) return kWedge;
  return kHexahedron;
}

double cell_volume(const CellComplex& complex, const Cell& cell) {
  const auto point = [&](int k) -> Vector3d { return complex.points.row(cell.vertices[k]).transpose(); };
  if (cell.type == CellType::Tetrahedron) return tetrahedron_volume(point(0), point(1), point(2), point(3));
  const int n = num_corners(cell.type);
  Vector3d mean = Vector3d::Zero();
  for (int k = 0; k < n; ++k) mean += point(k) / n;
  double volume = 0.0;
  for (const std::array<int, 4>& face : cell_faces(cell.type)) {
    // Outward faces: the mean lies behind them, so the tetrahedron with the mean as apex is negative.
    if (face[3] < 0) {
      volume -= tetrahedron_volume(point(face[0]), point(face[1]), point(face[2]), mean);
      continue;
    }
    const Vector3d centre = (point(face[0]) + point(face[1]) + point(face[2]) + point(face[3])) / 4.0;
    for (int k = 0; k < 4; ++k)
      volume -= tetrahedron_volume(point(face[k]), point(face[(k + 1) % 4]), centre, mean);
  }
  return volume;
}

void validate(const ControlLattice& lattice) {
  check_cells(lattice.complex);
  std::vector<Edge> edges;
  for (const Cell& cell : lattice.complex.cells)
    for (const std::array<int, 2>& e : cell_edges(cell.type))
      edges.push_back(ordered(cell.vertices[e[0]], cell.vertices[e[1]]));
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  for (const LatticeBone& bone : lattice.bones) check_chain(lattice, bone, edges);
}

}  // namespace sinew::lattice
