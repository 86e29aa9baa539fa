#include "fem/skin/skin_guard.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include <Eigen/Geometry>
#include <tbb/parallel_for.h>

#include "fem/body/frames.h"

namespace sinew::fem {

using lattice::Points;

namespace {

/// What begins to be laid back and what is so wholly: well before an eye calls it torn (stretch 2.5, squeeze
/// 0.2, creases of 30 degrees), so that nothing is left of it at the end.
constexpr std::pair kStretch{1.9, 2.4}, kSqueeze{0.35, 0.22};
constexpr std::pair kCrease{25.0 * std::numbers::pi / 180.0, 40.0 * std::numbers::pi / 180.0};
/// Cosine between a triangle and where the skin round it has turned plain skinning's.
constexpr std::pair kFlip{0.5, -0.1};
/// Of the skin's size at rest: where mean edges are longer than this, they bend by such angles where the skin
/// is as smooth as they let it be.
constexpr double kLongEdge = 0.1;
constexpr int kRings = 3, kIterations = 30;
/// Of the skin's size at rest: no weight fades farther, for three rings of a coarse skin are half of it.
constexpr double kReach = 0.1;
/// Laying one place back may crease its rim: so often is looked again, every second time three rings farther.
/// Where plain skinning itself squeezes a triangle to next to nothing, the least difference that is left
/// turns it over: what the first kSmoothPasses leave is drawn to plain skinning itself, from pass kPlainPass
/// on all of it.
constexpr int kPasses = 10, kSmoothPasses = 4, kPlainPass = 7;
/// Of a fault that a pass leaves, what the next one minds: less than this no eye sees.
constexpr std::pair kLeft{0.2, 0.6};

double ramp(double x, const std::pair<double, double>& from_to) {
  return std::clamp((x - from_to.first) / (from_to.second - from_to.first), 0.0, 1.0);
}

Eigen::Vector3d point(const Points& x, int vertex) { return x.row(vertex).transpose(); }

}  // namespace

/// Plain skinning at one instant.
struct SkinGuard::Side {
  const Points& points;
  std::vector<Form> forms;
  std::vector<double> angles;
};

SkinGuard::SkinGuard(const Points& rest, const lattice::Triangles& triangles)
    : rest_(rest), triangles_(triangles) {
  const auto n = static_cast<std::size_t>(rest.rows());
  area_.assign(n, 0.0);
  std::map<std::pair<int, int>, std::vector<int>> triangles_at;  // edge -> triangles
  for (int t = 0; t < static_cast<int>(triangles.rows()); ++t) {
    const Eigen::RowVector3i v = triangles.row(t);
    if (v.minCoeff() < 0 || v.maxCoeff() >= static_cast<int>(n))
      throw std::invalid_argument("skin guard: triangle " + std::to_string(t) +
                                  " names a vertex that is not there");
    const double third =
        (point(rest, v[1]) - point(rest, v[0])).cross(point(rest, v[2]) - point(rest, v[0])).norm() / 6.0;
    for (int k = 0; k < 3; ++k) {
      area_[static_cast<std::size_t>(v[k])] += third;
      triangles_at[std::minmax(v[k], v[(k + 1) % 3])].push_back(t);
    }
  }
  std::vector<std::vector<int>> neighbours(n);
  for (const auto& [edge, sides] : triangles_at) {
    neighbours[static_cast<std::size_t>(edge.first)].push_back(edge.second);
    neighbours[static_cast<std::size_t>(edge.second)].push_back(edge.first);
    if (sides.size() == 2) hinges_.push_back({sides[0], sides[1], edge.first, edge.second});
  }
  row_start_.push_back(0);
  for (const std::vector<int>& row : neighbours) {
    neighbour_.insert(neighbour_.end(), row.begin(), row.end());
    row_start_.push_back(static_cast<int>(neighbour_.size()));
  }
  for (std::size_t v = 0; v < n; ++v)
    for (const int w : neighbours[v])
      edge_length_.push_back((point(rest, static_cast<int>(v)) - point(rest, w)).norm());
  size_ = n > 0 ? (rest.colwise().maxCoeff() - rest.colwise().minCoeff()).norm() : 0.0;
  if (!edge_length_.empty()) {
    const double mean = std::accumulate(edge_length_.begin(), edge_length_.end(), 0.0) /
                        static_cast<double>(edge_length_.size());
    coarseness_ = std::max(1.0, mean / (kLongEdge * size_));
  }
  rest_forms_ = forms(rest);
  rest_angles_ = angles(rest);
}

SkinGuard::Form SkinGuard::form(const Points& x, std::size_t triangle) const {
  const auto t = static_cast<Eigen::Index>(triangle);
  const Eigen::Vector3d a = point(x, triangles_(t, 1)) - point(x, triangles_(t, 0)),
                        b = point(x, triangles_(t, 2)) - point(x, triangles_(t, 0));
  return {a.squaredNorm(), a.dot(b), b.squaredNorm()};
}

std::vector<SkinGuard::Form> SkinGuard::forms(const Points& x) const {
  std::vector<Form> result(static_cast<std::size_t>(triangles_.rows()));
  tbb::parallel_for(std::size_t{0}, result.size(), [&](std::size_t t) { result[t] = form(x, t); });
  return result;
}

/// Between the normals of the two triangles of every hinge [rad].
std::vector<double> SkinGuard::angles(const Points& x) const {
  std::vector<Eigen::Vector3d> normals(static_cast<std::size_t>(triangles_.rows()));
  tbb::parallel_for(std::size_t{0}, normals.size(), [&](std::size_t t) { normals[t] = normal(x, t); });
  std::vector<double> result(hinges_.size());
  tbb::parallel_for(std::size_t{0}, result.size(), [&](std::size_t h) {
    const Eigen::Vector3d &a = normals[static_cast<std::size_t>(hinges_[h].triangle_a)],
                          &b = normals[static_cast<std::size_t>(hinges_[h].triangle_b)];
    const double scale = a.norm() * b.norm();
    result[h] = scale > 0.0 ? std::acos(std::clamp(a.dot(b) / scale, -1.0, 1.0)) : 0.0;
  });
  return result;
}

namespace {

/// Larger and smaller principal stretch of a triangle of form f against one of form g; {1, 1} where that has
/// no area.
template <class Form>
std::pair<double, double> stretches(const Form& f, const Form& g) {
  const double det = g.aa * g.bb - g.ab * g.ab;
  const double longest = std::max(g.aa, g.bb);
  if (!(det > 1e-6 * longest * longest)) return {1.0, 1.0};
  const double trace = (g.bb * f.aa - 2.0 * g.ab * f.ab + g.aa * f.bb) / det;
  const double product = std::max(0.0, (f.aa * f.bb - f.ab * f.ab) / det);
  const double root = std::sqrt(std::max(0.0, 0.25 * trace * trace - product));
  return {std::sqrt(std::max(0.0, 0.5 * trace + root)), std::sqrt(std::max(0.0, 0.5 * trace - root))};
}

}  // namespace

Eigen::Vector3d SkinGuard::normal(const Points& x, std::size_t triangle) const {
  const auto t = static_cast<Eigen::Index>(triangle);
  return (point(x, triangles_(t, 1)) - point(x, triangles_(t, 0)))
      .cross(point(x, triangles_(t, 2)) - point(x, triangles_(t, 0)));
}

/// How far a triangle is turned over, 0 to 1: its normal against that of plain skinning and that of rest,
/// each turned as the skin within three rings is. Few triangles are near enough for the rings to be looked
/// at.
double SkinGuard::flip(const Points& skin, const Points& plain, std::size_t triangle) const {
  const Eigen::Vector3d now = normal(skin, triangle).stableNormalized();
  const Eigen::Vector3d of_plain = normal(plain, triangle).stableNormalized(),
                        of_rest = normal(rest_, triangle).stableNormalized();
  if (std::max(now.dot(of_plain), now.dot(of_rest)) >= kFlip.first) return 0.0;
  std::set<int> reached;
  for (int k = 0; k < 3; ++k) reached.insert(triangles_(static_cast<Eigen::Index>(triangle), k));
  Eigen::Matrix3d from_plain = Eigen::Matrix3d::Zero(), from_rest = from_plain;
  std::vector<int> rim(reached.begin(), reached.end());
  for (int ring = 0; ring < kRings; ++ring) {
    std::vector<int> next;
    for (const int v : rim) {
      for (int e = row_start_[static_cast<std::size_t>(v)]; e < row_start_[static_cast<std::size_t>(v) + 1];
           ++e) {
        const int w = neighbour_[static_cast<std::size_t>(e)];
        const Eigen::Vector3d edge = point(skin, w) - point(skin, v);
        from_plain += edge * (point(plain, w) - point(plain, v)).transpose();
        from_rest += edge * (point(rest_, w) - point(rest_, v)).transpose();
        if (reached.insert(w).second) next.push_back(w);
      }
    }
    rim = std::move(next);
  }
  const double cosine =
      std::max(now.dot(polar_rotation(from_plain) * of_plain), now.dot(polar_rotation(from_rest) * of_rest));
  return ramp(cosine, kFlip);
}

/// Of every vertex how much is wrong round it, 0 to 1.
std::vector<double> SkinGuard::faults(const Points& skin, const Side& plain) const {
  std::vector<double> of_triangle(static_cast<std::size_t>(triangles_.rows()));
  tbb::parallel_for(std::size_t{0}, of_triangle.size(), [&](std::size_t t) {
    const Form f = form(skin, t);
    const auto [stretch_p, squeeze_p] = stretches(f, plain.forms[t]);
    const auto [stretch_r, squeeze_r] = stretches(f, rest_forms_[t]);
    of_triangle[t] = std::max({ramp(std::min(stretch_p, stretch_r), kStretch),
                               ramp(std::max(squeeze_p, squeeze_r), kSqueeze), flip(skin, plain.points, t)});
  });
  std::vector<double> result(area_.size(), 0.0);
  const auto raise = [&](int vertex, double fault) {
    double& at = result[static_cast<std::size_t>(vertex)];
    at = std::max(at, fault);
  };
  for (std::size_t t = 0; t < of_triangle.size(); ++t)
    for (int k = 0; k < 3 && of_triangle[t] > 0.0; ++k)
      raise(triangles_(static_cast<Eigen::Index>(t), k), of_triangle[t]);
  const std::vector<double> now = angles(skin);
  for (std::size_t h = 0; h < hinges_.size(); ++h) {
    const double fault =
        ramp(std::min(now[h] - plain.angles[h], now[h] - rest_angles_[h]) / coarseness_, kCrease);
    if (fault == 0.0) continue;
    raise(hinges_[h].vertex_a, fault);
    raise(hinges_[h].vertex_b, fault);
  }
  return result;
}

/// Lets weights fade, all the way to nothing, over so many rings round them, at most as far as `reach`.
void SkinGuard::spread(std::vector<double>& weights, int rings, double reach) const {
  for (int ring = 0; ring < rings; ++ring) {
    const std::vector<double> before = weights;
    for (std::size_t v = 0; v < weights.size(); ++v)
      for (int e = row_start_[v]; e < row_start_[v + 1]; ++e) {
        const double step = std::max(1.0 / (rings + 1.0), edge_length_[static_cast<std::size_t>(e)] / reach);
        weights[v] = std::max(
            weights[v], before[static_cast<std::size_t>(neighbour_[static_cast<std::size_t>(e)])] - step);
      }
  }
}

/// d with every weight's share of its neighbours' mean.
void SkinGuard::lay(const GuardWeights& by, const Points& plain, const Points& flesh, Points& skin) const {
  std::vector<int> moving;
  for (std::size_t v = 0; v < by.weights.size(); ++v)
    if (by.weights[v] > 0.0) moving.push_back(static_cast<int>(v));
  Points added = flesh - plain;  // d
  Points smooth(static_cast<Eigen::Index>(moving.size()), 3);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (std::size_t i = 0; i < moving.size(); ++i) {
      const auto v = static_cast<std::size_t>(moving[i]);
      Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
      for (int e = row_start_[v]; e < row_start_[v + 1]; ++e)
        sum += added.row(neighbour_[static_cast<std::size_t>(e)]);
      const double count = row_start_[v + 1] - row_start_[v];
      const Eigen::RowVector3d own = flesh.row(moving[i]) - plain.row(moving[i]);
      smooth.row(static_cast<Eigen::Index>(i)) =
          (1.0 - by.weights[v]) * own + (by.weights[v] * (1.0 - by.pulls[v]) / count) * sum;
    }
    for (std::size_t i = 0; i < moving.size(); ++i)
      added.row(moving[i]) = smooth.row(static_cast<Eigen::Index>(i));
  }
  for (const int v : moving) skin.row(v) = plain.row(v) + added.row(v);
}

