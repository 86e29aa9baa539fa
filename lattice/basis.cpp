#include "lattice/basis.h"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

namespace sinew::lattice {

ActiveSet uniform_active_set(const Hierarchy& hierarchy, int level,
                             const std::vector<std::vector<int>>& chains) {
  ActiveSet active(static_cast<std::size_t>(hierarchy.num_vertices()), 0);
  std::fill_n(active.begin(), hierarchy.num_vertices(level), std::uint8_t{1});
  std::set<std::pair<int, int>> pieces;
  for (const auto& chain : chains) {
    for (std::size_t k = 1; k < chain.size(); ++k) pieces.insert(std::minmax(chain[k - 1], chain[k]));
  }
  for (int v = hierarchy.num_vertices(0); v < hierarchy.num_vertices(level); ++v) {
    const auto parents = hierarchy.parents(v);
    if (parents.size() != 2) continue;
    if (!pieces.contains(std::minmax(parents[0], parents[1]))) continue;
    active[static_cast<std::size_t>(v)] = 0;
    pieces.insert(std::minmax(parents[0], v));
    pieces.insert(std::minmax(v, parents[1]));
  }
  return active;
}

namespace {

struct CellRef {
  int level;
  int hex;
};

/// Leaf cells in hierarchy order (coarse cell by coarse cell, children in corner order).
std::vector<CellRef> find_leaf_cells(const Hierarchy& hierarchy, const ActiveSet& active) {
  const int num_levels = hierarchy.num_levels();
  // split[j][h]: hexahedron h of level j has an active function of a finer level on it.
  std::vector<std::vector<std::uint8_t>> split(static_cast<std::size_t>(num_levels) + 1);
  for (int level = num_levels; level >= 2; --level) {
    const auto& hexes = hierarchy.hexes(level);
    auto& coarser = split[static_cast<std::size_t>(level) - 1];
    coarser.assign(hierarchy.hexes(level - 1).size(), 0);
    for (std::size_t h = 0; h < hexes.size(); ++h) {
      bool here = level < num_levels && split[static_cast<std::size_t>(level)][h];
      for (int v : hexes[h])
        here = here || (hierarchy.level(v) == level && active[static_cast<std::size_t>(v)]);
      if (here) coarser[h / 8] = 1;
    }
  }
  std::vector<CellRef> leaves;
  const auto descend = [&](const auto& self, int level, int hex) -> void {
    if (level < num_levels && split[static_cast<std::size_t>(level)][static_cast<std::size_t>(hex)]) {
      for (int k = 0; k < 8; ++k) self(self, level + 1, 8 * hex + k);
    } else {
      leaves.push_back({level, hex});
    }
  };
  for (int h = 0; h < static_cast<int>(hierarchy.hexes(1).size()); ++h) descend(descend, 1, h);
  return leaves;
}

/// Fills vertices, functions, points and the value rows from cells given by hierarchy vertices.
LeafMesh finish(const Hierarchy& hierarchy, const std::vector<CellRef>& refs,
                std::span<const std::uint8_t> is_active) {
  LeafMesh mesh;
  std::vector<std::uint8_t> used(static_cast<std::size_t>(hierarchy.num_vertices()), 0);
  for (const CellRef& ref : refs) {
    for (int v : hierarchy.hexes(ref.level)[static_cast<std::size_t>(ref.hex)])
      used[static_cast<std::size_t>(v)] = 1;
  }
  // A parent may lie outside the kept cells' corners when cells were dropped; its value is still needed.
  for (int v = hierarchy.num_vertices() - 1; v >= 0; --v) {
    if (!used[static_cast<std::size_t>(v)]) continue;
    for (int p : hierarchy.parents(v)) used[static_cast<std::size_t>(p)] = 1;
  }
  mesh.leaf_of_vertex.assign(used.size(), -1);
  std::vector<int> function_of_vertex(used.size(), -1);
  for (int v = 0; v < hierarchy.num_vertices(); ++v) {
    const auto i = static_cast<std::size_t>(v);
    if (!used[i]) continue;
    mesh.leaf_of_vertex[i] = mesh.num_vertices();
    mesh.vertices.push_back(v);
    if (is_active[i]) {
      function_of_vertex[i] = mesh.num_functions();
      mesh.functions.push_back(v);
    }
  }
  mesh.points.resize(mesh.num_vertices(), 3);
  for (int a = 0; a < mesh.num_vertices(); ++a) {
    mesh.points.row(a) = hierarchy.points().row(mesh.vertices[static_cast<std::size_t>(a)]);
  }
  for (const CellRef& ref : refs) {
    HexVertices cell = hierarchy.hexes(ref.level)[static_cast<std::size_t>(ref.hex)];
    for (int& v : cell) v = mesh.leaf_of_vertex[static_cast<std::size_t>(v)];
    mesh.cells.push_back(cell);
    mesh.level.push_back(ref.level);
    mesh.hex.push_back(ref.hex);
  }
  // Two-scale relation read backwards: value(v) = [v active] q_v + mean of the parents' values, coarse to
  // fine.
  Eigen::SparseMatrix<double, Eigen::RowMajor> rows(mesh.num_vertices(), mesh.num_functions());
  std::vector<std::vector<std::pair<int, double>>> row_of(static_cast<std::size_t>(mesh.num_vertices()));
  std::vector<Eigen::Triplet<double>> triplets;
  for (int a = 0; a < mesh.num_vertices(); ++a) {
    const int v = mesh.vertices[static_cast<std::size_t>(a)];
    auto& row = row_of[static_cast<std::size_t>(a)];
    const auto parents = hierarchy.parents(v);
    for (int p : parents) {
      const int b = mesh.leaf_of_vertex[static_cast<std::size_t>(p)];
      for (const auto& [f, w] : row_of[static_cast<std::size_t>(b)]) {
        row.emplace_back(f, w / static_cast<double>(parents.size()));
      }
    }
    std::sort(row.begin(), row.end());
    std::size_t kept = 0;
    for (std::size_t k = 0; k < row.size(); ++k) {
      if (kept > 0 && row[kept - 1].first == row[k].first) {
        row[kept - 1].second += row[k].second;
      } else {
        row[kept++] = row[k];
      }
    }
    row.resize(kept);
    const int f = function_of_vertex[static_cast<std::size_t>(v)];
    if (f >= 0) row.emplace_back(f, 1.0);
    for (const auto& [column, w] : row) triplets.emplace_back(a, column, w);
  }
  rows.setFromTriplets(triplets.begin(), triplets.end());
  mesh.values_from_coefficients = std::move(rows);
  return mesh;
}

}  // namespace

LeafMesh leaf_mesh(const Hierarchy& hierarchy, const ActiveSet& active, std::span<const std::uint8_t> kept) {
  if (static_cast<int>(active.size()) != hierarchy.num_vertices()) {
    throw std::invalid_argument("leaf_mesh: the active set must have one flag per vertex of the hierarchy");
  }
  for (int v = 0; v < hierarchy.num_vertices(0); ++v) {
    if (!active[static_cast<std::size_t>(v)]) {
      throw std::invalid_argument("leaf_mesh: a level-0 function is inactive; they must all be active");
    }
  }
  if (!kept.empty() && kept.size() != hierarchy.coarse().cells.size())
    throw std::invalid_argument("leaf_mesh: expected one flag per cell of level 0");
  std::vector<CellRef> cells = find_leaf_cells(hierarchy, active);
  if (!kept.empty())
    std::erase_if(cells, [&](const CellRef& ref) {
      return !kept[static_cast<std::size_t>(hierarchy.coarse_cell(ref.hex >> (3 * (ref.level - 1))))];
    });
  return finish(hierarchy, cells, active);
}

LeafMesh restrict_cells(const Hierarchy& hierarchy, const LeafMesh& mesh,
                        std::span<const std::uint8_t> keep) {
  std::vector<CellRef> refs;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    if (keep[c]) refs.push_back({mesh.level[c], mesh.hex[c]});
  }
  ActiveSet active(static_cast<std::size_t>(hierarchy.num_vertices()), 0);
  for (int v : mesh.functions) active[static_cast<std::size_t>(v)] = 1;
  return finish(hierarchy, refs, active);
}

