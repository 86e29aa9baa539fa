#include "fem/phong_skin.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "fem/cell_matrices.h"

namespace sinew::fem {
namespace {

using lattice::Points;

/// F_a as rows: F_a = sum_b x_b g_b^T over the vertices b of the cells round a.
using VertexGradient = std::map<int, Eigen::Vector3d>;

std::vector<VertexGradient> vertex_gradients(const lattice::LeafMesh& mesh,
                                             const std::vector<lattice::FillFractions>& fill) {
  std::vector<VertexGradient> gradients(static_cast<std::size_t>(mesh.num_vertices()));
  std::vector<double> weight(gradients.size(), 0.0);
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const CellGeometry cell = cell_geometry(lattice::hex_corners(mesh.points, mesh.cells[c]), fill[c]);
    lattice::HexGradients flesh = lattice::HexGradients::Zero();  // of the whole cell, times its volume
    for (std::size_t q = 0; q < 8; ++q) flesh += cell.weights[q] * cell.gradients[q];
    for (const int a : mesh.cells[c]) {
      weight[static_cast<std::size_t>(a)] += cell.volume;
      for (std::size_t k = 0; k < 8; ++k) {
        Eigen::Vector3d& sum = gradients[static_cast<std::size_t>(a)]
                                   .try_emplace(mesh.cells[c][k], Eigen::Vector3d::Zero())
                                   .first->second;
        sum += flesh.row(static_cast<Eigen::Index>(k)).transpose();
      }
    }
  }
  for (std::size_t a = 0; a < gradients.size(); ++a)
    for (auto& [vertex, gradient] : gradients[a]) gradient /= weight[a];
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
  const std::vector<VertexGradient> gradients = vertex_gradients(mesh, fill);
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
      for (const auto& [b, gradient] : gradients[static_cast<std::size_t>(a)])
        row[b] += s * it.value() * gradient.dot(arm);
    }
    for (const auto& [b, value] : row) triplets.emplace_back(k, b, value);
  }
  Eigen::SparseMatrix<double, Eigen::RowMajor> rows(skin.weights.rows(), skin.weights.cols());
  rows.setFromTriplets(triplets.begin(), triplets.end());
  return rows;
}

}  // namespace sinew::fem
