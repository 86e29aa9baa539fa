#include "lattice/detail/inspection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <Eigen/Geometry>

#include "lattice/detail/cell_locator.h"
#include "lattice/detail/segments.h"
#include "lattice/detail/triangle_grid.h"
#include "lattice/limb_copies.h"
#include "lattice/quality.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// A point this near a cell (a share of the cell's size) counts as inside: rounding of positions and of the
/// containment test.
constexpr double kInsideSlack = 1e-9;
/// Chain vertices may leave their bone by this share of the lattice's size: (1 - s) a + s b rounds at 1e-16.
constexpr double kChainTolerance = 1e-12;
constexpr int kVoxelsAcross = 32;  ///< for the skin's volume.

/// The boundary of a complex in triangles, quadrilaterals split about their mean, with the cell behind each.
struct Boundary {
  std::vector<TriangleCorners> triangles;
  std::vector<int> cells;
};

/// Faces that one cell alone has.
Boundary boundary_of(const CellComplex& complex) {
  struct Face {
    std::array<int, 4> key, vertices;
    int cell;
  };
  std::vector<Face> faces;
  for (int c = 0; c < static_cast<int>(complex.cells.size()); ++c)
    for (const std::array<int, 4>& corners : cell_faces(complex.cells[c].type)) {
      Face face;
      for (int k = 0; k < 4; ++k)
        face.vertices[k] = corners[k] < 0 ? -1 : complex.cells[c].vertices[corners[k]];
      face.key = face.vertices;
      std::sort(face.key.begin(), face.key.end());
      face.cell = c;
      faces.push_back(face);
    }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.key < b.key; });
  Boundary boundary;
  const auto point = [&](int v) -> Vector3d { return complex.points.row(v).transpose(); };
  const auto add = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c, int cell) {
    boundary.triangles.push_back({a, b, c});
    boundary.cells.push_back(cell);
  };
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t j = i + 1;
    while (j < faces.size() && faces[j].key == faces[i].key) ++j;
    if (j == i + 1) {
      const std::array<int, 4>& v = faces[i].vertices;
      if (v[3] < 0) {
        add(point(v[0]), point(v[1]), point(v[2]), faces[i].cell);
      } else {
        const Vector3d centre = 0.25 * (point(v[0]) + point(v[1]) + point(v[2]) + point(v[3]));
        for (int k = 0; k < 4; ++k) add(point(v[k]), point(v[(k + 1) % 4]), centre, faces[i].cell);
      }
    }
    i = j;
  }
  return boundary;
}

/// The skin as the gate sees it: which frame every vertex follows, and which cells are its own.
class SkinInCells {
 public:
  SkinInCells(const ControlLattice& lattice, const Surface& skin)
      : skin_(skin), locator_(lattice.complex), copies_(lattice), frame_(skin.points.rows(), -1) {
    if (lattice.frame_of_joint.empty()) return;
    for (std::size_t v = 0; v < skin.weights.size(); ++v)
      frame_[v] = skin_frame(skin.weights[v], lattice.frame_of_joint);
  }
  Vector3d point(int vertex) const { return skin_.points.row(vertex).transpose(); }
  bool owns(int cell, int vertex) const { return copies_.owns(cell, frame_[vertex], point(vertex)); }
  bool is_inside(int vertex) {
    locator_.find_all(point(vertex), kInsideSlack, cells_);
    return std::any_of(cells_.begin(), cells_.end(), [&](int c) { return owns(c, vertex); });
  }

 private:
  const Surface& skin_;
  CellLocator locator_;
  LimbCopies copies_;
  std::vector<int> frame_;
  std::vector<int> cells_;
};

