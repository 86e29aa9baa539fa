#include "lattice/check_cells.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lattice/detail/cell_locator.h"
#include "lattice/detail/cell_overlap.h"
#include "lattice/detail/place_grid.h"
#include "lattice/hierarchy.h"
#include "lattice/quality.h"
#include "lattice/surface_query.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kShown = 20;

Vector3d point(const CellComplex& complex, int v) { return complex.points.row(v).transpose(); }

/// Determinant of the three edges at corner k, each of length 1; 0 where an edge has no length.
double scaled_corner(const CellComplex& complex, const Cell& cell, int k) {
  const std::array<int, 3>& n = corner_neighbours(cell.type)[static_cast<std::size_t>(k)];
  const Vector3d p = point(complex, cell.vertices[k]);
  const Vector3d a = point(complex, cell.vertices[n[0]]) - p, b = point(complex, cell.vertices[n[1]]) - p,
                 c = point(complex, cell.vertices[n[2]]) - p;
  const double lengths = a.norm() * b.norm() * c.norm();
  return lengths > 0.0 ? a.cross(b).dot(c) / lengths : 0.0;
}

/// The other orientation of a cell.
Cell turned(Cell cell) {
  std::array<int, 8>& v = cell.vertices;
  if (cell.type == CellType::Tetrahedron) {
    std::swap(v[0], v[1]);
  } else {
    const int half = num_corners(cell.type) / 2;
    for (int k = 0; k < half; ++k) std::swap(v[k], v[k + half]);
  }
  return cell;
}

/// A face of a cell by its vertices, so that the faces of neighbours compare.
struct Face {
  std::array<int, 4> key;       ///< ascending; -1 first for triangles.
  std::array<int, 4> vertices;  ///< as the cell has them; the fourth of a triangle is -1.
  int cell;
  bool is_triangle() const { return vertices[3] < 0; }
};

/// Where the smallest vertex of a face is in its cycle.
int smallest_corner(const Face& face) {
  const int n = face.is_triangle() ? 3 : 4;
  return static_cast<int>(std::min_element(face.vertices.begin(), face.vertices.begin() + n) -
                          face.vertices.begin());
}

/// The cycle of a face from its smallest vertex, forwards or backwards.
std::array<int, 4> cycle(const Face& face, int direction) {
  const int n = face.is_triangle() ? 3 : 4, first = smallest_corner(face);
  std::array<int, 4> out{-1, -1, -1, -1};
  for (int k = 0; k < n; ++k) out[k] = face.vertices[(first + direction * k + n) % n];
  return out;
}

std::vector<Face> sorted_faces(const CellComplex& complex) {
  std::vector<Face> faces;
  for (std::size_t c = 0; c < complex.cells.size(); ++c) {
    const Cell& cell = complex.cells[c];
    for (const std::array<int, 4>& corners : cell_faces(cell.type)) {
      Face face;
      face.cell = static_cast<int>(c);
      for (int k = 0; k < 4; ++k) face.vertices[k] = corners[k] < 0 ? -1 : cell.vertices[corners[k]];
      face.key = face.vertices;
      std::sort(face.key.begin(), face.key.end());
      faces.push_back(face);
    }
  }
  std::sort(faces.begin(), faces.end(),
            [](const Face& a, const Face& b) { return a.key != b.key ? a.key < b.key : a.cell < b.cell; });
  return faces;
}

/// Distance from p to a face, quadrilaterals split about their mean.
double distance(const CellComplex& complex, const Face& face, const Vector3d& p) {
  const auto corner = [&](int k) { return point(complex, face.vertices[k]); };
  if (face.is_triangle()) return (closest_on_triangle(p, corner(0), corner(1), corner(2)) - p).norm();
  const Vector3d mean = 0.25 * (corner(0) + corner(1) + corner(2) + corner(3));
  double nearest = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 4; ++k)
    nearest = std::min(nearest, (closest_on_triangle(p, corner(k), corner((k + 1) % 4), mean) - p).norm());
  return nearest;
}

using Box = Eigen::AlignedBox<double, 3>;

Box box_of(const CellComplex& complex, const Cell& cell) {
  Box box;
  for (int k = 0; k < num_corners(cell.type); ++k) box.extend(point(complex, cell.vertices[k]));
  return box;
}

