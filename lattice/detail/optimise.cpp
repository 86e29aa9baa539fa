#include "lattice/detail/optimise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "lattice/detail/sample_grid.h"
#include "lattice/detail/tet_mesh.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

constexpr int kSweeps = 12;
/// Cells better than this are left alone by flips; about a dihedral of 35 degrees.
constexpr double kGoodEnough = 0.6;
/// Where the boundary goes, outside the skin, in units of h.
constexpr double kOffset = 0.2;
/// A pull toward the skin may lower the quality of a star to this, not below.
constexpr double kPullQuality = 0.45;
/// Rounding of a sample that lies on a face, relative to the cell.
constexpr double kSlack = 1e-10;
/// First step of the hill-climb, in units of h, and how often it is halved.
constexpr double kFirstStep = 0.12;
constexpr int kHalvings = 3;

class Optimiser {
 public:
  Optimiser(LatticePoints& points, const Tetrahedra& cells, const ReducedSkeleton& skeleton,
            const UnitSkin& skin, const SkinSamples& samples, double h, const CellSizes& sizes,
            const Poll& poll)
      : mesh_(points.points, cells, points.half ? TetMesh::Half::PositiveX : TetMesh::Half::No),
        places_(points.places),
        skeleton_(skeleton),
        skin_(skin),
        samples_(samples.points, 0.4 * h),
        triangles_(samples.triangles),
        h_(h),
        sizes_(sizes),
        poll_(poll),
        boundary_faces_(mesh_.boundary_faces()) {
    for (const std::vector<int>& chain : points.chains)
      for (std::size_t i = 1; i < chain.size(); ++i) bone_edges_.insert(std::minmax(chain[i - 1], chain[i]));
  }

  void run() {
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      flip_sweep();
      for (int v = 0; v < static_cast<int>(mesh_.points.size()); ++v) {
        poll_();
        if (mesh_.star(v).empty() || places_[v].fixed) continue;
        if (on_boundary(v) && places_[v].bone < 0) pull(v);
        climb(v);
      }
    }
    flip_sweep();
  }

  TetMesh& mesh() { return mesh_; }
  std::vector<LatticePoints::Place>& places() { return places_; }

 private:
  void flip_sweep();
  bool flip(int t);
  void pull(int v);
  void climb(int v);
  bool try_move(int v, const Vector3d& target, double at_least);
  bool on_boundary(int v) const { return !boundary_faces_[v].empty(); }
  bool keeps_skin(int v, const Vector3d& target);

  TetMesh mesh_;
  std::vector<LatticePoints::Place> places_;
  const ReducedSkeleton& skeleton_;
  const UnitSkin& skin_;
  SampleGrid samples_;
  const TriangleGrid& triangles_;
  double h_;
  const CellSizes& sizes_;
  const Poll& poll_;
  /// Per vertex the other two corners of its boundary faces. Flips and moves keep the faces.
  std::vector<std::vector<std::array<int, 2>>> boundary_faces_;
  EdgeSet bone_edges_;
};

void Optimiser::flip_sweep() {
  std::vector<std::pair<double, int>> order;
  for (int t = 0; t < mesh_.num_slots(); ++t) {
    if (!mesh_.is_alive(t)) continue;
    const double q = mesh_.quality(t);
    if (q < kGoodEnough) order.emplace_back(q, t);
  }
  std::sort(order.begin(), order.end());
  for (const auto& [q, t] : order) {
    poll_();
    if (mesh_.is_alive(t)) flip(t);
  }
}

