#include "fem/body/ghost_penalty.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace sinew::fem {
namespace {

using lattice::HexCorners;
using lattice::HexGradients;

/// Corners of a hexahedron's faces, counter-clockwise seen from outside.
constexpr std::array<std::array<int, 4>, 6> kFaces{
    {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}}};

using FaceCorners = Eigen::Matrix<double, 4, 3>;

FaceCorners face_points(const HexCorners& corners, const std::array<int, 4>& face) {
  FaceCorners points;
  for (int k = 0; k < 4; ++k) points.row(k) = corners.row(face[static_cast<std::size_t>(k)]);
  return points;
}

/// Area vector of a quadrilateral, half the cross product of its diagonals.
Eigen::Vector3d area_vector(const FaceCorners& p) {
  const Eigen::Vector3d first = (p.row(2) - p.row(0)).transpose(), second = (p.row(3) - p.row(1)).transpose();
  return 0.5 * first.cross(second);
}

double mean_fill(const lattice::FillFractions& fill) {
  return std::accumulate(fill.begin(), fill.end(), 0.0) / 8.0;
}

/// One side of a face: its cell and the local number of the face.
struct Side {
  int cell;
  std::size_t face;
};

/// Bilinear weights of a face's four corners and their derivatives at (u, v) in [0, 1]^2.
struct FaceWeights {
  Eigen::Vector4d value, by_u, by_v;
  FaceWeights(double u, double v)
      : value((1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v),
        by_u(-(1 - v), 1 - v, v, -v),
        by_v(-(1 - u), -u, u, 1 - u) {}
};

using Sides = std::map<std::array<int, 4>, std::vector<Side>>;  ///< by the vertices of the face, ascending.

std::array<int, 4> face_key(const lattice::HexVertices& cell, std::size_t face) {
  std::array<int, 4> key;
  for (std::size_t k = 0; k < 4; ++k) key[k] = cell[static_cast<std::size_t>(kFaces[face][k])];
  std::sort(key.begin(), key.end());
  return key;
}

Sides sides_of_faces(const lattice::LeafMesh& mesh) {
  Sides sides_of;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c)
    for (std::size_t f = 0; f < kFaces.size(); ++f)
      sides_of[face_key(mesh.cells[c], f)].push_back({static_cast<int>(c), f});
  return sides_of;
}

Eigen::Vector3d corner_point(int k) {
  const auto& corner = lattice::kCorners[static_cast<std::size_t>(k)];
  return {static_cast<double>(corner[0]), static_cast<double>(corner[1]), static_cast<double>(corner[2])};
}

/// The face `face` of a hexahedron whose corners are `vertices`, seen by cell `cell` of the mesh, on whose
/// face it lies, or is: local coordinates there of `points`, given by those in the hexahedron.
std::array<Eigen::Vector3d, 4> seen_by(const lattice::HexVertices& cell, const lattice::HexVertices& vertices,
                                       std::size_t face, const std::array<Eigen::Vector3d, 4>& points) {
  std::array<Eigen::Vector3d, 4> seen;
  for (std::size_t p = 0; p < 4; ++p) {
    const lattice::HexWeights weights = lattice::trilinear_weights(points[p]);
    seen[p].setZero();
    for (const int k : kFaces[face]) {
      const auto at = std::find(cell.begin(), cell.end(), vertices[static_cast<std::size_t>(k)]);
      seen[p] += weights[k] * corner_point(static_cast<int>(at - cell.begin()));
    }
  }
  return seen;
}

/// Finds what lies across the faces of fine cells beside coarser ones, hexahedra of which a leaf mesh has the
/// parts only.
class CoarserFaces {
 public:
  explicit CoarserFaces(const lattice::LeafMesh& mesh) : mesh_(mesh) {
    const auto [low, high] = std::minmax_element(mesh.level.begin(), mesh.level.end());
    if (low == mesh.level.end()) return;
    coarsest_ = *low;
    finest_ = *high;
    for (std::size_t c = 0; c < mesh.cells.size(); ++c) first_.push_back(place(mesh.level[c], mesh.hex[c]));
  }