/// Triangles that cross a boundary face of the lattice, though all their vertices are inside. The faces of a
/// copy concern its own limb only.
std::vector<int> find_triangles_outside(const CellComplex& complex, const Surface& skin,
                                        const SkinInCells& places, const std::vector<bool>& vertex_outside,
                                        double size) {
  const double side = size / std::cbrt(static_cast<double>(complex.cells.size()));
  const Boundary boundary = boundary_of(complex);
  const TriangleGrid grid(boundary.triangles, side);
  std::vector<int> outside;
  for (int t = 0; t < skin.triangles.rows(); ++t) {
    const std::array<int, 3> v{skin.triangles(t, 0), skin.triangles(t, 1), skin.triangles(t, 2)};
    if (vertex_outside[v[0]] || vertex_outside[v[1]] || vertex_outside[v[2]]) continue;
    const auto concerns_others = [&](int face) {
      return std::none_of(v.begin(), v.end(),
                          [&](int corner) { return places.owns(boundary.cells[face], corner); });
    };
    const TriangleCorners corners{places.point(v[0]), places.point(v[1]), places.point(v[2])};
    if (!grid.for_each_crossing(corners, kInsideSlack * size, concerns_others)) outside.push_back(t);
  }
  return outside;
}

/// Volume of what is inside the skin [m^3].
double skin_volume(const UnitSkin& skin) {
  const Vector3d low = skin.points.colwise().minCoeff();
  const Vector3d size = skin.points.colwise().maxCoeff().transpose() - low;
  const Eigen::Vector3i count = (size * kVoxelsAcross).array().ceil().cast<int>().max(1);
  const Vector3d voxel = size.cwiseQuotient(count.cast<double>());
  int inside = 0;
  for (int i = 0; i < count.x(); ++i)
    for (int j = 0; j < count.y(); ++j)
      for (int k = 0; k < count.z(); ++k)
        inside += skin.is_inside(low + voxel.cwiseProduct(Vector3d(i + 0.5, j + 0.5, k + 0.5)));
  return inside * voxel.prod() * std::pow(skin.scale, 3);
}

bool is_exact_chain(const ControlLattice& lattice, const LatticeBone& bone,
                    const std::vector<std::pair<int, int>>& edges, double size) {
  if (bone.chain.size() < 2) return false;
  const auto point = [&](int v) -> Vector3d { return lattice.complex.points.row(v).transpose(); };
  if (point(bone.chain.front()) != bone.rest_start || point(bone.chain.back()) != bone.rest_end) return false;
  for (std::size_t i = 0; i < bone.chain.size(); ++i) {
    if (point_segment_distance(point(bone.chain[i]), bone.rest_start, bone.rest_end) > kChainTolerance * size)
      return false;
    if (i > 0 && !std::binary_search(edges.begin(), edges.end(),
                                     std::pair<int, int>(std::minmax(bone.chain[i - 1], bone.chain[i])))) {
      return false;
    }
  }
  return true;
}

void find_broken_chains(const ControlLattice& lattice, double size, Inspection& out) {
  std::vector<std::pair<int, int>> edges;
  for (const Cell& cell : lattice.complex.cells)
    for (const std::array<int, 2>& e : cell_edges(cell.type))
      edges.push_back(std::minmax(cell.vertices[e[0]], cell.vertices[e[1]]));
  std::sort(edges.begin(), edges.end());
  for (const LatticeBone& bone : lattice.bones)
    if (!bone.soft && !is_exact_chain(lattice, bone, edges, size)) out.broken_chains.push_back(bone.name);
  out.quality.exact_chains = out.broken_chains.empty();
}

void measure_cells(const ControlLattice& lattice, Inspection& out) {
  const CellComplex& complex = lattice.complex;
  std::vector<bool> is_double(complex.cells.size(), false);  // its place is counted already
  for (const CellCopy& copy : lattice.copies) is_double[copy.cell] = copy.cell != copy.place;
  LatticeQuality& q = out.quality;
  q.min_dihedral_degrees = 180.0;
  q.min_scaled_jacobian = 1.0;
  q.min_volume = std::numeric_limits<double>::infinity();
  for (int c = 0; c < static_cast<int>(complex.cells.size()); ++c) {
    const double dihedral = min_dihedral_degrees(complex, complex.cells[c]);
    const double jacobian = min_scaled_jacobian(complex, complex.cells[c]);
    const double volume = cell_volume(complex, complex.cells[c]);
    if (!(volume > 0.0)) out.inverted_cells.push_back(c);
    if (dihedral < q.min_dihedral_degrees) q.min_dihedral_degrees = dihedral, out.flattest_cell = c;
    if (jacobian < q.min_scaled_jacobian) q.min_scaled_jacobian = jacobian, out.most_skewed_cell = c;
    q.min_volume = std::min(q.min_volume, volume);
    if (!is_double[c]) q.volume_ratio += volume;
  }
}

}  // namespace

