#include "lattice/detail/cell_overlap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;
using Tet = std::array<Vector3d, 4>;

double volume(const Tet& t) { return std::abs((t[1] - t[0]).cross(t[2] - t[0]).dot(t[3] - t[0])) / 6.0; }

std::vector<Tet> tetrahedra_of(const CellComplex& complex, const Cell& cell) {
  const auto point = [&](int k) -> Vector3d { return complex.points.row(cell.vertices[k]).transpose(); };
  if (cell.type == CellType::Tetrahedron) return {{point(0), point(1), point(2), point(3)}};
  const int n = num_corners(cell.type);
  Vector3d mean = Vector3d::Zero();
  for (int k = 0; k < n; ++k) mean += point(k) / n;
  std::vector<Tet> tets;
  for (const std::array<int, 4>& face : cell_faces(cell.type)) {
    if (face[3] < 0) {
      tets.push_back({point(face[0]), point(face[1]), point(face[2]), mean});
      continue;
    }
    const Vector3d centre = 0.25 * (point(face[0]) + point(face[1]) + point(face[2]) + point(face[3]));
    for (int k = 0; k < 4; ++k) tets.push_back({point(face[k]), point(face[(k + 1) % 4]), centre, mean});
  }
  return tets;
}

/// The half of space where normal . x <= offset.
struct HalfSpace {
  Vector3d normal;
  double offset;
  double beyond(const Vector3d& p) const { return normal.dot(p) - offset; }
};

/// Adds the part of a tetrahedron inside a half space, as tetrahedra.
void cut(const Tet& tet, const HalfSpace& half, std::vector<Tet>& parts) {
  std::array<double, 4> d;
  std::array<int, 4> order{0, 1, 2, 3};  // those inside first
  for (std::size_t k = 0; k < 4; ++k) d[k] = half.beyond(tet[k]);
  const auto first_out = std::stable_partition(order.begin(), order.end(),
                                               [&](int k) { return d[static_cast<std::size_t>(k)] <= 0.0; });
  const auto inside = first_out - order.begin();
  const auto at = [&](std::size_t k) { return tet[static_cast<std::size_t>(order[k])]; };
  const auto between = [&](std::size_t in, std::size_t out) -> Vector3d {
    const double a = d[static_cast<std::size_t>(order[in])], b = d[static_cast<std::size_t>(order[out])];
    return at(in) + a / (a - b) * (at(out) - at(in));
  };
  // A wedge between the triangles p and q, whose corners are joined in order.
  const auto add_wedge = [&](const std::array<Vector3d, 3>& p, const std::array<Vector3d, 3>& q) {
    parts.push_back({p[0], p[1], p[2], q[0]});
    parts.push_back({p[1], p[2], q[0], q[1]});
    parts.push_back({p[2], q[0], q[1], q[2]});
  };
  if (inside == 4) parts.push_back(tet);
  if (inside == 1) parts.push_back({at(0), between(0, 1), between(0, 2), between(0, 3)});
  if (inside == 3) add_wedge({at(0), at(1), at(2)}, {between(0, 3), between(1, 3), between(2, 3)});
  if (inside == 2) add_wedge({at(0), between(0, 2), between(0, 3)}, {at(1), between(1, 2), between(1, 3)});
}

bool boxes_are_apart(const Tet& a, const Tet& b) {
  const auto low = [](const Tet& t) { return t[0].cwiseMin(t[1]).cwiseMin(t[2].cwiseMin(t[3])).eval(); };
  const auto high = [](const Tet& t) { return t[0].cwiseMax(t[1]).cwiseMax(t[2].cwiseMax(t[3])).eval(); };
  return (low(a).array() > high(b).array()).any() || (low(b).array() > high(a).array()).any();
}

double overlap(const Tet& a, const Tet& b) {
  if (boxes_are_apart(a, b)) return 0.0;
  std::vector<Tet> parts{a}, next;
  for (std::size_t k = 0; k < 4 && !parts.empty(); ++k) {
    const Vector3d &p = b[(k + 1) % 4], &q = b[(k + 2) % 4], &r = b[(k + 3) % 4];
    HalfSpace half{(q - p).cross(r - p), 0.0};
    half.offset = half.normal.dot(p);
    if (half.beyond(b[k]) > 0.0) half = {-half.normal, -half.offset};
    next.clear();
    for (const Tet& part : parts) cut(part, half, next);
    parts.swap(next);
  }
  double sum = 0.0;
  for (const Tet& part : parts) sum += volume(part);
  return sum;
}

}  // namespace

double overlap_volume(const CellComplex& complex, const Cell& a, const Cell& b) {
  double sum = 0.0;
  const std::vector<Tet> of_b = tetrahedra_of(complex, b);
  for (const Tet& s : tetrahedra_of(complex, a))
    for (const Tet& t : of_b) sum += overlap(s, t);
  return sum;
}

}  // namespace sinew::lattice::detail
