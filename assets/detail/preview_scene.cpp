#include "assets/detail/preview_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>

#include <Eigen/Geometry>

namespace sinew::assets::detail {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// The camera stands 35 degrees off the front and looks down by 13; a long lens keeps proportions.
constexpr double kYaw = 35.0, kElevation = 13.0;  // [degrees]
constexpr double kHalfView = 0.20;                // tangent of half the field of view
constexpr double kMargin = 0.04;                  // left free on each side, share of the picture
constexpr double kLabelMargin = 0.05;             // more room at the bottom, where the text is

constexpr double kLightRadius = 0.10;  // of the light's disc at unit distance: the softness of shadows
constexpr int kLightSamples = 5, kSkySamples = 5;
const Vector3d kLightColour(1.30, 1.20, 1.06), kSkyColour(0.50, 0.57, 0.67), kBounceColour(0.34, 0.29, 0.25);
const Vector3d kSkin(0.70, 0.36, 0.24), kSkinAway(0.72, 0.11, 0.09);
const Vector3d kGround(0.50, 0.49, 0.47), kGroundLine(0.38, 0.375, 0.365);
const Vector3d kHorizon(0.86, 0.86, 0.84), kZenith(0.46, 0.58, 0.72);
constexpr double kSharpCosine = 0.5;  // edges sharper than 60 degrees stay edges

Vector3d mix(const Vector3d& a, const Vector3d& b, double share) { return (1.0 - share) * a + share * b; }

double smooth_step(double low, double high, double x) {
  const double s = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return s * s * (3.0 - 2.0 * s);
}

/// Sample i of a low-discrepancy sequence in the unit square.
Vector2d square_sample(const LightSamples& samples, int i) {
  constexpr double kA1 = 0.7548776662466927, kA2 = 0.5698402909980532;  // 1/g, 1/g^2, g the plastic number
  const double x = samples.shift.x() + kA1 * i, y = samples.shift.y() + kA2 * i;
  return {x - std::floor(x), y - std::floor(y)};
}

/// Two unit vectors that complete n to an orthonormal frame.
std::array<Vector3d, 2> tangents(const Vector3d& n) {
  const Vector3d a = n.unitOrthogonal();
  return {a, n.cross(a)};
}

/// Share of the light's disc that is seen from p.
double light_seen(const Stage& stage, const Body& body, const Vector3d& p, const LightSamples& samples) {
  // No ray can hit where the cone to the light passes the ball round the body.
  const Vector3d to_body = body.centre - p;
  const double along = to_body.dot(stage.light), reach = body.radius + kLightRadius * std::max(along, 0.0);
  if (along < -body.radius || (to_body - along * stage.light).squaredNorm() > reach * reach) return 1.0;
  const auto [a, b] = tangents(stage.light);
  int seen = 0;
  for (int i = 0; i < kLightSamples; ++i) {
    const Vector2d s = square_sample(samples, samples.ray * kLightSamples + i);
    const double r = kLightRadius * std::sqrt(s.x()), angle = 2.0 * std::numbers::pi * s.y();
    const Vector3d to_light = stage.light + r * std::cos(angle) * a + r * std::sin(angle) * b;
    if (!body.mesh.is_blocked(p, to_light, 8.0 * stage.radius)) ++seen;
  }
  return static_cast<double>(seen) / kLightSamples;
}

/// Share of the sky, weighted by cosine, that is open round the normal n within a part of the scene's size.
double sky_seen(const Stage& stage, const Body& body, const Vector3d& p, const Vector3d& n,
                const LightSamples& samples) {
  const double reach = 0.35 * stage.radius;
  if ((p - body.centre).norm() > body.radius + reach) return 1.0;
  const auto [a, b] = tangents(n);
  int seen = 0;
  for (int i = 0; i < kSkySamples; ++i) {
    const Vector2d s = square_sample(samples, samples.ray * kSkySamples + i);
    const double r = std::sqrt(s.x()), angle = 2.0 * std::numbers::pi * s.y();
    const Vector3d to_sky = std::sqrt(1.0 - s.x()) * n + r * std::cos(angle) * a + r * std::sin(angle) * b;
    if (!body.mesh.is_blocked(p, to_sky, reach)) ++seen;
  }
  return static_cast<double>(seen) / kSkySamples;
}

Vector3d background(const Vector3d& direction) {
  return mix(kHorizon, kZenith, smooth_step(-0.12, 0.28, direction.y()));
}

Vector3d ground_radiance(const Stage& stage, const Body& body, const Vector3d& direction, double distance,
                         const LightSamples& samples) {
  const Vector3d p = stage.camera.eye() + distance * direction;
  const Vector3d from_centre(p.x() - stage.centre.x(), 0.0, p.z() - stage.centre.z());
  const double fade = smooth_step(1.1, 3.2, from_centre.norm() / stage.radius);
  if (fade >= 1.0) return background(direction);
  // Lines keep a width of at least a pixel of a 320-pixel tile, so that they do not crawl.
  const double line = 0.5 * std::max(0.012 * stage.grid, 2.0 * kHalfView * distance / 320.0);
  const auto off_line = [&](double x) { return std::abs(x - stage.grid * std::round(x / stage.grid)); };
  const bool on_line = off_line(p.x()) < line || off_line(p.z()) < line;
  const Vector3d lifted = p + 1e-4 * stage.radius * Vector3d::UnitY();
  const double key = stage.light.y() * light_seen(stage, body, lifted, samples);
  const double open = sky_seen(stage, body, lifted, Vector3d::UnitY(), samples);
  const Vector3d colour =
      (on_line ? kGroundLine : kGround).cwiseProduct(key * kLightColour + open * kSkyColour);
  return mix(colour, background(direction), fade);
}

Vector3d body_radiance(const Stage& stage, const Body& body, const Vector3d& direction,
                       const RayMesh::Hit& hit, const LightSamples& samples) {
  const Eigen::RowVector3i corners = body.triangles.row(hit.triangle);
  const std::array<double, 3> weights = {1.0 - hit.u - hit.v, hit.u, hit.v};
  Vector3d normal = Vector3d::Zero();
  Vector3d albedo = Vector3d::Zero();
  for (int c = 0; c < 3; ++c) {
    const auto k = static_cast<std::size_t>(c);
    normal += weights[k] * body.corner_normals.row(3 * hit.triangle + c).transpose();
    albedo += weights[k] * body.colours.row(corners[c]).transpose();
  }
  normal.normalize();
  // Open sheets are seen from both sides. The flat normal decides: the smooth one may lean away at an
  // outline.
  if (hit.normal.dot(direction) > 0.0) normal = -normal;
  const Vector3d p = stage.camera.eye() + hit.distance * direction + 1e-3 * stage.radius * normal;
  const double facing = normal.dot(stage.light);
  const double seen = facing > -0.2 ? light_seen(stage, body, p, samples) : 0.0;
  // Flesh scatters light a little round the edge of the shadow: wrap it by 0.2.
  const double key = seen * std::max((facing + 0.2) / 1.2, 0.0);
  const double open = sky_seen(stage, body, p, normal, samples);
  const double upward = 0.5 + 0.5 * normal.y();
  const Vector3d ambient = open * mix(kBounceColour, kSkyColour, upward);
  const double grazing = 1.0 - std::abs(normal.dot(direction));
  const double shine = std::pow(std::max(normal.dot((stage.light - direction).normalized()), 0.0), 30.0);
  return albedo.cwiseProduct(key * kLightColour + ambient) + 0.10 * seen * shine * kLightColour +
         0.16 * open * upward * grazing * grazing * grazing * kSkyColour;
}

}  // namespace

