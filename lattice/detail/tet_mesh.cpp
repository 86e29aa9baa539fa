#include "lattice/detail/tet_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;
using Tet = TetMesh::Tet;

/// A flip must raise the smallest quality by this much, so that rounding cannot make two flips alternate.
constexpr double kGain = 1e-6;
constexpr int kLargestRing = 7;

/// Corners of the faces, counter-clockwise from outside; face k is opposite to corner k.
constexpr std::array<std::array<int, 3>, 4> kFaces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

bool has(const Tet& t, int vertex) {
  return t[0] == vertex || t[1] == vertex || t[2] == vertex || t[3] == vertex;
}

/// Best triangulation of a polygon 0..n-1 by dynamic programming [Klincsek80]; worth(i, k, j) of a triangle.
template <class Worth>
double best_triangulation(int n, const Worth& worth, std::vector<std::array<int, 3>>& triangles) {
  double best[kLargestRing][kLargestRing];
  int middle[kLargestRing][kLargestRing];
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) best[i][j] = std::numeric_limits<double>::infinity();
  for (int span = 2; span < n; ++span)
    for (int i = 0; i + span < n; ++i) {
      const int j = i + span;
      best[i][j] = -std::numeric_limits<double>::infinity();
      middle[i][j] = i + 1;
      for (int k = i + 1; k < j; ++k) {
        const double q = std::min({best[i][k], best[k][j], worth(i, k, j)});
        if (q > best[i][j]) best[i][j] = q, middle[i][j] = k;
      }
    }
  std::vector<std::pair<int, int>> open{{0, n - 1}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    if (j - i < 2) continue;
    const int k = middle[i][j];
    triangles.push_back({i, k, j});
    open.emplace_back(i, k);
    open.emplace_back(k, j);
  }
  return best[0][n - 1];
}

}  // namespace

double tetrahedron_quality(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  const Vector3d ab = b - a, ac = c - a, ad = d - a, bc = c - b, bd = d - b, cd = d - c;
  const double volume6 = ab.cross(ac).dot(ad);
  if (!(volume6 > 0.0)) return -1.0;
  const double lab = ab.norm(), lac = ac.norm(), lad = ad.norm(), lbc = bc.norm(), lbd = bd.norm(),
               lcd = cd.norm();
  // Twice the areas of the faces opposite to a, b, c, d.
  const double fa = bc.cross(bd).norm(), fb = ac.cross(ad).norm(), fc = ab.cross(ad).norm(),
               fd = ab.cross(ac).norm();
  // sin(dihedral at edge e) = 3 V |e| / (2 A1 A2) = volume6 |e| / (f1 f2).
  const double sine = volume6 * std::min({lab / (fc * fd), lac / (fb * fd), lad / (fb * fc), lbc / (fa * fd),
                                          lbd / (fa * fc), lcd / (fa * fb)});
  const double corner =
      volume6 / std::max({lab * lac * lad, lab * lbc * lbd, lac * lbc * lcd, lad * lbd * lcd});
  return std::min(sine, 1.4 * corner);
}

bool tetrahedron_contains(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d,
                          const Vector3d& p, double slack) {
  const Vector3d ab = b - a, ac = c - a, ad = d - a, ap = p - a;
  const double volume = ab.cross(ac).dot(ad);
  const double limit = -slack * volume;
  const double wb = ap.cross(ac).dot(ad), wc = ab.cross(ap).dot(ad), wd = ab.cross(ac).dot(ap);
  return wb >= limit && wc >= limit && wd >= limit && volume - wb - wc - wd >= limit;
}

TetMesh::TetMesh(std::vector<Vector3d> start, const std::vector<Tet>& tets)
    : points(std::move(start)), stars_(points.size()) {
  for (const Tet& t : tets) add(t);
}

double TetMesh::star_quality(int vertex) const {
  double worst = std::numeric_limits<double>::infinity();
  for (int t : stars_[vertex]) worst = std::min(worst, quality(t));
  return worst;
}

int TetMesh::add(const Tet& t) {
  const int slot = static_cast<int>(tets_.size());
  tets_.push_back(t);
  alive_.push_back(1);
  for (int v : t) stars_[v].push_back(slot);
  return slot;
}

void TetMesh::remove(int t) {
  alive_[t] = 0;
  for (int v : tets_[t]) std::erase(stars_[v], t);
}

std::vector<Tet> TetMesh::cells() const {
  std::vector<Tet> list;
  for (int t = 0; t < num_slots(); ++t)
    if (alive_[t]) list.push_back(tets_[t]);
  return list;
}

