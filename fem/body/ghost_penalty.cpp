#include "fem/body/ghost_penalty.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
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

}  // namespace

std::vector<GhostFace> ghost_faces(const lattice::LeafMesh& mesh,
                                   std::span<const lattice::FillFractions> fill,
                                   const GhostPenalty& penalty) {
  std::vector<GhostFace> faces;
  if (!(penalty.strength > 0.0)) return faces;
  std::map<std::array<int, 4>, std::vector<Side>> sides_of;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    for (std::size_t f = 0; f < kFaces.size(); ++f) {
      std::array<int, 4> key;
      for (std::size_t k = 0; k < 4; ++k) key[k] = mesh.cells[c][static_cast<std::size_t>(kFaces[f][k])];
      std::sort(key.begin(), key.end());
      sides_of[key].push_back({static_cast<int>(c), f});
    }
  }
  const auto is_slight = [&](int cell) {
    return mean_fill(fill[static_cast<std::size_t>(cell)]) < penalty.below;
  };
  const auto outwards = [&](const Side& side) {
    const HexCorners corners =
        lattice::hex_corners(mesh.points, mesh.cells[static_cast<std::size_t>(side.cell)]);
    return area_vector(face_points(corners, kFaces[side.face]));
  };
  for (const auto& [key, sides] : sides_of) {
    for (std::size_t i = 0; i < sides.size(); ++i) {
      for (std::size_t j = i + 1; j < sides.size(); ++j) {
        const Side &a = sides[i], &b = sides[j];
        if (!is_slight(a.cell) && !is_slight(b.cell)) continue;
        if (outwards(a).dot(outwards(b)) >= 0.0) continue;  // copies on the same side
        GhostFace face;
        face.cell = {a.cell, b.cell};
        const lattice::HexVertices &of_a = mesh.cells[static_cast<std::size_t>(a.cell)],
                                   &of_b = mesh.cells[static_cast<std::size_t>(b.cell)];
        face.corner[0] = kFaces[a.face];
        for (std::size_t k = 0; k < 4; ++k) {
          const int vertex = of_a[static_cast<std::size_t>(kFaces[a.face][k])];
          face.corner[1][k] = static_cast<int>(std::find(of_b.begin(), of_b.end(), vertex) - of_b.begin());
        }
        faces.push_back(face);
      }
    }
  }
  // By cells, not by the vertices of the face: a fixed order that does not depend on the map's.
  std::sort(faces.begin(), faces.end(), [](const GhostFace& a, const GhostFace& b) {
    return std::tie(a.cell, a.corner[0]) < std::tie(b.cell, b.corner[0]);
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

  const FaceCorners points = face_points(corners[0], face.corner[0]);
  const double h = 0.5 * (volume[0] + volume[1]) / area_vector(points).norm();
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
      for (std::size_t k = 0; k < 4; ++k) {
        const auto& corner = lattice::kCorners[static_cast<std::size_t>(face.corner[s][k])];
        xi += weights.value[static_cast<Eigen::Index>(k)] * Eigen::Vector3d(corner[0], corner[1], corner[2]);
      }
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
