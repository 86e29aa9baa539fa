#include "tools/make_samples/solid.h"

#include <algorithm>
#include <cmath>

#include "tools/make_samples/exact_math.h"

namespace sinew::samples {
namespace {

using Eigen::Vector3d;

double smooth_minimum(double a, double b, double blend) {
  const double overlap = std::max(blend - std::abs(a - b), 0.0);
  return std::min(a, b) - overlap * overlap / (4.0 * blend);
}

Vector3d gradient(const Solid& solid, const Vector3d& p) {
  constexpr double kStep = 1e-4;  // [m]; far below any radius here, far above rounding
  Vector3d g;
  for (int c = 0; c < 3; ++c) {
    const Vector3d step = kStep * Vector3d::Unit(c);
    g[c] = (solid(p + step) - solid(p - step)) / (2.0 * kStep);
  }
  return g;
}

}  // namespace

Solid tapered_capsule(const Vector3d& a, const Vector3d& b, double radius_a, double radius_b) {
  const Vector3d axis = b - a;
  const double length_squared = axis.squaredNorm();
  return [=](const Vector3d& p) {
    const double s = std::clamp((p - a).dot(axis) / length_squared, 0.0, 1.0);
    return (p - a - s * axis).norm() - (radius_a + s * (radius_b - radius_a));
  };
}

Solid ellipsoid(const Vector3d& centre, const Vector3d& radii, double pitch_degrees, double roll_degrees) {
  const Eigen::Matrix3d local_from_world =
      (rotation(roll_degrees, Vector3d::UnitZ()) * rotation(pitch_degrees, Vector3d::UnitX()))
          .conjugate()
          .toRotationMatrix();
  return [=](const Vector3d& p) {
    // First-order distance: (|p/r| - 1) |p/r| / |p/r^2| is exact at the surface to first order.
    const Vector3d scaled = (local_from_world * (p - centre)).cwiseQuotient(radii);
    const double k0 = scaled.norm();
    const double k1 = scaled.cwiseQuotient(radii).norm();
    return k1 > 0.0 ? k0 * (k0 - 1.0) / k1 : -radii.minCoeff();
  };
}

Solid blended(Solid a, Solid b, double blend) {
  return [a = std::move(a), b = std::move(b), blend](const Vector3d& p) {
    return smooth_minimum(a(p), b(p), blend);
  };
}

Solid carved(Solid a, Solid b, double blend) {
  return [a = std::move(a), b = std::move(b), blend](const Vector3d& p) {
    return -smooth_minimum(-a(p), b(p), blend);
  };
}

Solid mirrored(Solid solid) {
  return [solid = std::move(solid)](const Vector3d& p) {
    return std::min(solid(p), solid(Vector3d(-p.x(), p.y(), p.z())));
  };
}

Vector3d outward_normal(const Solid& solid, const Vector3d& p) { return gradient(solid, p).normalized(); }

Vector3d projected(const Solid& solid, Vector3d p) {
  for (int step = 0; step < 3; ++step) {
    const Vector3d g = gradient(solid, p);
    p -= solid(p) / std::max(g.squaredNorm(), 1e-2) * g;
  }
  return p;
}

}  // namespace sinew::samples
