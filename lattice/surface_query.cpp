#include "lattice/surface_query.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>

#include <Eigen/Geometry>

namespace sinew::lattice {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kLeafSize = 4;
/// A cluster is far when it is seen from beyond this many of its radii. The winding number is then within
/// 0.01 on the meshes of the tests (the header promises 0.02).
constexpr double kFarRatio = 1.7;
/// The median split halves the triangles, so the depth is at most 32 for the counts an int can hold.
constexpr int kStackSize = 80;

struct Box {
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity());
  Vector3d high = Vector3d::Constant(-std::numeric_limits<double>::infinity());

  void include(const Vector3d& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  double distance_squared(const Vector3d& p) const {
    return (low - p).cwiseMax(p - high).cwiseMax(0.0).squaredNorm();
  }
};

/// Inner nodes: children at `first` and `first + 1`. Leaves: `count` triangles from `first`.
struct Node {
  Box box;
  int first = 0;
  int count = 0;  ///< 0 for inner nodes.
};

/// What a cluster of triangles looks like from afar ([Barill18], sec. 3): the flux integral of n.(y - p)/|y -
/// p|^3 over the triangles, expanded to second order in z = y - centre.
struct Expansion {
  Vector3d centre{0, 0, 0};
  Vector3d dipole{0, 0, 0};            ///< int n dA.
  Matrix3d moment = Matrix3d::Zero();  ///< int z n^T dA.
  /// Third-order tensor Q_jki = int z_j z_k n_i dA, kept as its contractions 2 Q_iki + Q_jjk and as the ten
  /// coefficients of the cubic form Q(d, d, d): xxx yyy zzz xxy xxz yyx yyz zzx zzy xyz.
  Vector3d trace{0, 0, 0};
  std::array<double, 10> cubic{};
  double far_squared = 0.0;  ///< square of the distance from which the expansion holds.
};

double cubic_form(const std::array<double, 10>& c, const Vector3d& d) {
  const double x = d.x(), y = d.y(), z = d.z();
  return x * x * (c[0] * x + c[3] * y + c[4] * z) + y * y * (c[1] * y + c[5] * x + c[6] * z) +
         z * z * (c[2] * z + c[7] * x + c[8] * y) + c[9] * x * y * z;
}

using Corners = std::array<Vector3d, 3>;

Vector3d closest_on_segment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Vector3d ab = b - a;
  const double length_squared = ab.squaredNorm();
  if (!(length_squared > 0.0)) return a;
  return a + std::clamp((p - a).dot(ab) / length_squared, 0.0, 1.0) * ab;
}

Vector3d closest_on_edges(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  Vector3d best = closest_on_segment(p, a, b);
  for (const Vector3d& q : {closest_on_segment(p, b, c), closest_on_segment(p, c, a)}) {
    if ((q - p).squaredNorm() < (best - p).squaredNorm()) best = q;
  }
  return best;
}

void check_input(const Points& points, const Triangles& triangles) {
  if (triangles.rows() == 0) throw std::invalid_argument("SurfaceQuery: the surface has no triangle");
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    if (!points.row(v).allFinite()) {
      throw std::invalid_argument("SurfaceQuery: vertex " + std::to_string(v) + " is not finite");
    }
  }
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    if (triangles.row(t).minCoeff() < 0 || triangles.row(t).maxCoeff() >= points.rows()) {
      throw std::invalid_argument("SurfaceQuery: triangle " + std::to_string(t) +
                                  " names a vertex outside 0.." + std::to_string(points.rows() - 1));
    }
  }
}

}  // namespace

Vector3d closest_on_triangle(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0.0 && d2 <= 0.0) return a;
  const Vector3d bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0.0 && d4 <= d3) return b;
  const Vector3d cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0.0 && d5 <= d6) return c;
  // va, vb, vc: the barycentric coordinates of p's projection, times the squared double area.
  const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  const double sum = va + vb + vc;
  if (va <= 0.0 || vb <= 0.0 || vc <= 0.0 || !(sum > 0.0)) return closest_on_edges(p, a, b, c);
  return a + ab * (vb / sum) + ac * (vc / sum);
}

double solid_angle(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d u = a - p, v = b - p, w = c - p;
  const double lu = u.norm(), lv = v.norm(), lw = w.norm();
  const double numerator = u.dot(v.cross(w));
  const double denominator = lu * lv * lw + u.dot(v) * lw + v.dot(w) * lu + w.dot(u) * lv;
  return 2.0 * std::atan2(numerator, denominator);
}

