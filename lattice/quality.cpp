#include "lattice/quality.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lattice/detail/inspection.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

/// The three neighbours of each corner, right-handed: (e1 x e2) . e3 > 0 in a positively oriented cell.
constexpr std::array<std::array<int, 3>, 4> kTetrahedronCorners{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
constexpr std::array<std::array<int, 3>, 6> kWedgeCorners{
    {{1, 2, 3}, {2, 0, 4}, {0, 1, 5}, {5, 4, 0}, {3, 5, 1}, {4, 3, 2}}};
constexpr std::array<std::array<int, 3>, 8> kHexahedronCorners{
    {{1, 3, 4}, {2, 0, 5}, {3, 1, 6}, {0, 2, 7}, {7, 5, 0}, {4, 6, 1}, {5, 7, 2}, {6, 4, 3}}};

std::array<int, 3> corner_neighbours(CellType type, int corner) {
  if (type == CellType::Tetrahedron) return kTetrahedronCorners[corner];
  if (type == CellType::Wedge) return kWedgeCorners[corner];
  return kHexahedronCorners[corner];
}

Vector3d point(const CellComplex& complex, const Cell& cell, int corner) {
  return complex.points.row(cell.vertices[corner]).transpose();
}

/// Mean of the face that holds corner c and its neighbours a and b.
Vector3d face_mean(const CellComplex& complex, const Cell& cell, int a, int c, int b) {
  for (const std::array<int, 4>& face : cell_faces(cell.type)) {
    const auto has = [&](int k) { return std::find(face.begin(), face.end(), k) != face.end(); };
    if (!has(a) || !has(b) || !has(c)) continue;
    const int n = face[3] < 0 ? 3 : 4;
    Vector3d sum = Vector3d::Zero();
    for (int k = 0; k < n; ++k) sum += point(complex, cell, face[k]);
    return sum / n;
  }
  return Vector3d::Zero();
}

/// Determinant of three edges, each of length 1.
double scaled_determinant(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const double lengths = a.norm() * b.norm() * c.norm();
  return lengths > 0.0 ? a.cross(b).dot(c) / lengths : 0.0;
}

/// At corner k of a hexahedron (VTK order).
double scaled_corner(const std::array<Vector3d, 8>& hexahedron, int k) {
  const std::array<int, 3>& n = kHexahedronCorners[k];
  return scaled_determinant(hexahedron[n[0]] - hexahedron[k], hexahedron[n[1]] - hexahedron[k],
                            hexahedron[n[2]] - hexahedron[k]);
}

std::string list(const std::vector<int>& indices) {
  constexpr std::size_t kShown = 5;
  const std::size_t shown = std::min(kShown, indices.size());
  std::string text = fmt::format(
      "{}", fmt::join(indices.begin(), indices.begin() + static_cast<std::ptrdiff_t>(shown), ", "));
  return indices.size() > kShown ? text + ", ..." : text;
}

}  // namespace

double min_dihedral_degrees(const CellComplex& complex, const Cell& cell) {
  double smallest = std::numbers::pi;
  for (int c = 0; c < num_corners(cell.type); ++c) {
    const std::array<int, 3> n = corner_neighbours(cell.type, c);
    for (int k = 0; k < 3; ++k) {
      const Vector3d edge = point(complex, cell, n[k]) - point(complex, cell, c);
      const Vector3d u = edge.cross(point(complex, cell, n[(k + 1) % 3]) - point(complex, cell, c));
      const Vector3d v = edge.cross(point(complex, cell, n[(k + 2) % 3]) - point(complex, cell, c));
      smallest = std::min(smallest, std::atan2(u.cross(v).norm(), u.dot(v)));
    }
  }
  return smallest * 180.0 / std::numbers::pi;
}

