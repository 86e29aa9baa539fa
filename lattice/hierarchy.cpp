#include "lattice/hierarchy.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>
#include <unordered_map>

namespace sinew::lattice {
namespace {

const std::vector<std::array<int, 3>> kTetNeighbours{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
const std::vector<std::array<int, 3>> kWedgeNeighbours{{1, 2, 3}, {2, 0, 4}, {0, 1, 5},
                                                       {5, 4, 0}, {3, 5, 1}, {4, 3, 2}};
const std::vector<std::array<int, 3>> kHexNeighbours{{1, 3, 4}, {2, 0, 5}, {3, 1, 6}, {0, 2, 7},
                                                     {7, 5, 0}, {4, 6, 1}, {5, 7, 2}, {6, 4, 3}};

/// Sorted vertices of an edge (two used) or face (three smallest identify it: two faces of a complex that
/// share three vertices are the same face).
using Key = std::array<int, 3>;
struct KeyHash {
  std::size_t operator()(const Key& k) const {
    std::uint64_t h = 1469598103934665603ULL;
    for (int v : k) h = (h ^ static_cast<std::uint64_t>(static_cast<std::uint32_t>(v))) * 1099511628211ULL;
    return static_cast<std::size_t>(h ^ (h >> 29));
  }
};
using Lookup = std::unordered_map<Key, int, KeyHash>;  // looked up only, never walked: order plays no part

Key edge_key(int a, int b) { return {std::min(a, b), std::max(a, b), -1}; }

/// Vertices ascending; unused places stay behind them.
using FaceVertices = std::array<int, 4>;
constexpr int kUnused = std::numeric_limits<int>::max();

Key face_key(const FaceVertices& sorted) { return {sorted[0], sorted[1], sorted[2]}; }

}  // namespace

std::span<const std::array<int, 3>> corner_neighbours(CellType type) {
  return type == CellType::Tetrahedron ? kTetNeighbours
         : type == CellType::Wedge     ? kWedgeNeighbours
                                       : kHexNeighbours;
}

Eigen::Vector3d in_parent(int child, const Eigen::Vector3d& xi) {
  const auto corner = [](int k) {
    const std::array<int, 3>& at = kCorners[static_cast<std::size_t>(k)];
    return Eigen::Vector3d(at[0], at[1], at[2]);
  };
  const std::array<int, 3>& neighbours = kHexNeighbours[static_cast<std::size_t>(child)];
  Eigen::Vector3d result = corner(child);
  for (int d = 0; d < 3; ++d)
    result += 0.5 * xi[d] * (corner(neighbours[static_cast<std::size_t>(d)]) - corner(child));
  return result;
}

namespace {

/// Local face of a cell type that holds corner `a` and its neighbours `b` and `c`.
int face_of_corner(CellType type, int a, int b, int c) {
  const auto faces = cell_faces(type);
  for (int f = 0; f < static_cast<int>(faces.size()); ++f) {
    const auto& face = faces[static_cast<std::size_t>(f)];
    const auto has = [&](int v) { return std::find(face.begin(), face.end(), v) != face.end(); };
    if (has(a) && has(b) && has(c)) return f;
  }
  return -1;
}

/// Corner, neighbour edges and faces of every corner of a cell type, found once.
struct CornerRecipe {
  std::array<int, 3> neighbours;
  std::array<int, 3> faces;  ///< of (n0,n1), (n0,n2), (n1,n2).
};

std::vector<CornerRecipe> make_recipe(CellType type) {
  std::vector<CornerRecipe> recipe;
  const auto neighbours = corner_neighbours(type);
  for (int a = 0; a < num_corners(type); ++a) {
    const auto& n = neighbours[static_cast<std::size_t>(a)];
    recipe.push_back({n,
                      {face_of_corner(type, a, n[0], n[1]), face_of_corner(type, a, n[0], n[2]),
                       face_of_corner(type, a, n[1], n[2])}});
  }
  return recipe;
}

const std::vector<CornerRecipe>& recipe_of(CellType type) {
  static const std::vector<CornerRecipe> tet = make_recipe(CellType::Tetrahedron);
  static const std::vector<CornerRecipe> wedge = make_recipe(CellType::Wedge);
  static const std::vector<CornerRecipe> hex = make_recipe(CellType::Hexahedron);
  return type == CellType::Tetrahedron ? tet : type == CellType::Wedge ? wedge : hex;
}

}  // namespace

Hierarchy::Hierarchy(const CellComplex& complex, int num_levels) : coarse_(complex) {
  if (num_levels < 1 || num_levels > 6) {
    throw std::invalid_argument("Hierarchy: num_levels is " + std::to_string(num_levels) +
                                ", expected 1 to 6");
  }
  const int n = static_cast<int>(complex.points.rows());
  for (std::size_t c = 0; c < complex.cells.size(); ++c) {
    for (int k = 0; k < num_corners(complex.cells[c].type); ++k) {
      const int v = complex.cells[c].vertices[static_cast<std::size_t>(k)];
      if (v < 0 || v >= n) {
        throw std::invalid_argument("Hierarchy: cell " + std::to_string(c) + " names vertex " +
                                    std::to_string(v) + ", expected 0 to " + std::to_string(n - 1));
      }
    }
    if (!(cell_volume(complex, complex.cells[c]) > 0.0)) {
      throw std::invalid_argument("Hierarchy: cell " + std::to_string(c) + " has no positive volume");
    }
  }
  coordinates_.assign(complex.points.data(), complex.points.data() + complex.points.size());
  level_.assign(static_cast<std::size_t>(n), 0);
  parent_offsets_.assign(static_cast<std::size_t>(n) + 1, 0);
  num_vertices_.push_back(n);
  subdivide_coarse();
  while (static_cast<int>(hexes_.size()) < num_levels) subdivide_hexes();
  points_ = Eigen::Map<const Points>(coordinates_.data(), num_vertices_.back(), 3);
  coordinates_.clear();
  coordinates_.shrink_to_fit();
}

int Hierarchy::add_vertex(std::span<const int> parents) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int p : parents)
    mean += Eigen::Map<const Eigen::Vector3d>(coordinates_.data() + 3 * static_cast<std::size_t>(p));
  mean /= static_cast<double>(parents.size());
  coordinates_.insert(coordinates_.end(), mean.data(), mean.data() + 3);
  parents_.insert(parents_.end(), parents.begin(), parents.end());
  parent_offsets_.push_back(static_cast<int>(parents_.size()));
  level_.push_back(static_cast<std::uint8_t>(num_vertices_.size()));
  return static_cast<int>(level_.size()) - 1;
}