struct SurfaceQuery::Impl {
  std::vector<Corners> corners;       ///< in tree order.
  std::vector<int> triangle_of;       ///< tree order to the caller's.
  std::vector<Node> nodes;            ///< node 0 is the root; children lie side by side.
  std::vector<Expansion> expansions;  ///< one per node.

  Impl(const Points& points, const Triangles& triangles);
  void split(int node, const std::vector<Vector3d>& centroids, int begin, int end);
  Expansion expand(int begin, int end) const;
  /// Index in tree order of a triangle nearer than sqrt(best_squared), which shrinks, or -1. Stops at the
  /// first one found when `any` is set.
  int search(const Vector3d& p, double& best_squared, Vector3d& best_point, bool any) const;
};

SurfaceQuery::Impl::Impl(const Points& points, const Triangles& triangles) {
  const int n = static_cast<int>(triangles.rows());
  std::vector<Corners> input(n);
  std::vector<Vector3d> centroids(n);
  for (int t = 0; t < n; ++t) {
    for (int k = 0; k < 3; ++k) input[t][k] = points.row(triangles(t, k)).transpose();
    centroids[t] = (input[t][0] + input[t][1] + input[t][2]) / 3.0;
  }
  triangle_of.resize(n);
  std::iota(triangle_of.begin(), triangle_of.end(), 0);
  nodes.reserve(n);
  nodes.emplace_back();
  split(0, centroids, 0, n);
  corners.reserve(n);
  for (int t : triangle_of) corners.push_back(input[t]);

  // Children have larger indices than their parent, so one backward pass fits the boxes.
  expansions.resize(nodes.size());
  std::vector<std::pair<int, int>> range(nodes.size());
  for (int i = static_cast<int>(nodes.size()) - 1; i >= 0; --i) {
    Node& node = nodes[i];
    if (node.count > 0) {
      range[i] = {node.first, node.first + node.count};
      for (int t = node.first; t < node.first + node.count; ++t)
        for (const Vector3d& p : corners[t]) node.box.include(p);
    } else {
      range[i] = {range[node.first].first, range[node.first + 1].second};
      for (int k : {node.first, node.first + 1}) {
        node.box.include(nodes[k].box.low);
        node.box.include(nodes[k].box.high);
      }
    }
    expansions[i] = expand(range[i].first, range[i].second);
  }
}

void SurfaceQuery::Impl::split(int node, const std::vector<Vector3d>& centroids, int begin, int end) {
  if (end - begin <= kLeafSize) {
    nodes[node].first = begin;
    nodes[node].count = end - begin;
    return;
  }
  Box box;
  for (int i = begin; i < end; ++i) box.include(centroids[triangle_of[i]]);
  int axis = 0;
  (box.high - box.low).maxCoeff(&axis);
  const int middle = begin + (end - begin) / 2;
  std::nth_element(triangle_of.begin() + begin, triangle_of.begin() + middle, triangle_of.begin() + end,
                   [&](int a, int b) {
                     const double x = centroids[a][axis], y = centroids[b][axis];
                     return x != y ? x < y : a < b;
                   });
  const int first = static_cast<int>(nodes.size());
  nodes.resize(nodes.size() + 2);
  nodes[node].first = first;
  split(first, centroids, begin, middle);
  split(first + 1, centroids, middle, end);
}

Expansion SurfaceQuery::Impl::expand(int begin, int end) const {
  Expansion e;
  double area = 0.0;
  Vector3d plain_centre = Vector3d::Zero();
  for (int t = begin; t < end; ++t) {
    const auto& [a, b, c] = corners[t];
    const double triangle_area = 0.5 * (b - a).cross(c - a).norm();
    area += triangle_area;
    e.centre += triangle_area * (a + b + c) / 3.0;
    plain_centre += (a + b + c) / 3.0;
  }
  e.centre = area > 0.0 ? Vector3d(e.centre / area) : Vector3d(plain_centre / std::max(1, end - begin));
  double radius_squared = 0.0;
  for (int t = begin; t < end; ++t) {
    const auto& [a, b, c] = corners[t];
    const Vector3d n = 0.5 * (b - a).cross(c - a);
    const Vector3d m = (a + b + c) / 3.0 - e.centre;
    e.dipole += n;
    e.moment += m * n.transpose();
    Matrix3d q = 0.75 * m * m.transpose();  // int z z^T dA / area, exact for a triangle
    for (const Vector3d& p : corners[t]) {
      const Vector3d z = p - e.centre;
      q += z * z.transpose() / 12.0;
      radius_squared = std::max(radius_squared, z.squaredNorm());
    }
    e.trace += 2.0 * q * n + q.trace() * n;
    const std::array<double, 10> cubic{q(0, 0) * n[0],
                                       q(1, 1) * n[1],
                                       q(2, 2) * n[2],
                                       q(0, 0) * n[1] + 2.0 * q(0, 1) * n[0],
                                       q(0, 0) * n[2] + 2.0 * q(0, 2) * n[0],
                                       q(1, 1) * n[0] + 2.0 * q(0, 1) * n[1],
                                       q(1, 1) * n[2] + 2.0 * q(1, 2) * n[1],
                                       q(2, 2) * n[0] + 2.0 * q(0, 2) * n[2],
                                       q(2, 2) * n[1] + 2.0 * q(1, 2) * n[2],
                                       2.0 * (q(0, 1) * n[2] + q(0, 2) * n[1] + q(1, 2) * n[0])};
    for (int k = 0; k < 10; ++k) e.cubic[k] += cubic[k];
  }
  e.far_squared = kFarRatio * kFarRatio * radius_squared;
  return e;
}

