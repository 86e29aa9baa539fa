#include "lattice/fill.h"

#include <algorithm>

namespace sinew::lattice {
namespace {

FillFractions sample_cell(const HexCorners& corners, const SurfaceQuery& skin, double shell) {
  FillFractions fill{};
  for (int k = 0; k < 8; ++k) {
    int filled = 0;
    for (int s = 0; s < 8; ++s) {
      Eigen::Vector3d xi;
      for (int c = 0; c < 3; ++c) xi[c] = 0.5 * kCorners[k][c] + 0.125 + 0.25 * kCorners[s][c];
      const Eigen::Vector3d p = corners.transpose() * trilinear_weights(xi);
      if (skin.winding_number(p) > 0.5 || skin.closest(p).distance <= shell) ++filled;
    }
    fill[static_cast<std::size_t>(k)] = filled / 8.0;
  }
  return fill;
}

}  // namespace

std::vector<FillFractions> fill_fractions(const LeafMesh& mesh, const SurfaceQuery& skin, double shell) {
  std::vector<FillFractions> fill(mesh.cells.size());
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const HexCorners corners = hex_corners(mesh.points, mesh.cells[c]);
    const Eigen::Vector3d centre = corners.colwise().mean().transpose();
    const double radius = (corners.rowwise() - centre.transpose()).rowwise().norm().maxCoeff();
    // The winding number changes only across the surface: a cell that the surface does not reach is all one
    // thing.
    if (skin.closest(centre).distance > radius + shell) {
      fill[c].fill(skin.winding_number(centre) > 0.5 ? 1.0 : 0.0);
    } else {
      fill[c] = sample_cell(corners, skin, shell);
    }
  }
  return fill;
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
