#include "lattice/fill.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sinew::lattice {
namespace {

/// `limbs`: nullptr where no other cell lies in this place.
FillFractions sample_cell(const HexCorners& corners, const SurfaceQuery& skin, double shell, int cell,
                          const LeafLimbs* limbs) {
  FillFractions fill{};
  for (int k = 0; k < 8; ++k) {
    int filled = 0;
    for (int s = 0; s < 8; ++s) {
      Eigen::Vector3d xi;
      for (int c = 0; c < 3; ++c) xi[c] = 0.5 * kCorners[k][c] + 0.125 + 0.25 * kCorners[s][c];
      const Eigen::Vector3d p = corners.transpose() * trilinear_weights(xi);
      const bool is_inside = skin.winding_number(p) > 0.5;
      if (is_inside && !limbs) {
        ++filled;
        continue;
      }
      const SurfaceQuery::Closest closest = skin.closest(p);
      if ((is_inside || closest.distance <= shell) && (!limbs || limbs->owns_flesh(cell, closest))) ++filled;
    }
    fill[static_cast<std::size_t>(k)] = filled / 8.0;
  }
  return fill;
}

}  // namespace

std::vector<FillFractions> fill_fractions(const LeafMesh& mesh, const SurfaceQuery& skin, double shell,
                                          const LeafLimbs* limbs) {
  std::vector<FillFractions> fill(mesh.cells.size());
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const HexCorners corners = hex_corners(mesh.points, mesh.cells[c]);
    const Eigen::Vector3d centre = corners.colwise().mean().transpose();
    const double radius = (corners.rowwise() - centre.transpose()).rowwise().norm().maxCoeff();
    const bool is_shared = limbs && limbs->is_copy(static_cast<int>(c));
    // The winding number changes only across the surface: a cell that the surface does not reach is all one
    // thing.
    if (!is_shared && skin.closest(centre).distance > radius + shell) {
      fill[c].fill(skin.winding_number(centre) > 0.5 ? 1.0 : 0.0);
    } else {
      fill[c] = sample_cell(corners, skin, shell, static_cast<int>(c), is_shared ? limbs : nullptr);
    }
  }
  return fill;
}

TriangleSamples sample_triangles(const Points& points, const Triangles& triangles, double spacing) {
  std::vector<double> samples;
  std::vector<int> vertices;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Eigen::RowVector3d a = points.row(triangles(t, 0));
    const Eigen::RowVector3d ab = points.row(triangles(t, 1)) - a, ac = points.row(triangles(t, 2)) - a;
    const double longest = std::max({ab.norm(), ac.norm(), (ab - ac).norm()});
    const int n = std::max(1, static_cast<int>(std::ceil(longest / spacing)));
    for (int i = 0; i <= n; ++i) {
      for (int j = 0; i + j <= n; ++j) {
        const Eigen::RowVector3d p = a + (ab * i + ac * j) / n;
        samples.insert(samples.end(), p.data(), p.data() + 3);
        int nearest = 0;
        const auto distance_squared = [&](int k) { return (points.row(triangles(t, k)) - p).squaredNorm(); };
        for (int k = 1; k < 3; ++k)
          if (distance_squared(k) < distance_squared(nearest)) nearest = k;
        vertices.push_back(triangles(t, nearest));
      }
    }
  }
  return {Eigen::Map<const Points>(samples.data(), static_cast<Eigen::Index>(samples.size() / 3), 3),
          std::move(vertices)};
}

void fill_grazed_octants(const LeafMesh& mesh, const Points& samples, std::vector<FillFractions>& fill,
                         const CellFilter& may_hold) {
  const Embedding embedding = embed(mesh, samples, may_hold);
  for (std::size_t i = 0; i < embedding.cell.size(); ++i) {
    const Eigen::RowVector3d xi = embedding.xi.row(static_cast<Eigen::Index>(i));
    for (std::size_t k = 0; k < 8; ++k) {
      bool here = true;
      for (int c = 0; c < 3; ++c)
        here = here && (xi[c] > 0.5) == (kCorners[k][static_cast<std::size_t>(c)] == 1);
      double& share = fill[static_cast<std::size_t>(embedding.cell[i])][k];
      if (here) share = std::max(share, kGrazedFill);
    }
  }
}

std::vector<std::uint8_t> filled_cells(const std::vector<FillFractions>& fill,
                                       const std::vector<int>& embedded_cells) {
  std::vector<std::uint8_t> keep(fill.size(), 0);
  for (std::size_t c = 0; c < fill.size(); ++c) {
    keep[c] = std::any_of(fill[c].begin(), fill[c].end(), [](double f) { return f > 0.0; });
  }
  for (int c : embedded_cells) {
    if (c >= 0) keep[static_cast<std::size_t>(c)] = 1;
  }
  return keep;
}

}  // namespace sinew::lattice