int SurfaceQuery::Impl::search(const Vector3d& p, double& best_squared, Vector3d& best_point,
                               bool any) const {
  struct Entry {
    int node;
    double distance_squared;
  };
  std::array<Entry, kStackSize> stack;
  int size = 0, best = -1;
  stack[size++] = {0, nodes[0].box.distance_squared(p)};
  while (size > 0) {
    const Entry entry = stack[--size];
    if (!(entry.distance_squared < best_squared)) continue;
    const Node& node = nodes[entry.node];
    for (int t = node.first; t < node.first + node.count; ++t) {
      const Vector3d q = closest_on_triangle(p, corners[t][0], corners[t][1], corners[t][2]);
      const double distance_squared = (q - p).squaredNorm();
      if (distance_squared < best_squared) {
        best_squared = distance_squared;
        best_point = q;
        best = t;
        if (any) return best;
      }
    }
    if (node.count > 0) continue;
    Entry near{node.first, nodes[node.first].box.distance_squared(p)};
    Entry far{node.first + 1, nodes[node.first + 1].box.distance_squared(p)};
    if (far.distance_squared < near.distance_squared) std::swap(near, far);
    stack[size++] = far;
    stack[size++] = near;
  }
  return best;
}

SurfaceQuery::SurfaceQuery(const Points& points, const Triangles& triangles) {
  check_input(points, triangles);
  impl_ = std::make_unique<Impl>(points, triangles);
}
SurfaceQuery::~SurfaceQuery() = default;
SurfaceQuery::SurfaceQuery(SurfaceQuery&&) noexcept = default;
SurfaceQuery& SurfaceQuery::operator=(SurfaceQuery&&) noexcept = default;

SurfaceQuery::Closest SurfaceQuery::closest(const Vector3d& p) const {
  Closest result;
  double best_squared = std::numeric_limits<double>::infinity();
  const int found = impl_->search(p, best_squared, result.point, false);
  if (found < 0) throw std::invalid_argument("SurfaceQuery: the point asked for is not finite");
  result.triangle = impl_->triangle_of[found];
  result.distance = std::sqrt(best_squared);
  return result;
}

bool SurfaceQuery::is_within(const Vector3d& p, double radius) const {
  double best_squared = radius * radius;
  Vector3d unused;
  return impl_->search(p, best_squared, unused, true) >= 0;
}

double SurfaceQuery::winding_number(const Vector3d& p) const {
  std::array<int, kStackSize> stack;
  int size = 0;
  stack[size++] = 0;
  double angle = 0.0;
  while (size > 0) {
    const int i = stack[--size];
    const Expansion& e = impl_->expansions[i];
    const Vector3d d = e.centre - p;
    const double r2 = d.squaredNorm();
    if (r2 > e.far_squared) {
      // d_i/|d|^3 and its first two derivatives, contracted with the moments.
      const double inverse_r2 = 1.0 / r2;
      angle += inverse_r2 * std::sqrt(inverse_r2) *
               (e.dipole.dot(d) + e.moment.trace() - 3.0 * inverse_r2 * d.dot(e.moment * d) -
                1.5 * inverse_r2 * e.trace.dot(d) + 7.5 * inverse_r2 * inverse_r2 * cubic_form(e.cubic, d));
      continue;
    }
    const Node& node = impl_->nodes[i];
    for (int t = node.first; t < node.first + node.count; ++t) {
      const Corners& k = impl_->corners[t];
      angle += solid_angle(p, k[0], k[1], k[2]);
    }
    if (node.count == 0) {
      stack[size++] = node.first;
      stack[size++] = node.first + 1;
    }
  }
  return angle / (4.0 * std::numbers::pi);
}

}  // namespace sinew::lattice