GuardWeights SkinGuard::weigh(const Points& plain, const Points& flesh, const GuardWeights& from) const {
  const Side side{plain, forms(plain), angles(plain)};
  GuardWeights result = from;
  Points x = flesh;
  if (!from.weights.empty()) lay(result, plain, flesh, x);
  // What is wrong after weights that were enough in their own frames is not cured by more of the same.
  for (int pass = from.weights.empty() ? 0 : kSmoothPasses; pass < kPasses; ++pass) {
    std::vector<double> found = faults(x, side);
    if (pass > 0)
      for (double& fault : found) fault = ramp(fault, kLeft);
    if (std::ranges::all_of(found, [](double fault) { return fault == 0.0; })) break;
    const int wider = 1 + pass / 2;
    spread(found, kRings * wider, kReach * wider * size_);
    const double pull = ramp(pass, {kSmoothPasses - 1.0, kPlainPass});
    result.weights.resize(found.size(), 0.0);
    result.pulls.resize(found.size(), 0.0);
    for (std::size_t v = 0; v < found.size(); ++v) {
      result.weights[v] = std::max(result.weights[v], found[v]);
      result.pulls[v] = std::max(result.pulls[v], pull * found[v]);
    }
    lay(result, plain, flesh, x);
  }
  return result;
}

Mended SkinGuard::mend(const GuardWeights& by, const Points& plain, Points& skin) const {
  Mended mended;
  if (by.weights.empty()) return mended;
  const Points flesh = skin;
  lay(by, plain, flesh, skin);
  double all = 0.0;
  for (std::size_t v = 0; v < by.weights.size(); ++v) {
    all += area_[v];
    if (by.weights[v] == 0.0) continue;
    mended.area += area_[v];
    const double way =
        (skin.row(static_cast<Eigen::Index>(v)) - flesh.row(static_cast<Eigen::Index>(v))).norm();
    if (way >= mended.largest) mended.largest = way, mended.vertex = static_cast<int>(v);
  }
  if (all > 0.0) mended.area /= all;
  return mended;
}

}  // namespace sinew::fem
