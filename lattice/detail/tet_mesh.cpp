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
/// Weight of the scaled Jacobian against the sine of the dihedral angles.
constexpr double kJacobianScale = 1.4;

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

/// A face with the sides p, q, r (squared lengths): the squares of its medians to those sides.
Vector3d squared_medians(double p, double q, double r) {
  return 0.25 * Vector3d(2 * (q + r) - p, 2 * (r + p) - q, 2 * (p + q) - r);
}

/// The scaled Jacobian at every corner of the four level-1 hexahedra is 6 V over a product of three lengths;
/// the largest of these products, squared, from the squares of the edges ab, ac, ad, bc, bd, cd. With the
/// medians m of the faces and n of the cell the products are: at a vertex, its three edges; at the middle of
/// an edge, the edge and the two medians to it; in the middle of a face, 4/3 n and two of its medians; in the
/// middle of the cell, 27/16 n_b n_c n_d.
double largest_corner(const std::array<double, 6>& e) {
  const auto [ab, ac, ad, bc, bd, cd] = e;
  const double edges = std::max({ab * ac * ad, ab * bc * bd, ac * bc * cd, ad * bd * cd});
  // Medians of the faces opposite to a, b, c, d.
  const Vector3d ma = squared_medians(bc, bd, cd), mb = squared_medians(ac, ad, cd),
                 mc = squared_medians(ab, ad, bd), md = squared_medians(ab, ac, bc);
  const double middles = std::max({ab * mc[0] * md[0], ac * mb[0] * md[1], bc * ma[0] * md[2],
                                   ad * mb[1] * mc[1], bd * ma[1] * mc[2], cd * ma[2] * mb[2]});
  // Squares of the lines from a vertex to the mean of the opposite face.
  const double na = (3 * (ab + ac + ad) - (bc + bd + cd)) / 9.0,
               nb = (3 * (ab + bc + bd) - (ac + ad + cd)) / 9.0,
               nc = (3 * (ac + bc + cd) - (ab + ad + bd)) / 9.0,
               nd = (3 * (ad + bd + cd) - (ab + ac + bc)) / 9.0;
  const auto two_largest = [](const Vector3d& m) { return m.prod() / m.minCoeff(); };
  const double faces =
      16.0 / 9.0 *
      std::max({na * two_largest(ma), nb * two_largest(mb), nc * two_largest(mc), nd * two_largest(md)});
  const double centre = 729.0 / 256.0 * (na * nb * nc * nd) / std::min({na, nb, nc, nd});
  return std::max({edges, middles, faces, centre});
}

}  // namespace

double level1_jacobian(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  const Vector3d ab = b - a, ac = c - a, ad = d - a;
  return ab.cross(ac).dot(ad) /
         std::sqrt(largest_corner({ab.squaredNorm(), ac.squaredNorm(), ad.squaredNorm(),
                                   (c - b).squaredNorm(), (d - b).squaredNorm(), (d - c).squaredNorm()}));
}

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
  return std::min(sine,
                  kJacobianScale * volume6 /
                      std::sqrt(largest_corner({ab.squaredNorm(), ac.squaredNorm(), ad.squaredNorm(),
                                                bc.squaredNorm(), bd.squaredNorm(), cd.squaredNorm()})));
}

bool tetrahedron_contains(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d,
                          const Vector3d& p, double slack) {
  const Vector3d ab = b - a, ac = c - a, ad = d - a, ap = p - a;
  const double volume = ab.cross(ac).dot(ad);
  const double limit = -slack * volume;
  const double wb = ap.cross(ac).dot(ad), wc = ab.cross(ap).dot(ad), wd = ab.cross(ac).dot(ap);
  return wb >= limit && wc >= limit && wd >= limit && volume - wb - wc - wd >= limit;
}

TetMesh::TetMesh(std::vector<Vector3d> start, const std::vector<Tet>& tets, Half half)
    : points(std::move(start)), half_(half), stars_(points.size()) {
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
    const bool in_plane = is_in_plane(faces[i][0]) && is_in_plane(faces[i][1]) && is_in_plane(faces[i][2]);
    if (!paired && !in_plane)
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
  const auto is_end = [&](int vertex) {
    return std::any_of(sides.begin(), sides.end(), [&](const Side& side) { return side.to == vertex; });
  };
  const auto first = std::find_if(sides.begin(), sides.end(), [&](const Side& s) { return !is_end(s.from); });
  const bool open = first != sides.end();
  const int begin = open ? first->from : sides[0].from;
  int current = begin;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const auto next =
        std::find_if(sides.begin(), sides.end(), [&](const Side& side) { return side.from == current; });
    if (next == sides.end()) return {};
    ring.cells.push_back(next->cell);
    ring.rim.push_back(current);
    current = next->to;
    if (current == begin && i + 1 < sides.size()) return {};
  }
  if (!open) return current == begin ? ring : Ring{};
  ring.rim.push_back(current);
  const bool in_plane = is_in_plane(a) && is_in_plane(b) && is_in_plane(begin) && is_in_plane(current);
  return in_plane ? ring : Ring{};
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
