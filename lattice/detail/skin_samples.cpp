#include "lattice/detail/skin_samples.h"

#include <algorithm>
#include <cmath>

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// Clearance that the lattice keeps outside the skin's vertices, in units of h.
constexpr double kShell = 0.03;
constexpr double kVoxel = 1.0 / 3.0;  ///< side of a voxel, in units of h.
constexpr double kGridSide = 0.5;     ///< of the grid of triangles, in units of h.

void sample_inside(const UnitSkin& skin, double voxel, std::vector<Vector3d>& out) {
  const Vector3d low = skin.points.colwise().minCoeff(), high = skin.points.colwise().maxCoeff();
  const Eigen::Vector3i count = ((high - low) / voxel).array().ceil().cast<int>().max(1);
  const Vector3d first = 0.5 * (low + high) - 0.5 * voxel * (count.cast<double>() - Vector3d::Ones());
  for (int i = 0; i < count.x(); ++i)
    for (int j = 0; j < count.y(); ++j)
      for (int k = 0; k < count.z(); ++k) {
        const Vector3d p = first + voxel * Vector3d(i, j, k);
        if (skin.is_inside(p)) out.push_back(p);
      }
}

}  // namespace

SkinSamples sample_skin(const UnitSkin& skin, double h) {
  std::vector<Vector3d> points;
  for (int v = 0; v < skin.points.rows(); ++v) {
    const Vector3d p = skin.points.row(v);
    points.push_back(p);
    points.push_back(p + kShell * h * skin.normals[v]);
  }
  sample_inside(skin, h * kVoxel, points);
  std::vector<TriangleCorners> triangles;
  for (int t = 0; t < skin.triangles.rows(); ++t)
    triangles.push_back({skin.points.row(skin.triangles(t, 0)), skin.points.row(skin.triangles(t, 1)),
                         skin.points.row(skin.triangles(t, 2))});
  return {std::move(points), TriangleGrid(std::move(triangles), kGridSide * h)};
}

}  // namespace sinew::lattice::detail