Camera::Camera(const lattice::Points& points) {
  const double yaw = kYaw * std::numbers::pi / 180.0, elevation = kElevation * std::numbers::pi / 180.0;
  back_ =
      Vector3d(std::sin(yaw) * std::cos(elevation), std::sin(elevation), std::cos(yaw) * std::cos(elevation));
  right_ = Vector3d::UnitY().cross(back_).normalized();
  up_ = back_.cross(right_);
  const double wide = kHalfView * (1.0 - 2.0 * kMargin);
  // A point at depth z before the eye fits if |x| <= wide z: the smallest eye distance follows from the
  // bounds of x + wide * depth and so on; the two directions are settled one after the other.
  const auto fit = [&](const Vector3d& axis, double low_share, double high_share, double& middle) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      const Vector3d p = points.row(i);
      high = std::max(high, p.dot(axis) + high_share * p.dot(back_));
      low = std::min(low, p.dot(axis) - low_share * p.dot(back_));
    }
    // middle + high_share * d >= high and middle - low_share * d <= low for the eye at height d along back.
    const double distance = (high - low) / (high_share + low_share);
    middle = high - high_share * distance;
    return distance;
  };
  const double low_share = wide - 2.0 * kHalfView * kLabelMargin;
  double x = 0.0, y = 0.0;
  const double from_width = fit(right_, wide, wide, x), from_height = fit(up_, low_share, wide, y);
  const double distance = std::max({from_width, from_height, 1e-9});
  // The direction with room to spare is centred for the distance that the other one needs.
  y += 0.5 * (low_share - wide) * (distance - from_height);
  eye_ = x * right_ + y * up_ + distance * back_;
}

