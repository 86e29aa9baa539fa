#include "lattice/detail/skin_samples.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// Clearance that the lattice keeps outside the skin, in units of h.
constexpr double kShell = 0.03;
constexpr double kDraftSpacing = 1.0 / 3.0;  ///< between points on a triangle, in units of h.
constexpr double kFullSpacing = 1.0 / 10.0;  ///< likewise.
constexpr double kVoxel = 1.0 / 3.0;         ///< side of a voxel, in units of h.

void sample_triangles(const UnitSkin& skin, double spacing, double shell, std::vector<Vector3d>& out) {
  for (int t = 0; t < skin.triangles.rows(); ++t) {
    const Vector3d a = skin.points.row(skin.triangles(t, 0)), b = skin.points.row(skin.triangles(t, 1)),
                   c = skin.points.row(skin.triangles(t, 2));
    const double longest =
        std::sqrt(std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()}));
    const int n = static_cast<int>(std::ceil(longest / spacing));
    const Vector3d push = shell * (b - a).cross(c - a).normalized();
    for (int i = 0; i <= n; ++i)
      for (int j = 0; i + j <= n; ++j) {
        if (i == n || j == n || i + j == 0) continue;  // the vertices are samples already
        const Vector3d p =
            a + (b - a) * (static_cast<double>(i) / n) + (c - a) * (static_cast<double>(j) / n);
        out.push_back(p);
        out.push_back(p + push);
      }
  }
}

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

SkinSamples sample_skin(const UnitSkin& skin, double h, Density density) {
  const double shell = kShell * h;
  SkinSamples samples;
  for (int v = 0; v < skin.points.rows(); ++v) {
    const Vector3d p = skin.points.row(v);
    samples.points.push_back(p);
    samples.points.push_back(p + shell * skin.normals[v]);
  }
  sample_triangles(skin, h * (density == Density::Full ? kFullSpacing : kDraftSpacing), shell,
                   samples.points);
  sample_inside(skin, h * kVoxel, samples.points);
  return samples;
}

}  // namespace sinew::lattice::detail
