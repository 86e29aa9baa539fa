#include "lattice/detail/segments.h"

#include <algorithm>

#include <Eigen/Geometry>

namespace sinew::lattice::detail {

using Eigen::Vector3d;

double point_segment_distance(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Vector3d ab = b - a;
  const double length_squared = ab.squaredNorm();
  const double t = length_squared > 0.0 ? std::clamp((p - a).dot(ab) / length_squared, 0.0, 1.0) : 0.0;
  return (a + t * ab - p).norm();
}

double segment_segment_distance(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  // The minimum is at an end of one of them, or where the common perpendicular meets both.
  double distance = std::min({point_segment_distance(a, c, d), point_segment_distance(b, c, d),
                              point_segment_distance(c, a, b), point_segment_distance(d, a, b)});
  const Vector3d u = b - a, v = d - c, w = a - c;
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), uw = u.dot(w), vw = v.dot(w);
  const double determinant = uu * vv - uv * uv;
  if (determinant > 1e-14 * uu * vv) {
    const double s = (uv * vw - vv * uw) / determinant, t = (uu * vw - uv * uw) / determinant;
    if (s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0)
      distance = std::min(distance, (a + s * u - c - t * v).norm());
  }
  return distance;
}

}  // namespace sinew::lattice::detail