double min_corner_jacobian(const CellComplex& complex, const Cell& cell) {
  double smallest = 1.0;
  for (int c = 0; c < num_corners(cell.type); ++c) {
    const auto [i, j, k] = corner_neighbours(cell.type, c);
    const Vector3d p = point(complex, cell, c);
    smallest = std::min(smallest, scaled_determinant(point(complex, cell, i) - p, point(complex, cell, j) - p,
                                                     point(complex, cell, k) - p));
  }
  return smallest;
}

double min_scaled_jacobian(const CellComplex& complex, const Cell& cell) {
  const int n = num_corners(cell.type);
  Vector3d mean = Vector3d::Zero();
  for (int k = 0; k < n; ++k) mean += point(complex, cell, k) / n;
  double smallest = 1.0;
  for (int c = 0; c < n; ++c) {
    const auto [i, j, k] = corner_neighbours(cell.type, c);
    const Vector3d p = point(complex, cell, c);
    const std::array<Vector3d, 8> hexahedron{p,
                                             0.5 * (p + point(complex, cell, i)),
                                             face_mean(complex, cell, i, c, j),
                                             0.5 * (p + point(complex, cell, j)),
                                             0.5 * (p + point(complex, cell, k)),
                                             face_mean(complex, cell, i, c, k),
                                             mean,
                                             face_mean(complex, cell, j, c, k)};
    for (int corner = 0; corner < 8; ++corner)
      smallest = std::min(smallest, scaled_corner(hexahedron, corner));
  }
  return smallest;
}

LatticeQuality measure_quality(const ControlLattice& lattice, const Surface& skin) {
  return detail::inspect(lattice, skin, detail::make_unit_skin(skin)).quality;
}

std::vector<GateFailure> check_gate(const ControlLattice& lattice, const Surface& skin,
                                    const BuildOptions& options) {
  options.validate();
  return detail::judge(detail::inspect(lattice, skin, detail::make_unit_skin(skin)), options);
}

std::vector<GateFailure> detail::judge(const Inspection& found, const BuildOptions& options) {
  const LatticeQuality& q = found.quality;
  std::vector<GateFailure> failures;
  const auto fail = [&](bool tolerable, std::string what) {
    failures.push_back({std::move(what), tolerable});
  };
  if (!found.inverted_cells.empty()) {
    fail(false, fmt::format("{} cells have no positive volume: {}", found.inverted_cells.size(),
                            list(found.inverted_cells)));
  }
  if (!found.vertices_outside.empty()) {
    fail(false, fmt::format("{} skin vertices lie outside the lattice: {}", q.skin_vertices_outside,
                            list(found.vertices_outside)));
  }
  if (!found.broken_chains.empty()) {
    fail(false, fmt::format("{} bones are not exact chains of edges, first '{}'", found.broken_chains.size(),
                            found.broken_chains.front()));
  }
  if (!found.floating.empty()) {
    fail(false,
         fmt::format("{} of {} components hold neither a bone nor a soft frame; the first has {} cells: {}",
                     found.floating.size(), q.components, found.floating[0].size(), list(found.floating[0])));
  }
  if (!found.triangles_outside.empty()) {
    fail(true, fmt::format("{} skin triangles leave the lattice between their vertices: {}",
                           q.skin_triangles_outside, list(found.triangles_outside)));
  }
  if (q.min_dihedral_degrees < options.min_dihedral_degrees) {
    fail(true,
         fmt::format("the smallest dihedral angle is {:.3g} degrees in cell {}, must be at least {:.3g}",
                     q.min_dihedral_degrees, found.flattest_cell, options.min_dihedral_degrees));
  }
  if (q.min_scaled_jacobian < options.min_scaled_jacobian) {
    // A level-1 hexahedron that is inverted at a corner cannot be simulated.
    fail(q.min_scaled_jacobian > 0.0,
         fmt::format("the smallest scaled Jacobian is {:.3g} in cell {}, must be at least {:.3g}",
                     q.min_scaled_jacobian, found.most_skewed_cell, options.min_scaled_jacobian));
  }
  return failures;
}

}  // namespace sinew::lattice