std::vector<TriangleCorners> boundary_triangles(const CellComplex& complex) {
  return boundary_of(complex).triangles;
}

std::vector<std::vector<int>> components(const CellComplex& complex) {
  std::vector<int> parent(complex.points.rows());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const Cell& cell : complex.cells)
    for (int k = 1; k < num_corners(cell.type); ++k) {
      const int a = root(cell.vertices[0]), b = root(cell.vertices[k]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  std::vector<int> number(complex.points.rows(), -1);
  std::vector<std::vector<int>> parts;
  for (int c = 0; c < static_cast<int>(complex.cells.size()); ++c) {
    const int r = root(complex.cells[c].vertices[0]);
    if (number[r] < 0) {
      number[r] = static_cast<int>(parts.size());
      parts.emplace_back();
    }
    parts[number[r]].push_back(c);
  }
  return parts;
}

std::vector<std::vector<int>> floating_components(const ControlLattice& lattice) {
  const CellLocator locator(lattice.complex);
  const LimbCopies copies(lattice);
  std::vector<bool> vertex_held(lattice.complex.points.rows(), false);
  std::vector<bool> cell_held(lattice.complex.cells.size(), false);
  const auto hold = [&](int frame, const Vector3d& p) {
    const int cell = locator.find(p, kInsideSlack);
    if (cell >= 0) cell_held[copies.own_copy(cell, frame, p)] = true;
  };
  for (const LatticeBone& bone : lattice.bones) {
    for (int v : bone.chain) vertex_held[v] = true;
    if (!bone.soft) continue;
    for (const double s : {0.0, 0.25, 0.5, 0.75, 1.0})
      hold(bone.frame, (1.0 - s) * bone.rest_start + s * bone.rest_end);
  }
  for (const SoftFrame& frame : lattice.soft_frames) hold(frame.frame, frame.position);

  std::vector<std::vector<int>> floating;
  for (const std::vector<int>& part : components(lattice.complex)) {
    const bool held = std::any_of(part.begin(), part.end(), [&](int c) {
      const Cell& cell = lattice.complex.cells[c];
      return cell_held[c] ||
             std::any_of(cell.vertices.begin(), cell.vertices.begin() + num_corners(cell.type),
                         [&](int v) { return vertex_held[v]; });
    });
    if (!held) floating.push_back(part);
  }
  return floating;
}

Inspection inspect(const ControlLattice& lattice, const Surface& skin, const UnitSkin& unit,
                   const Poll& poll) {
  const CellComplex& complex = lattice.complex;
  if (complex.cells.empty()) throw std::invalid_argument("lattice: there is no cell");
  const double size = (complex.points.colwise().maxCoeff() - complex.points.colwise().minCoeff()).maxCoeff();
  Inspection out;
  poll();
  measure_cells(lattice, out);
  poll();
  const double volume = skin_volume(unit);
  out.quality.volume_ratio =
      volume > 0.0 ? out.quality.volume_ratio / volume : std::numeric_limits<double>::infinity();

  SkinInCells places(lattice, skin);
  std::vector<bool> vertex_outside(skin.points.rows(), false);
  for (int v = 0; v < skin.points.rows(); ++v) {
    poll();
    if (places.is_inside(v)) continue;
    vertex_outside[v] = true;
    out.vertices_outside.push_back(v);
  }
  out.quality.skin_vertices_outside = static_cast<int>(out.vertices_outside.size());
  poll();
  out.triangles_outside = find_triangles_outside(complex, skin, places, vertex_outside, size);
  out.quality.skin_triangles_outside = static_cast<int>(out.triangles_outside.size());
  poll();
  find_broken_chains(lattice, size, out);
  poll();
  out.floating = floating_components(lattice);
  out.quality.components = static_cast<int>(components(complex).size());
  out.quality.components_without_bone = static_cast<int>(out.floating.size());
  return out;
}

}  // namespace sinew::lattice::detail