  /// Adds the faces between `side` and coarser cells of `sides_of`. Counts: (Side, Side) -> bool.
  template <class Counts>
  void add(const Side& side, const Sides& sides_of, const Counts& counts,
           std::vector<GhostFace>& faces) const {
    const auto c = static_cast<std::size_t>(side.cell);
    std::array<Eigen::Vector3d, 4> points;
    for (std::size_t k = 0; k < 4; ++k) points[k] = corner_point(kFaces[side.face][k]);
    std::size_t face = side.face;
    double share = 1.0;
    int hex = mesh_.hex[c];
    for (int level = mesh_.level[c]; level > coarsest_; --level, hex /= 8) {
      const std::optional<std::size_t> of_parent = parents_face(hex % 8, face);
      if (!of_parent) return;
      face = *of_parent;
      share *= 0.25;
      for (Eigen::Vector3d& point : points) point = lattice::in_parent(hex % 8, point);
      const lattice::HexVertices parent = corners_of(level - 1, hex / 8);
      const auto found = sides_of.find(face_key(parent, face));
      if (found == sides_of.end()) continue;
      for (const Side& other : found->second) {
        if (!counts(side, other)) continue;
        const lattice::HexVertices& cell = mesh_.cells[static_cast<std::size_t>(other.cell)];
        faces.push_back(
            {{side.cell, other.cell}, kFaces[side.face], seen_by(cell, parent, face, points), share});
      }
    }
  }

 private:
  long place(int level, int hex) const { return static_cast<long>(hex) << (3 * (finest_ - level)); }

  /// Corners of a hexahedron that is split, as leaf vertices: each is corner 0 of the child there, and of
  /// that one's child, down to a leaf cell.
  lattice::HexVertices corners_of(int level, int hex) const {
    lattice::HexVertices corners;
    for (int k = 0; k < 8; ++k) {
      const auto leaf = std::lower_bound(first_.begin(), first_.end(), place(level + 1, 8 * hex + k));
      corners[static_cast<std::size_t>(k)] = mesh_.cells[static_cast<std::size_t>(leaf - first_.begin())][0];
    }
    return corners;
  }

  /// The face of the parent on which face `face` of its child `child` lies; none where that is inside.
  static std::optional<std::size_t> parents_face(int child, std::size_t face) {
    const std::array<int, 3>& neighbours =
        lattice::corner_neighbours(lattice::CellType::Hexahedron)[static_cast<std::size_t>(child)];
    std::array<int, 3> on{child, -1, -1};  // three corners of the parent's face
    std::size_t count = 1;
    for (std::size_t d = 0; d < 3; ++d) {
      constexpr std::array<int, 3> kAlong{1, 3, 4};  // corner of the child along axis d from its corner 0
      if (std::find(kFaces[face].begin(), kFaces[face].end(), kAlong[d]) != kFaces[face].end() && count < 3)
        on[count++] = neighbours[d];
    }
    if (std::find(kFaces[face].begin(), kFaces[face].end(), 0) == kFaces[face].end()) return std::nullopt;
    for (std::size_t f = 0; f < kFaces.size(); ++f)
      if (std::all_of(on.begin(), on.end(), [&](int k) {
            return std::find(kFaces[f].begin(), kFaces[f].end(), k) != kFaces[f].end();
          }))
        return f;
    return std::nullopt;
  }

  const lattice::LeafMesh& mesh_;
  int coarsest_ = 1, finest_ = 1;
  std::vector<long> first_;  ///< per leaf cell the finest hexahedron at its corner 0; ascending.
};

}  // namespace

std::vector<GhostFace> ghost_faces(const lattice::LeafMesh& mesh,
                                   std::span<const lattice::FillFractions> fill,
                                   const GhostPenalty& penalty) {
  std::vector<GhostFace> faces;
  if (!(penalty.strength > 0.0)) return faces;
  const Sides sides_of = sides_of_faces(mesh);
  const auto is_slight = [&](int cell) {
    return mean_fill(fill[static_cast<std::size_t>(cell)]) < penalty.below;
  };
  const auto outwards = [&](const Side& side) {
    const HexCorners corners =
        lattice::hex_corners(mesh.points, mesh.cells[static_cast<std::size_t>(side.cell)]);
    return area_vector(face_points(corners, kFaces[side.face]));
  };
  const auto counts = [&](const Side& a, const Side& b) {
    if (!is_slight(a.cell) && !is_slight(b.cell)) return false;
    return outwards(a).dot(outwards(b)) < 0.0;  // else copies on the same side
  };
  const CoarserFaces coarser(mesh);
  for (const auto& [key, sides] : sides_of) {
    for (std::size_t i = 0; i < sides.size(); ++i) {
      coarser.add(sides[i], sides_of, counts, faces);
      for (std::size_t j = i + 1; j < sides.size(); ++j) {
        const Side &a = sides[i], &b = sides[j];
        if (!counts(a, b)) continue;
        std::array<Eigen::Vector3d, 4> points;
        for (std::size_t k = 0; k < 4; ++k) points[k] = corner_point(kFaces[a.face][k]);
        faces.push_back({{a.cell, b.cell},
                         kFaces[a.face],
                         seen_by(mesh.cells[static_cast<std::size_t>(b.cell)],
                                 mesh.cells[static_cast<std::size_t>(a.cell)], a.face, points),
                         1.0});
      }
    }
  }
  // By cells, not by the vertices of the face: a fixed order that does not depend on the map's.
  std::sort(faces.begin(), faces.end(), [](const GhostFace& a, const GhostFace& b) {
    return std::tie(a.cell, a.corner) < std::tie(b.cell, b.corner);
  });
  return faces;
}