int coarse_cell(const Hierarchy& hierarchy, const LeafMesh& mesh, int cell) {
  const auto c = static_cast<std::size_t>(cell);
  return hierarchy.coarse_cell(mesh.hex[c] >> (3 * (mesh.level[c] - 1)));
}

std::vector<int> containing_cells(const LeafMesh& fine, const LeafMesh& mesh) {
  // Leaf cells stand in the order of their hexahedra, so those that lie in one follow each other.
  std::vector<int> containing;
  containing.reserve(fine.cells.size());
  std::size_t leaf = 0;
  const auto holds = [&](std::size_t c) {
    if (leaf >= mesh.cells.size() || mesh.level[leaf] > fine.level[c]) return false;
    return fine.hex[c] >> (3 * (fine.level[c] - mesh.level[leaf])) == mesh.hex[leaf];
  };
  for (std::size_t c = 0; c < fine.cells.size(); ++c) {
    if (!holds(c) && c > 0) ++leaf;
    if (!holds(c))
      throw std::invalid_argument("leaf meshes: cell " + std::to_string(c) +
                                  " lies in no cell of the other, expected two sets of one flesh");
    containing.push_back(static_cast<int>(leaf));
  }
  return containing;
}

Points carried_values(const Hierarchy& hierarchy, const LeafMesh& from, const LeafMesh& to,
                      const Points& values) {
  std::vector<std::uint8_t> known(static_cast<std::size_t>(hierarchy.num_vertices()), 0);
  Points all = Points::Zero(hierarchy.num_vertices(), 3);
  for (int a = 0; a < from.num_vertices(); ++a) {
    const int vertex = from.vertices[static_cast<std::size_t>(a)];
    known[static_cast<std::size_t>(vertex)] = 1;
    all.row(vertex) = values.row(a);
  }
  for (int vertex : to.vertices) {
    if (hierarchy.level(vertex) == 0 && !known[static_cast<std::size_t>(vertex)])
      throw std::invalid_argument("leaf meshes: vertex " + std::to_string(vertex) +
                                  " of level 0 is in one of them only, expected two sets of one flesh");
  }
  fill_inactive(hierarchy, known, all);
  Points carried(to.num_vertices(), 3);
  for (int a = 0; a < to.num_vertices(); ++a)
    carried.row(a) = all.row(to.vertices[static_cast<std::size_t>(a)]);
  return carried;
}

}  // namespace sinew::lattice
