#include "fem/body/phong_skin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "fem/body/cell_matrices.h"

namespace sinew::fem {
namespace {

using lattice::Points;

/// F_a as rows: F_a = sum_b x_b g_b^T over the vertices b of a fan of cells round a.
using VertexGradient = std::map<int, Eigen::Vector3d>;

/// Two limbs may meet in nothing but a vertex, on a bone that runs into both: round it cells count together
/// where they share another of their vertices. Per leaf cell and corner the fan of cells that it is in.
struct Fans {
  std::vector<std::array<int, 8>> of_corner;
  int count = 0;
};

Fans fans_of(const lattice::LeafMesh& mesh) {
  struct Corner {
    std::size_t cell, corner;
  };
  std::vector<std::vector<Corner>> round(static_cast<std::size_t>(mesh.num_vertices()));
  for (std::size_t c = 0; c < mesh.cells.size(); ++c)
    for (std::size_t k = 0; k < 8; ++k) round[static_cast<std::size_t>(mesh.cells[c][k])].push_back({c, k});
  Fans fans;
  fans.of_corner.resize(mesh.cells.size());
  for (std::size_t a = 0; a < round.size(); ++a) {
    const std::vector<Corner>& corners = round[a];
    const auto hang_together = [&](const Corner& x, const Corner& y) {
      if (mesh.level[x.cell] != mesh.level[y.cell])
        return true;  // a coarse edge has other ends than its halves
      const lattice::HexVertices &of_x = mesh.cells[x.cell], &of_y = mesh.cells[y.cell];
      return std::any_of(of_x.begin(), of_x.end(), [&](int v) {
        return v != static_cast<int>(a) && std::find(of_y.begin(), of_y.end(), v) != of_y.end();
      });
    };
    std::vector<char> taken(corners.size(), 0);
    for (std::size_t first = 0; first < corners.size(); ++first) {
      if (taken[first]) continue;
      std::vector<std::size_t> fan{first};
      taken[first] = 1;
      for (std::size_t i = 0; i < fan.size(); ++i)
        for (std::size_t k = 0; k < corners.size(); ++k)
          if (!taken[k] && hang_together(corners[fan[i]], corners[k])) taken[k] = 1, fan.push_back(k);
      for (const std::size_t i : fan) fans.of_corner[corners[i].cell][corners[i].corner] = fans.count;
      ++fans.count;
    }
  }
  return fans;
}

std::vector<VertexGradient> vertex_gradients(const lattice::LeafMesh& mesh, const Fans& fans,
                                             const std::vector<lattice::FillFractions>& fill) {
  std::vector<VertexGradient> gradients(static_cast<std::size_t>(fans.count));
  std::vector<double> weight(gradients.size(), 0.0);
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const CellGeometry cell = cell_geometry(lattice::hex_corners(mesh.points, mesh.cells[c]), fill[c]);
    lattice::HexGradients flesh = lattice::HexGradients::Zero();  // of the whole cell, times its volume
    for (std::size_t q = 0; q < 8; ++q) flesh += cell.weights[q] * cell.gradients[q];
    for (const int fan : fans.of_corner[c]) {
      weight[static_cast<std::size_t>(fan)] += cell.volume;
      for (std::size_t k = 0; k < 8; ++k) {
        Eigen::Vector3d& sum = gradients[static_cast<std::size_t>(fan)]
                                   .try_emplace(mesh.cells[c][k], Eigen::Vector3d::Zero())
                                   .first->second;
        sum += flesh.row(static_cast<Eigen::Index>(k)).transpose();
      }
    }
  }
  for (std::size_t f = 0; f < gradients.size(); ++f)
    for (auto& [vertex, gradient] : gradients[f]) gradient /= weight[f];
  return gradients;
}

/// Mean length of the edges round each point of the surface [m]; 0 where there is none.
std::vector<double> edge_lengths(const lattice::Surface& surface) {
  std::vector<double> sum(static_cast<std::size_t>(surface.points.rows()), 0.0), count = sum;
  for (Eigen::Index t = 0; t < surface.triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int a = surface.triangles(t, k), b = surface.triangles(t, (k + 1) % 3);
      const double length = (surface.points.row(a) - surface.points.row(b)).norm();
      for (const int v : {a, b}) {
        sum[static_cast<std::size_t>(v)] += length;
        count[static_cast<std::size_t>(v)] += 1.0;
      }
    }
  }
  for (std::size_t v = 0; v < sum.size(); ++v) sum[v] /= std::max(count[v], 1.0);
  return sum;
}

double cell_size(const lattice::LeafMesh& mesh, int cell) {
  const lattice::HexCorners corners =
      lattice::hex_corners(mesh.points, mesh.cells[static_cast<std::size_t>(cell)]);
  return std::cbrt(lattice::trilinear_jacobian(corners, Eigen::Vector3d::Constant(0.5)).determinant());
}

}  // namespace

Eigen::SparseMatrix<double, Eigen::RowMajor> phong_rows(const lattice::LeafMesh& mesh,
                                                        const std::vector<lattice::FillFractions>& fill,
                                                        const lattice::Embedding& skin,
                                                        const lattice::Surface& surface, double share) {
  if (!(share > 0.0)) return skin.weights;
  const Fans fans = fans_of(mesh);
  const std::vector<VertexGradient> gradients = vertex_gradients(mesh, fans, fill);
  const std::vector<double> lengths = edge_lengths(surface);
  std::vector<Eigen::Triplet<double>> triplets;
  for (int k = 0; k < skin.weights.outerSize(); ++k) {
    const bool outside = std::binary_search(skin.outside.begin(), skin.outside.end(), k);
    const double relative =
        lengths[static_cast<std::size_t>(k)] / cell_size(mesh, skin.cell[static_cast<std::size_t>(k)]);
    const double s = outside ? 0.0 : share * std::clamp(2.0 * (1.0 - relative), 0.0, 1.0);
    std::map<int, double> row;
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(skin.weights, k); it; ++it) {
      const auto a = static_cast<int>(it.col());
      row[a] += it.value();
      if (s == 0.0) continue;
      const Eigen::Vector3d arm = (surface.points.row(k) - mesh.points.row(a)).transpose();
      const auto cell = static_cast<std::size_t>(skin.cell[static_cast<std::size_t>(k)]);
      const auto corner = static_cast<std::size_t>(
          std::find(mesh.cells[cell].begin(), mesh.cells[cell].end(), a) - mesh.cells[cell].begin());
      for (const auto& [b, gradient] : gradients[static_cast<std::size_t>(fans.of_corner[cell][corner])])
        row[b] += s * it.value() * gradient.dot(arm);
    }
    for (const auto& [b, value] : row) triplets.emplace_back(k, b, value);
  }
  Eigen::SparseMatrix<double, Eigen::RowMajor> rows(skin.weights.rows(), skin.weights.cols());
  rows.setFromTriplets(triplets.begin(), triplets.end());
  return rows;
}

}  // namespace sinew::fem