bool Camera::project(const Vector3d& p, Vector2d& place) const {
  const Vector3d from_eye = p - eye_;
  const double depth = -from_eye.dot(back_);
  if (depth <= 0.0) return false;
  place = {0.5 + 0.5 * from_eye.dot(right_) / (kHalfView * depth),
           0.5 - 0.5 * from_eye.dot(up_) / (kHalfView * depth)};
  return true;
}

Vector3d Camera::direction(const Vector2d& place) const {
  return ((2.0 * place.x() - 1.0) * kHalfView * right_ + (1.0 - 2.0 * place.y()) * kHalfView * up_ - back_)
      .normalized();
}

Stage make_stage(const lattice::Points& points) {
  const Camera camera(points);
  const Vector3d low = points.colwise().minCoeff(), high = points.colwise().maxCoeff();
  const double radius = std::max(0.5 * (high - low).norm(), 1e-9);
  // A round number that puts about six lines under the scene.
  double grid = std::pow(10.0, std::floor(std::log10(radius / 3.0)));
  for (const double factor : {5.0, 2.0})
    if (factor * grid <= radius / 3.0) {
      grid *= factor;
      break;
    }
  const Vector3d light =
      (-0.50 * camera.right() + 0.95 * Vector3d::UnitY() + 0.55 * camera.back()).normalized();
  return {camera, low.y(), 0.5 * (low + high), radius, grid, light};
}

std::vector<int> coincident(const lattice::Points& points) {
  std::map<std::array<double, 3>, int> first;
  std::vector<int> same(static_cast<std::size_t>(points.rows()));
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const std::array<double, 3> key = {points(i, 0), points(i, 1), points(i, 2)};
    same[static_cast<std::size_t>(i)] = first.emplace(key, static_cast<int>(first.size())).first->second;
  }
  return same;
}

Body make_body(const lattice::Points& points, const lattice::Triangles& triangles,
               const std::vector<int>& same_place, lattice::Points colours) {
  const Eigen::Index n = triangles.rows();
  lattice::Points areas(n, 3), units(n, 3);
  std::vector<std::vector<int>> around(same_place.size());
  for (Eigen::Index t = 0; t < n; ++t) {
    const Vector3d a = points.row(triangles(t, 0)), b = points.row(triangles(t, 1)),
                   c = points.row(triangles(t, 2));
    const Vector3d area = (b - a).cross(c - a);
    areas.row(t) = area.transpose();
    units.row(t) = area.stableNormalized().transpose();
    for (int k = 0; k < 3; ++k)
      around[static_cast<std::size_t>(same_place[static_cast<std::size_t>(triangles(t, k))])].push_back(
          static_cast<int>(t));
  }
  lattice::Points normals(3 * n, 3);
  for (Eigen::Index t = 0; t < n; ++t) {
    for (int k = 0; k < 3; ++k) {
      Vector3d sum = Vector3d::Zero();
      for (const int other :
           around[static_cast<std::size_t>(same_place[static_cast<std::size_t>(triangles(t, k))])])
        if (units.row(t).dot(units.row(other)) > kSharpCosine) sum += areas.row(other).transpose();
      const Vector3d fallback = units.row(t);
      normals.row(3 * t + k) = (sum.norm() > 0.0 ? Vector3d(sum.normalized()) : fallback).transpose();
    }
  }
  const Vector3d low = points.colwise().minCoeff(), high = points.colwise().maxCoeff();
  return {RayMesh(points, triangles), triangles,          normals,
          std::move(colours),         0.5 * (low + high), 0.5 * (high - low).norm()};
}

Vector2d light_shift(int x, int y) {
  // Interleaved gradient noise [Jimenez14], and once more at another place for the second coordinate.
  const auto noise = [](double a, double b) {
    const double inner = 0.06711056 * a + 0.00583715 * b;
    const double outer = 52.9829189 * (inner - std::floor(inner));
    return outer - std::floor(outer);
  };
  return {noise(x, y), noise(x + 47.0, y + 17.0)};
}

Vector3d radiance(const Stage& stage, const Body& body, const Vector3d& direction,
                  const LightSamples& samples) {
  if (const auto hit = body.mesh.first_hit(stage.camera.eye(), direction))
    return body_radiance(stage, body, direction, *hit, samples);
  const double height = stage.camera.eye().y() - stage.ground;
  if (direction.y() < 0.0 && height > 0.0)
    return ground_radiance(stage, body, direction, -height / direction.y(), samples);
  return background(direction);
}

Vector3d flesh_colour() { return kSkin; }
Vector3d tint_colour() { return kSkinAway; }

Vector3d encode(const Vector3d& linear) {
  Vector3d srgb;
  for (int c = 0; c < 3; ++c) {
    const double x = std::clamp(linear[c], 0.0, 1.0);
    srgb[c] = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1.0 / 2.4) - 0.055;
  }
  return srgb;
}

}  // namespace sinew::assets::detail