/// True where the plane of some face of one cell has this cell behind it and the other one beyond, but for a
/// layer of thickness `layer`: quick, and so for nearly all neighbours.
bool is_separated(const CellComplex& complex, const Cell& one, const Cell& other, double layer) {
  const auto all_of = [&](const Cell& cell, const auto& holds) {
    for (int k = 0; k < num_corners(cell.type); ++k)
      if (!holds(point(complex, cell.vertices[k]))) return false;
    return true;
  };
  for (const std::array<int, 4>& face : cell_faces(one.type)) {
    const auto corner = [&](int k) { return point(complex, one.vertices[face[k]]); };
    const bool is_triangle = face[3] < 0;
    const Vector3d across = corner(2) - corner(0),
                   along = (is_triangle ? corner(1) - corner(0) : corner(3) - corner(1));
    // Of outward faces: (2-0) x (3-1) points out, and so does (1-0) x (2-0).
    const Vector3d normal = (is_triangle ? along.cross(across) : across.cross(along)).stableNormalized();
    const Vector3d mean =
        is_triangle ? corner(0) : Vector3d(0.25 * (corner(0) + corner(1) + corner(2) + corner(3)));
    if (all_of(one, [&](const Vector3d& p) { return normal.dot(p - mean) <= layer; }) &&
        all_of(other, [&](const Vector3d& p) { return normal.dot(p - mean) >= -layer; }))
      return true;
  }
  return false;
}

class Judge {
 public:
  Judge(const CellComplex& complex, const Numbering& numbering)
      : complex_(complex),
        numbering_(numbering),
        same_place_(kSamePlace *
                    (complex.points.colwise().maxCoeff() - complex.points.colwise().minCoeff()).maxCoeff()) {}

  std::vector<std::string> judge(Coincidence coincidence) {
    repeated_vertices();
    doubled_cells();
    bad_shapes();
    if (coincidence == Coincidence::Refused) {
      doubled_vertices();
      shared_faces();
      // Would repeat what was said.
      if (lines_.empty()) hanging_vertices();
      if (lines_.empty()) overlaps();
    }
    return std::move(lines_);
  }

 private:
  std::int64_t cell(int c) const { return numbering_.cell(static_cast<std::size_t>(c)); }
  std::int64_t vertex(int v) const { return numbering_.vertex(static_cast<std::size_t>(v)); }

  /// One line: what the first offender shows, then all of them where there are several.
  void report(const std::vector<int>& cells, const std::string& first, const char* hint) {
    if (cells.empty()) return;
    std::string line = fmt::format("cell {}: {}", cell(cells.front()), first);
    if (cells.size() > 1) {
      std::vector<std::int64_t> numbers;
      for (int c : cells) numbers.push_back(cell(c));
      line += fmt::format(" ({} such cells: {})", cells.size(), number_list(numbers));
    }
    lines_.push_back(fmt::format("{}; hint: {}", line, hint));
  }

  void repeated_vertices() {
    std::vector<int> cells;
    std::string first;
    for (std::size_t c = 0; c < complex_.cells.size(); ++c) {
      const std::array<int, 8>& v = complex_.cells[c].vertices;
      int twice = -1;
      for (int k = 1; k < num_corners(complex_.cells[c].type); ++k)
        for (int j = 0; j < k; ++j)
          if (v[j] == v[k]) twice = v[k];
      if (twice < 0) continue;
      if (cells.empty()) first = fmt::format("names vertex {} twice", vertex(twice));
      cells.push_back(static_cast<int>(c));
    }
    report(cells, first, "write such a cell as the wedge or tetrahedron that it is");
  }

  void doubled_cells() {
    std::vector<std::pair<std::array<int, 8>, int>> keys;
    for (std::size_t c = 0; c < complex_.cells.size(); ++c) {
      std::array<int, 8> key = complex_.cells[c].vertices;
      std::sort(key.begin(), key.end());
      keys.emplace_back(key, static_cast<int>(c));
    }
    std::sort(keys.begin(), keys.end());
    std::vector<int> cells;
    std::string first;
    for (std::size_t i = 1; i < keys.size(); ++i) {
      if (keys[i].first != keys[i - 1].first) continue;
      if (cells.empty()) first = fmt::format("has the vertices of cell {}", cell(keys[i - 1].second));
      cells.push_back(keys[i].second);
    }
    report(cells, first, "remove the doubled cells");
  }