namespace {

/// Subdivides one cell: looks its edge, face and cell points up (making them where new) and returns one
/// hexahedron per corner. AddVertex: (span<const int>) -> int.
template <class AddVertex>
void subdivide_cell(CellType type, std::span<const int> cell, Lookup& lookup, const AddVertex& add_vertex,
                    std::vector<HexVertices>& out) {
  const auto find_or_add = [&](const Key& key, std::span<const int> parents) {
    const auto found = lookup.find(key);
    if (found != lookup.end()) return found->second;
    const int vertex = add_vertex(parents);
    lookup.emplace(key, vertex);
    return vertex;
  };
  const auto vertex = [&](int k) { return cell[static_cast<std::size_t>(k)]; };
  const auto faces = cell_faces(type);
  std::array<int, 6> face_points{};
  for (std::size_t f = 0; f < faces.size(); ++f) {
    FaceVertices vertices;
    vertices.fill(kUnused);
    const std::size_t n = faces[f][3] < 0 ? 3 : 4;
    for (std::size_t k = 0; k < n; ++k) vertices[k] = vertex(faces[f][k]);
    // Ascending order: the mean of a face has the same bits from both sides.
    std::sort(vertices.begin(), vertices.end());
    face_points[f] = find_or_add(face_key(vertices), std::span<const int>(vertices.data(), n));
  }
  const int cell_point = add_vertex(cell);
  const auto edge_point = [&](int a, int b) {
    const std::array<int, 2> ends{std::min(vertex(a), vertex(b)), std::max(vertex(a), vertex(b))};
    return find_or_add(edge_key(ends[0], ends[1]), ends);
  };
  const auto& recipe = recipe_of(type);
  for (int a = 0; a < num_corners(type); ++a) {
    const auto& r = recipe[static_cast<std::size_t>(a)];
    const auto face = [&](int i) {
      return face_points[static_cast<std::size_t>(r.faces[static_cast<std::size_t>(i)])];
    };
    out.push_back({vertex(a), edge_point(a, r.neighbours[0]), face(0), edge_point(a, r.neighbours[1]),
                   edge_point(a, r.neighbours[2]), face(1), cell_point, face(2)});
  }
}

}  // namespace

void Hierarchy::subdivide_coarse() {
  std::vector<HexVertices> hexes;
  Lookup lookup;
  const auto add = [&](std::span<const int> parents) { return add_vertex(parents); };
  for (std::size_t c = 0; c < coarse_.cells.size(); ++c) {
    const Cell& cell = coarse_.cells[c];
    const auto n = static_cast<std::size_t>(num_corners(cell.type));
    first_hex_.push_back(static_cast<int>(hexes.size()));
    subdivide_cell(cell.type, std::span<const int>(cell.vertices.data(), n), lookup, add, hexes);
    coarse_cell_.insert(coarse_cell_.end(), n, static_cast<int>(c));
  }
  hexes_.push_back(std::move(hexes));
  num_vertices_.push_back(static_cast<int>(level_.size()));
}

void Hierarchy::subdivide_hexes() {
  std::vector<HexVertices> fine;
  const std::vector<HexVertices>& hexes = hexes_.back();
  fine.reserve(8 * hexes.size());
  Lookup lookup;
  const auto add = [&](std::span<const int> parents) { return add_vertex(parents); };
  for (const HexVertices& hex : hexes) subdivide_cell(CellType::Hexahedron, hex, lookup, add, fine);
  hexes_.push_back(std::move(fine));
  num_vertices_.push_back(static_cast<int>(level_.size()));
}

namespace {

Eigen::RowVector3d parent_mean(const Hierarchy& hierarchy, int vertex, const Points& values) {
  Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
  const auto parents = hierarchy.parents(vertex);
  for (int p : parents) mean += values.row(p);
  return mean / static_cast<double>(parents.size());
}

}  // namespace

void fill_inactive(const Hierarchy& hierarchy, std::span<const std::uint8_t> is_active, Points& values) {
  for (int v = hierarchy.num_vertices(0); v < hierarchy.num_vertices(); ++v) {
    if (!is_active[static_cast<std::size_t>(v)]) values.row(v) = parent_mean(hierarchy, v, values);
  }
}

Points analyse(const Hierarchy& hierarchy, const Points& values) {
  Points coefficients = values;
  for (int v = hierarchy.num_vertices(0); v < hierarchy.num_vertices(); ++v) {
    coefficients.row(v) -= parent_mean(hierarchy, v, values);
  }
  return coefficients;
}

Points synthesise(const Hierarchy& hierarchy, const Points& coefficients) {
  Points values = coefficients;
  for (int v = hierarchy.num_vertices(0); v < hierarchy.num_vertices(); ++v) {
    values.row(v) += parent_mean(hierarchy, v, values);
  }
  return values;
}

}  // namespace sinew::lattice