bool Optimiser::flip(int t) {
  static constexpr std::array<std::array<int, 2>, 6> kEdges{{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};
  const TetMesh::Tet tet = mesh_.tet(t);
  for (const auto& [i, k] : kEdges)
    if (remove_edge(mesh_, tet[i], tet[k], bone_edges_)) return true;
  for (int k = 0; k < 4; ++k)
    if (remove_face(mesh_, t, k)) return true;
  return false;
}

/// True where, with v at `target`, no skin triangle crosses its boundary faces and every sample that was in
/// its star still is. Samples elsewhere are not touched by the move.
bool Optimiser::keeps_skin(int v, const Vector3d& target) {
  const std::vector<int>& star = mesh_.star(v);
  const Vector3d old = mesh_.points[v];
  Vector3d low = old.cwiseMin(target), high = old.cwiseMax(target);
  for (const auto& [a, b] : boundary_faces_[v]) {
    if (triangles_.crosses({target, mesh_.points[a], mesh_.points[b]}, 0.0)) return false;
    for (const int u : {a, b}) {
      low = low.cwiseMin(mesh_.points[u]);
      high = high.cwiseMax(mesh_.points[u]);
    }
  }
  const auto in_star = [&](const Vector3d& at, const Vector3d& p) {
    mesh_.points[v] = at;
    return std::any_of(star.begin(), star.end(), [&](int t) {
      const TetMesh::Tet& c = mesh_.tet(t);
      return tetrahedron_contains(mesh_.points[c[0]], mesh_.points[c[1]], mesh_.points[c[2]],
                                  mesh_.points[c[3]], p, kSlack);
    });
  };
  const bool kept =
      samples_.all_of(low, high, [&](const Vector3d& p) { return in_star(target, p) || !in_star(old, p); });
  mesh_.points[v] = old;
  return kept;
}

bool Optimiser::try_move(int v, const Vector3d& target, double at_least) {
  const Vector3d old = mesh_.points[v];
  mesh_.points[v] = target;
  const double after = mesh_.star_quality(v);
  mesh_.points[v] = old;
  if (!(after > at_least)) return false;
  if (on_boundary(v) && !keeps_skin(v, target)) return false;
  mesh_.points[v] = target;
  return true;
}

/// Brings a boundary vertex toward the surface 0.2 h outside the skin.
void Optimiser::pull(int v) {
  const Vector3d p = mesh_.points[v];
  const double h = sizes_.edge_at(p, h_);
  const SurfaceQuery::Closest closest = skin_.query.closest(p);
  if (closest.distance < 1e-12) return;
  Vector3d outward = (p - closest.point) / closest.distance;
  if (skin_.is_inside(p)) outward = -outward;
  Vector3d target = closest.point + kOffset * h * outward;
  if (mesh_.is_in_plane(v)) target.x() = 0.0;
  if ((target - p).norm() < 0.02 * h) return;
  const double limit = std::min(mesh_.star_quality(v), kPullQuality) - 1e-12;
  for (const double share : {1.0, 0.5, 0.25})
    if (try_move(v, p + share * (target - p), limit)) return;
}

/// Moves a vertex to where its worst cell is better: along the coordinate axes and diagonals, or along its
/// bone.
void Optimiser::climb(int v) {
  double quality = mesh_.star_quality(v);
  if (on_boundary(v) && places_[v].bone < 0 && quality > kPullQuality) return;
  LatticePoints::Place& place = places_[v];
  double step = kFirstStep * sizes_.edge_at(mesh_.points[v], h_);
  for (int halving = 0; halving <= kHalvings; ++halving, step *= 0.5) {
    if (place.bone >= 0) {
      const ReducedBone& bone = skeleton_.bones[place.bone];
      const double length =
          (skeleton_.nodes[bone.end].position - skeleton_.nodes[bone.start].position).norm();
      for (const double sign : {-1.0, 1.0}) {
        const double s = place.s + sign * step / length;
        if (!(s > 0.0 && s < 1.0) || !try_move(v, point_on_bone(skeleton_, place.bone, s), quality + 1e-9))
          continue;
        place.s = s;
        quality = mesh_.star_quality(v);
        break;
      }
      continue;
    }
    const Vector3d from = mesh_.points[v];
    const bool in_plane = mesh_.is_in_plane(v);
    for (int n = 0; n < 27; ++n) {
      const Vector3d direction(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
      if (n == 13 || (in_plane && direction.x() != 0.0) ||
          !try_move(v, from + step * direction.normalized(), quality + 1e-9))
        continue;
      quality = mesh_.star_quality(v);
    }
  }
}

}  // namespace

void optimise(LatticePoints& points, Tetrahedra& cells, const ReducedSkeleton& skeleton, const UnitSkin& skin,
              const SkinSamples& samples, double h, const CellSizes& sizes, const Poll& poll) {
  Optimiser optimiser(points, cells, skeleton, skin, samples, h, sizes, poll);
  optimiser.run();
  points.points = std::move(optimiser.mesh().points);
  points.places = std::move(optimiser.places());
  cells = optimiser.mesh().cells();
}

}  // namespace sinew::lattice::detail