std::vector<std::vector<std::array<int, 2>>> TetMesh::boundary_faces() const {
  std::vector<std::array<int, 3>> faces;
  for (int t = 0; t < num_slots(); ++t) {
    if (!alive_[t]) continue;
    for (const std::array<int, 3>& f : kFaces) {
      std::array<int, 3> face{tets_[t][f[0]], tets_[t][f[1]], tets_[t][f[2]]};
      std::sort(face.begin(), face.end());
      faces.push_back(face);
    }
  }
  std::sort(faces.begin(), faces.end());
  std::vector<std::vector<std::array<int, 2>>> result(points.size());
  for (std::size_t i = 0; i < faces.size();) {
    const bool paired = i + 1 < faces.size() && faces[i] == faces[i + 1];
    if (!paired)
      for (int k = 0; k < 3; ++k)
        result[faces[i][k]].push_back({faces[i][(k + 1) % 3], faces[i][(k + 2) % 3]});
    i += paired ? 2 : 1;
  }
  return result;
}

TetMesh::Ring TetMesh::ring(int a, int b) const {
  struct Side {
    int cell, from, to;
  };
  std::vector<Side> sides;
  for (int t : stars_[a]) {
    const Tet& tet = tets_[t];
    if (!has(tet, b)) continue;
    const auto ia = std::find(tet.begin(), tet.end(), a) - tet.begin();
    const auto ib = std::find(tet.begin(), tet.end(), b) - tet.begin();
    int rest[2], count = 0;
    for (int k = 0; k < 4; ++k)
      if (k != ia && k != ib) rest[count++] = tet[k];
    // The face opposite to a, counter-clockwise from outside, runs b -> x -> y: then (a, b, x, y) is
    // positive.
    const std::array<int, 3>& f = kFaces[ia];
    for (int k = 0; k < 3; ++k)
      if (tet[f[k]] == b) rest[0] = tet[f[(k + 1) % 3]], rest[1] = tet[f[(k + 2) % 3]];
    sides.push_back({t, rest[0], rest[1]});
  }
  Ring ring;
  if (sides.empty()) return ring;
  int current = sides[0].from;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const auto next =
        std::find_if(sides.begin(), sides.end(), [&](const Side& side) { return side.from == current; });
    if (next == sides.end()) return {};
    ring.cells.push_back(next->cell);
    ring.rim.push_back(current);
    current = next->to;
    if (current == sides[0].from && i + 1 < sides.size()) return {};
  }
  if (current != sides[0].from) return {};
  return ring;
}

bool remove_edge(TetMesh& mesh, int a, int b, const EdgeSet& keep) {
  if (keep.contains(std::minmax(a, b))) return false;
  const TetMesh::Ring ring = mesh.ring(a, b);
  const int n = static_cast<int>(ring.rim.size());
  if (n < 3 || n > kLargestRing) return false;
  double before = std::numeric_limits<double>::infinity();
  for (int t : ring.cells) before = std::min(before, mesh.quality(t));
  const auto lower = [&](int i, int k, int j) { return Tet{a, ring.rim[i], ring.rim[k], ring.rim[j]}; };
  const auto upper = [&](int i, int k, int j) { return Tet{b, ring.rim[i], ring.rim[j], ring.rim[k]}; };
  std::vector<std::array<int, 3>> triangles;
  const double after = best_triangulation(
      n,
      [&](int i, int k, int j) {
        return std::min(mesh.quality(lower(i, k, j)), mesh.quality(upper(i, k, j)));
      },
      triangles);
  if (!(after > before + kGain)) return false;
  for (int t : ring.cells) mesh.remove(t);
  for (const auto& [i, k, j] : triangles) {
    mesh.add(lower(i, k, j));
    mesh.add(upper(i, k, j));
  }
  return true;
}

bool remove_face(TetMesh& mesh, int t, int k) {
  const Tet tet = mesh.tet(t);
  const int apex = tet[k];
  const std::array<int, 3> face{tet[kFaces[k][0]], tet[kFaces[k][1]], tet[kFaces[k][2]]};
  int other = -1;
  for (int u : mesh.star(face[0]))
    if (u != t && has(mesh.tet(u), face[1]) && has(mesh.tet(u), face[2])) other = u;
  if (other < 0) return false;
  int far = -1;
  for (int v : mesh.tet(other))
    if (v != face[0] && v != face[1] && v != face[2]) far = v;
  double after = std::numeric_limits<double>::infinity();
  std::array<Tet, 3> fresh;
  for (int i = 0; i < 3; ++i) {
    fresh[i] = {apex, far, face[i], face[(i + 1) % 3]};
    after = std::min(after, mesh.quality(fresh[i]));
  }
  if (!(after > std::min(mesh.quality(t), mesh.quality(other)) + kGain)) return false;
  mesh.remove(t);
  mesh.remove(other);
  for (const Tet& f : fresh) mesh.add(f);
  return true;
}

}  // namespace sinew::lattice::detail