  void bad_shapes() {
    std::vector<int> cells;
    std::string first;
    for (std::size_t c = 0; c < complex_.cells.size(); ++c) {
      const Cell& cell = complex_.cells[c];
      int worst = 0;
      double smallest = 2.0, largest = -2.0;
      for (int k = 0; k < num_corners(cell.type); ++k) {
        const double jacobian = scaled_corner(complex_, cell, k);
        if (jacobian < smallest) smallest = jacobian, worst = k;
        largest = std::max(largest, jacobian);
      }
      const bool tetrahedron = cell.type == CellType::Tetrahedron;
      // A tetrahedron thinner than rounding is flat, whatever the sign.
      if (smallest > (tetrahedron ? 1e-12 : 0.0) &&
          (tetrahedron || min_scaled_jacobian(complex_, cell) > 0.0))
        continue;
      if (cells.empty()) {
        first = fmt::format("is {}: scaled Jacobian at vertex {}, got {:.3g}, expected more than 0",
                            tetrahedron     ? "flat"
                            : largest > 0.0 ? "inverted or not convex"
                                            : "flat or inside out",
                            vertex(cell.vertices[worst]),
                            smallest > 0.0 ? min_scaled_jacobian(complex_, cell) : smallest);
      }
      cells.push_back(static_cast<int>(c));
    }
    report(cells, first, "untangle the mesh, or split such cells into tetrahedra");
  }

  void doubled_vertices() {
    std::vector<int> first_cell(static_cast<std::size_t>(complex_.points.rows()), -1);
    for (std::size_t c = 0; c < complex_.cells.size(); ++c)
      for (int k = 0; k < num_corners(complex_.cells[c].type); ++k) {
        int& owner = first_cell[static_cast<std::size_t>(complex_.cells[c].vertices[k])];
        if (owner < 0) owner = static_cast<int>(c);
      }
    std::vector<int> used;
    for (std::size_t v = 0; v < first_cell.size(); ++v)
      if (first_cell[v] >= 0) used.push_back(static_cast<int>(v));
    const detail::PlaceGrid grid(complex_.points, used);
    std::vector<std::int64_t> numbers;
    std::string first;
    for (int v : used) {
      const Vector3d p = point(complex_, v);
      int twin = -1;
      grid.visit(p.array() - same_place_, p.array() + same_place_, [&](int u) {
        if (u < v && (twin < 0 || u < twin) && (point(complex_, u) - p).norm() <= same_place_) twin = u;
      });
      if (twin < 0) continue;
      if (numbers.empty())
        first = fmt::format("cell {}: vertex {} lies {:.3g} m from vertex {}, expected more than {:.3g} m",
                            cell(first_cell[static_cast<std::size_t>(v)]), vertex(v),
                            (point(complex_, twin) - p).norm(), vertex(twin), same_place_);
      numbers.push_back(vertex(v));
    }
    if (numbers.empty()) return;
    if (numbers.size() > 1)
      first += fmt::format(" ({} such vertices: {})", numbers.size(), number_list(numbers));
    lines_.push_back(first + "; hint: merge doubled vertices");
  }

  /// Faces that two cells may have once each, from opposite sides. Keeps those that one cell alone has.
  void shared_faces() {
    const std::vector<Face> faces = sorted_faces(complex_);
    std::vector<int> crowded, same_side;
    std::string crowded_first, same_side_first;
    for (std::size_t i = 0, j = 0; i < faces.size(); i = j) {
      for (j = i; j < faces.size() && faces[j].key == faces[i].key;) ++j;
      const Face &a = faces[i], &b = faces[j - 1];
      if (j - i == 1) boundary_.push_back(a);
      if (j - i > 2) {
        if (crowded.empty())
          crowded_first = fmt::format("shares a face with cells {} and {}, expected one at most",
                                      cell(faces[i + 1].cell), cell(faces[i + 2].cell));
        crowded.push_back(a.cell);
      } else if (j - i == 2 && cycle(a, 1) != cycle(b, -1)) {
        if (same_side.empty())
          same_side_first =
              cycle(a, 1) == cycle(b, 1)
                  ? fmt::format("and cell {} lie on the same side of their common face: one is inverted",
                                cell(b.cell))
                  : fmt::format("and cell {} order the corners of their common face differently",
                                cell(b.cell));
        same_side.push_back(a.cell);
      }
    }
    report(crowded, crowded_first, "remove the cells that overlap");
    report(same_side, same_side_first, "untangle the mesh");
    unlike_faces(faces);
  }

  /// A quadrilateral that meets triangles of its own corners.
  void unlike_faces(const std::vector<Face>& faces) {
    const auto find = [&](std::array<int, 4> key) {
      std::sort(key.begin(), key.end());
      const auto found =
          std::lower_bound(faces.begin(), faces.end(), key,
                           [](const Face& face, const std::array<int, 4>& k) { return face.key < k; });
      return found != faces.end() && found->key == key ? found->cell : -1;
    };
    std::vector<int> cells;
    std::string first;
    for (const Face& quad : boundary_) {
      if (quad.is_triangle()) continue;
      for (int left_out = 0; left_out < 4; ++left_out) {
        std::array<int, 4> key = quad.vertices;
        key[left_out] = -1;
        const int other = find(key);
        if (other < 0 || other == quad.cell) continue;
        if (cells.empty())
          first = fmt::format("has a quadrilateral where cell {} has a triangle, expected faces that match",
                              cell(other));
        cells.push_back(quad.cell);
        break;
      }
    }
    report(cells, first, "split the cells with quadrilaterals into tetrahedra, or use wedges between them");
  }