GhostMatrix ghost_matrix(const lattice::LeafMesh& mesh, const GhostFace& face, double mu,
                         const GhostPenalty& penalty) {
  std::array<HexCorners, 2> corners;
  std::array<double, 2> volume{};
  GhostMatrix ghost;
  for (std::size_t s = 0; s < 2; ++s) {
    const lattice::HexVertices& cell = mesh.cells[static_cast<std::size_t>(face.cell[s])];
    corners[s] = lattice::hex_corners(mesh.points, cell);
    volume[s] = lattice::trilinear_jacobian(corners[s], Eigen::Vector3d::Constant(0.5)).determinant();
    ghost.vertices.insert(ghost.vertices.end(), cell.begin(), cell.end());
  }
  std::sort(ghost.vertices.begin(), ghost.vertices.end());
  ghost.vertices.erase(std::unique(ghost.vertices.begin(), ghost.vertices.end()), ghost.vertices.end());
  const auto n = static_cast<Eigen::Index>(ghost.vertices.size());
  ghost.matrix = Eigen::MatrixXd::Zero(n, n);
  std::array<std::array<Eigen::Index, 8>, 2> place{};  // of the cells' corners among the vertices
  for (std::size_t s = 0; s < 2; ++s)
    for (std::size_t k = 0; k < 8; ++k)
      place[s][k] = std::lower_bound(ghost.vertices.begin(), ghost.vertices.end(),
                                     mesh.cells[static_cast<std::size_t>(face.cell[s])][k]) -
                    ghost.vertices.begin();

  std::array<Eigen::Vector3d, 4> in_first;
  for (std::size_t k = 0; k < 4; ++k) in_first[k] = corner_point(face.corner[k]);
  const FaceCorners points = face_points(corners[0], face.corner);
  const double h = 0.5 * (volume[0] + face.share * volume[1]) / area_vector(points).norm();
  const double low = 0.5 - 0.5 / std::sqrt(3.0), high = 1.0 - low;
  for (const auto& [u, v] : {std::pair(low, low), {high, low}, {high, high}, {low, high}}) {
    const FaceWeights weights(u, v);
    const Eigen::Vector3d along_u = points.transpose() * weights.by_u,
                          along_v = points.transpose() * weights.by_v;
    const Eigen::Vector3d area = along_u.cross(along_v);
    const Eigen::Vector3d normal = area.normalized();
    Eigen::VectorXd jump = Eigen::VectorXd::Zero(n);
    for (std::size_t s = 0; s < 2; ++s) {
      // Local coordinates are linear along a face: those of its corners, blended.
      Eigen::Vector3d xi = Eigen::Vector3d::Zero();
      for (std::size_t k = 0; k < 4; ++k)
        xi += weights.value[static_cast<Eigen::Index>(k)] * (s == 0 ? in_first : face.in_second)[k];
      const HexGradients gradients =
          lattice::trilinear_gradients(xi) * lattice::trilinear_jacobian(corners[s], xi).inverse();
      const Eigen::Matrix<double, 8, 1> along_normal = gradients * normal;
      for (std::size_t k = 0; k < 8; ++k)
        jump[place[s][k]] += (s == 0 ? 1.0 : -1.0) * along_normal[static_cast<Eigen::Index>(k)];
    }
    ghost.matrix += (0.25 * area.norm() * penalty.strength * mu * h) * jump * jump.transpose();
  }
  return ghost;
}

}  // namespace sinew::fem
