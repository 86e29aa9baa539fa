#include "lattice/detail/skin_samples.h"

#include <algorithm>
#include <cmath>

#include "lattice/detail/symmetry.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// Clearance that the lattice keeps outside the skin's vertices, in units of h.
constexpr double kShell = 0.03;
constexpr double kVoxel = 1.0 / 3.0;  ///< side of a voxel, in units of h.
constexpr double kGridSide = 0.5;     ///< of the grid of triangles, in units of h.

/// Calls visit(p) for the middles of the parts of a voxel, cut so that they are as small as the edges there.
template <class Visit>
void visit_parts(const Vector3d& middle, double voxel, double h, const CellSizes& sizes, const Visit& visit) {
  const int parts = std::max(1, static_cast<int>(std::ceil(h / sizes.edge_at(middle, h) - 0.01)));
  for (int n = 0; n < parts * parts * parts; ++n) {
    const Vector3d place(n % parts, n / parts % parts, n / (parts * parts));
    visit(Vector3d(middle + voxel / parts * (place - Vector3d::Constant(0.5 * (parts - 1)))));
  }
}

void sample_inside(const UnitSkin& skin, double h, const CellSizes& sizes, const Poll& poll,
                   std::vector<Vector3d>& out) {
  const double voxel = kVoxel * h;
  const Vector3d low = skin.points.colwise().minCoeff(), high = skin.points.colwise().maxCoeff();
  const Eigen::Vector3i count = ((high - low) / voxel).array().ceil().cast<int>().max(1);
  const Vector3d first = 0.5 * (low + high) - 0.5 * voxel * (count.cast<double>() - Vector3d::Ones());
  for (int i = 0; i < count.x(); ++i)
    for (int j = 0; j < count.y(); ++j) {
      poll();
      for (int k = 0; k < count.z(); ++k) {
        const Vector3d p = first + voxel * Vector3d(i, j, k);
        if (sizes.is_uniform(h)) {
          if (skin.is_inside(p)) out.push_back(p);
          continue;
        }
        visit_parts(p, voxel, h, sizes, [&](const Vector3d& part) {
          if (skin.is_inside(part)) out.push_back(part);
        });
      }
    }
}

}  // namespace

SkinSamples sample_skin(const UnitSkin& skin, double h, Halves halves, const CellSizes& sizes,
                        const Poll& poll) {
  const bool fold = halves == Halves::OneMirrored;
  std::vector<Vector3d> points;
  for (int v = 0; v < skin.points.rows(); ++v) {
    const Vector3d p = skin.points.row(v);
    points.push_back(p);
    points.push_back(p + kShell * sizes.edge_at(p, h) * skin.normals[v]);
  }
  sample_inside(skin, h, sizes, poll, points);
  std::vector<TriangleCorners> triangles;
  for (int t = 0; t < skin.triangles.rows(); ++t)
    triangles.push_back({skin.points.row(skin.triangles(t, 0)), skin.points.row(skin.triangles(t, 1)),
                         skin.points.row(skin.triangles(t, 2))});
  if (fold) {
    for (Vector3d& p : points)
      if (p.x() < 0.0) p = reflected(p);
    // Partners may be cut along other diagonals: every triangle counts on both sides.
    std::vector<TriangleCorners> kept;
    for (const TriangleCorners& t : triangles) {
      const double low = std::min({t[0].x(), t[1].x(), t[2].x()}),
                   high = std::max({t[0].x(), t[1].x(), t[2].x()});
      if (high > 0.0) kept.push_back(t);
      if (low < 0.0) kept.push_back({reflected(t[0]), reflected(t[1]), reflected(t[2])});
    }
    triangles = std::move(kept);
  }
  return {std::move(points), TriangleGrid(std::move(triangles), kGridSide * h)};
}

}  // namespace sinew::lattice::detail