  /// Vertices on somebody's face or edge without being its corner.
  void hanging_vertices() {
    std::vector<int> vertices;
    for (const Face& face : boundary_)
      for (int v : face.vertices)
        if (v >= 0) vertices.push_back(v);
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    const detail::PlaceGrid grid(complex_.points, vertices);
    std::map<int, int> hanging;  // cell -> vertex
    for (const Face& face : boundary_) {
      Eigen::Array3d low = point(complex_, face.vertices[0]).array(), high = low;
      for (int v : face.vertices) {
        if (v < 0) continue;
        low = low.min(point(complex_, v).array());
        high = high.max(point(complex_, v).array());
      }
      grid.visit(low - same_place_, high + same_place_, [&](int v) {
        if (std::find(face.vertices.begin(), face.vertices.end(), v) != face.vertices.end()) return;
        if (distance(complex_, face, point(complex_, v)) <= same_place_) hanging.emplace(face.cell, v);
      });
    }
    if (hanging.empty()) return;
    std::vector<int> cells;
    for (const auto& [c, v] : hanging) cells.push_back(c);
    report(cells,
           fmt::format("has vertex {} inside one of its faces or edges, expected faces that match",
                       vertex(hanging.begin()->second)),
           "split the cells round hanging vertices");
  }

  /// Cells that lie in each other, though no face says so: parts that are not joined, or a folded mesh.
  void overlaps() {
    const detail::CellLocator locator(complex_);
    std::vector<int> cells, near;
    std::string first;
    for (std::size_t c = 0; c < complex_.cells.size(); ++c) {
      const Box box = box_of(complex_, complex_.cells[c]);
      locator.find_near(box.min(), box.max(), near);
      for (int other : near) {
        if (other <= static_cast<int>(c)) continue;
        const Cell& with = complex_.cells[static_cast<std::size_t>(other)];
        const Box common = box.intersection(box_of(complex_, with));
        const double layer = 0.5 * same_place_;
        if (common.isEmpty() || is_separated(complex_, complex_.cells[c], with, layer) ||
            is_separated(complex_, with, complex_.cells[c], layer))
          continue;
        // Rounded coordinates: a layer that thick over the largest section of what they can have in common.
        // Never less than rounding itself: cells that share a vertex have a point in common.
        const Vector3d size = common.sizes().cwiseMax(same_place_);
        const double section = std::max({size.x() * size.y(), size.y() * size.z(), size.z() * size.x()});
        const double volume = detail::overlap_volume(complex_, complex_.cells[c], with);
        if (!(volume > 2.0 * same_place_ * section)) continue;
        if (cells.empty())
          first = fmt::format("overlaps cell {}: they have {:.3g} m^3 in common, expected none", cell(other),
                              volume);
        cells.push_back(static_cast<int>(c));
        break;
      }
    }
    report(cells, first, "join the parts of the mesh, or move them apart");
  }

  const CellComplex& complex_;
  const Numbering& numbering_;
  double same_place_;
  std::vector<Face> boundary_;
  std::vector<std::string> lines_;
};

}  // namespace

std::string number_list(const std::vector<std::int64_t>& numbers) {
  const std::size_t shown = std::min(kShown, numbers.size());
  std::string text = fmt::format(
      "{}", fmt::join(numbers.begin(), numbers.begin() + static_cast<std::ptrdiff_t>(shown), ", "));
  if (numbers.size() > shown) text += fmt::format(", ... and {} more", numbers.size() - shown);
  return text;
}

void orient_cells(CellComplex& complex) {
  for (Cell& cell : complex.cells) {
    bool inside_out = true;
    for (int k = 0; k < num_corners(cell.type) && inside_out; ++k)
      inside_out = scaled_corner(complex, cell, k) < 0.0;
    if (inside_out) cell = turned(cell);
  }
}

std::vector<std::string> cell_faults(const CellComplex& complex, const Numbering& numbering,
                                     Coincidence coincidence) {
  if (complex.cells.empty()) return {};
  return Judge(complex, numbering).judge(coincidence);
}

}  // namespace sinew::lattice
