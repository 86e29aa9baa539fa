#include "lattice/detail/triangle_grid.h"

#include <algorithm>

#include <Eigen/Geometry>

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

constexpr double kLargestGrid = 160.0;  ///< cells along the longest side.

struct Box {
  Vector3d low, high;
};

Box box_of(const TriangleCorners& t) {
  return {t[0].cwiseMin(t[1]).cwiseMin(t[2]), t[0].cwiseMax(t[1]).cwiseMax(t[2])};
}

bool segment_crosses(const Vector3d& p, const Vector3d& q, const TriangleCorners& t, const Vector3d& normal,
                     double eps) {
  const double dp = normal.dot(p - t[0]), dq = normal.dot(q - t[0]);
  if (!((dp > eps && dq < -eps) || (dp < -eps && dq > eps))) return false;
  const Vector3d x = p + (q - p) * (dp / (dp - dq));
  for (int k = 0; k < 3; ++k) {
    const Vector3d edge = t[(k + 1) % 3] - t[k];
    if (normal.dot(edge.cross(x - t[k])) <= eps * edge.norm()) return false;
  }
  return true;
}

}  // namespace

bool triangles_cross(const TriangleCorners& a, const TriangleCorners& b, double eps) {
  const Vector3d na = (a[1] - a[0]).cross(a[2] - a[0]).normalized();
  const Vector3d nb = (b[1] - b[0]).cross(b[2] - b[0]).normalized();
  const auto one_side = [&](const TriangleCorners& t, const Vector3d& normal, const TriangleCorners& plane) {
    const double d0 = normal.dot(t[0] - plane[0]), d1 = normal.dot(t[1] - plane[0]),
                 d2 = normal.dot(t[2] - plane[0]);
    return std::min({d0, d1, d2}) >= -eps || std::max({d0, d1, d2}) <= eps;
  };
  if (one_side(a, nb, b) || one_side(b, na, a)) return false;
  for (int k = 0; k < 3; ++k)
    if (segment_crosses(a[k], a[(k + 1) % 3], b, nb, eps) ||
        segment_crosses(b[k], b[(k + 1) % 3], a, na, eps)) {
      return true;
    }
  return false;
}

TriangleGrid::TriangleGrid(std::vector<TriangleCorners> triangles, double side)
    : triangles_(std::move(triangles)), side_(side), seen_(triangles_.size(), 0) {
  if (!triangles_.empty()) {
    Vector3d high = triangles_[0][0];
    low_ = high;
    for (const TriangleCorners& t : triangles_) {
      low_ = low_.cwiseMin(box_of(t).low);
      high = high.cwiseMax(box_of(t).high);
    }
    side_ = std::max(side, (high - low_).maxCoeff() / kLargestGrid);
    count_ = ((high - low_) / side_).array().floor().cast<int>() + 1;
  }
  cells_.resize(count_.prod());
  for (int n = 0; n < static_cast<int>(triangles_.size()); ++n) {
    const Box box = box_of(triangles_[n]);
    const Eigen::Vector3i first = cell_of(box.low), last = cell_of(box.high);
    for (int i = first.x(); i <= last.x(); ++i)
      for (int j = first.y(); j <= last.y(); ++j)
        for (int k = first.z(); k <= last.z(); ++k)
          cells_[(i * count_.y() + j) * count_.z() + k].push_back(n);
  }
}

Eigen::Vector3i TriangleGrid::cell_of(const Vector3d& p) const {
  const Eigen::Array3d scaled = ((p - low_) / side_).array().floor();
  return scaled.max(0.0).min((count_.array() - 1).cast<double>()).cast<int>();
}

bool TriangleGrid::crosses(const TriangleCorners& t, double eps) const {
  return !for_each_crossing(t, eps, [](int) { return false; });
}

template <class Visit>
bool TriangleGrid::visit_near(const Vector3d& low, const Vector3d& high, const Visit& visit) const {
  ++question_;
  const Eigen::Vector3i first = cell_of(low), last = cell_of(high);
  for (int i = first.x(); i <= last.x(); ++i)
    for (int j = first.y(); j <= last.y(); ++j)
      for (int k = first.z(); k <= last.z(); ++k)
        for (const int n : cells_[(i * count_.y() + j) * count_.z() + k]) {
          if (seen_[n] == question_) continue;
          seen_[n] = question_;
          const Box other = box_of(triangles_[n]);
          if ((other.low.array() > high.array()).any() || (other.high.array() < low.array()).any()) continue;
          if (!visit(n)) return false;
        }
  return true;
}

bool TriangleGrid::for_each_crossing(const TriangleCorners& t, double eps,
                                     const std::function<bool(int)>& visit) const {
  const Box box = box_of(t);
  return visit_near(box.low, box.high,
                    [&](int n) { return !triangles_cross(t, triangles_[n], eps) || visit(n); });
}

std::vector<double> TriangleGrid::crossings(const Vector3d& p, const Vector3d& q) const {
  std::vector<double> found;
  visit_near(p.cwiseMin(q), p.cwiseMax(q), [&](int n) {
    const TriangleCorners& t = triangles_[n];
    const Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]);
    const double dp = normal.dot(p - t[0]), dq = normal.dot(q - t[0]);
    if ((dp > 0.0) == (dq > 0.0)) return true;
    const double s = dp / (dp - dq);
    const Vector3d x = p + s * (q - p);
    // The border belongs to the triangle, with a little more for rounding: no gap between two.
    const double slack = -1e-9 * normal.squaredNorm();
    for (int k = 0; k < 3; ++k)
      if (normal.dot((t[(k + 1) % 3] - t[k]).cross(x - t[k])) < slack) return true;
    found.push_back(s);
    return true;
  });
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace sinew::lattice::detail
