#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include "tests/lattice/limbs.h"

/// Random trees of bones in one smooth closed blob each.
namespace sinew::tests {

/// The surface on which `field` is 0 (negative inside), by marching tetrahedra on a grid of `side` over the
/// box: each cube in six tetrahedra round its diagonal, so that the surface is closed. Triangles are outward.
template <class Field>
lattice::Surface surface_of(const Eigen::Vector3d& low, const Eigen::Vector3d& high, double side,
                            const Field& field) {
  const Eigen::Vector3i n = ((high - low) / side).array().ceil().cast<int>() + 1;
  const auto index = [&](int x, int y, int z) { return (z * n.y() + y) * n.x() + x; };
  const auto place = [&](int i) {
    return Eigen::Vector3d(low + side * Eigen::Vector3d(i % n.x(), i / n.x() % n.y(), i / (n.x() * n.y())));
  };
  std::vector<double> value(static_cast<std::size_t>(n.prod()));
  for (int i = 0; i < n.prod(); ++i) {
    value[static_cast<std::size_t>(i)] = field(place(i));
    if (value[static_cast<std::size_t>(i)] == 0.0) value[static_cast<std::size_t>(i)] = 1e-12;
  }
  const auto at = [&](int i) { return value[static_cast<std::size_t>(i)]; };
  std::map<std::pair<int, int>, int> vertex_of_edge;
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::RowVector3i> triangles;
  const auto crossing = [&](int a, int b) {
    const auto [entry, fresh] = vertex_of_edge.emplace(std::minmax(a, b), static_cast<int>(points.size()));
    // Not nearer to a corner than a tenth of the edge: no slivers.
    const double t = std::clamp(at(a) / (at(a) - at(b)), 0.1, 0.9);
    if (fresh) points.push_back((1.0 - t) * place(a) + t * place(b));
    return entry->second;
  };
  const auto add = [&](int a, int b, int c, const Eigen::Vector3d& inside) {
    const Eigen::Vector3d p = points[static_cast<std::size_t>(a)], q = points[static_cast<std::size_t>(b)],
                          r = points[static_cast<std::size_t>(c)];
    if ((q - p).cross(r - p).dot(inside - p) > 0.0) std::swap(b, c);
    triangles.emplace_back(a, b, c);
  };
  const auto tetrahedron = [&](std::array<int, 4> corners) {
    std::sort(corners.begin(), corners.end(), [&](int a, int b) { return at(a) < at(b); });
    const auto inside = std::count_if(corners.begin(), corners.end(), [&](int i) { return at(i) < 0.0; });
    const auto [a, b, c, d] = corners;
    const Eigen::Vector3d within = place(a);
    if (inside == 1) add(crossing(a, b), crossing(a, c), crossing(a, d), within);
    if (inside == 3) add(crossing(a, d), crossing(b, d), crossing(c, d), within);
    if (inside != 2) return;
    add(crossing(a, c), crossing(a, d), crossing(b, d), within);
    add(crossing(a, c), crossing(b, d), crossing(b, c), within);
  };
  constexpr std::array<std::array<int, 3>, 6> kOrders{
      {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}};
  for (int z = 0; z + 1 < n.z(); ++z)
    for (int y = 0; y + 1 < n.y(); ++y)
      for (int x = 0; x + 1 < n.x(); ++x)
        for (const auto& order : kOrders) {
          Eigen::Vector3i corner(x, y, z);
          std::array<int, 4> corners{index(x, y, z)};
          for (std::size_t k = 0; k < 3; ++k) {
            ++corner[order[k]];
            corners[k + 1] = index(corner.x(), corner.y(), corner.z());
          }
          tetrahedron(corners);
        }
  lattice::Surface surface;
  surface.points.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t v = 0; v < points.size(); ++v)
    surface.points.row(static_cast<Eigen::Index>(v)) = points[v].transpose();
  surface.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    surface.triangles.row(static_cast<Eigen::Index>(t)) = triangles[t];
  return surface;
}

/// A random tree of 3 to 14 bones, limbs of random thickness melted into one blob, weights that fall off
/// smoothly from the bones; some joints lie beyond the skin, some bones are short.
inline Character random_blob(std::mt19937_64& rng) {
  struct Limb {
    Eigen::Vector3d a, b;
    double radius;
    int joint;
  };
  Character c;
  c.add_joint("root", -1, Eigen::Vector3d::Zero());
  std::vector<Limb> limbs;
  const int bones = 3 + static_cast<int>(rng() % 12);
  for (int i = 0; i < bones; ++i) {
    const int parent = static_cast<int>(rng() % c.joints.parents.size());
    const Eigen::Vector3d from = c.joints.positions.row(parent).transpose();
    const double length = rng() % 5 == 0 ? uniform(rng, 0.03, 0.1) : uniform(rng, 0.2, 0.7);
    const Eigen::Vector3d to = from + length * uniform_point(rng, -1.0, 1.0).normalized();
    c.add_joint("joint_" + std::to_string(i), parent, to);
    const double reach = rng() % 6 == 0 ? 0.6 : 1.0;  // some bones leave the flesh
    limbs.push_back({from, from + reach * (to - from), uniform(rng, 0.07, 0.18), parent});
  }
  const auto distance = [](const Limb& limb, const Eigen::Vector3d& p) {
    const Eigen::Vector3d ab = limb.b - limb.a;
    const double s = std::clamp((p - limb.a).dot(ab) / ab.squaredNorm(), 0.0, 1.0);
    return (limb.a + s * ab - p).norm();
  };
  const auto field = [&](const Eigen::Vector3d& p) {  // a smooth minimum of the distances
    double sum = 0.0;
    for (const Limb& limb : limbs) sum += std::exp(-30.0 * (distance(limb, p) - limb.radius));
    return -std::log(sum) / 30.0;
  };
  const Eigen::Vector3d low = c.joints.positions.colwise().minCoeff().transpose().array() - 0.4;
  const Eigen::Vector3d high = c.joints.positions.colwise().maxCoeff().transpose().array() + 0.4;
  c.skin = surface_of(low, high, 0.07, field);
  for (Eigen::Index v = 0; v < c.skin.points.rows(); ++v) {
    std::map<int, double> weight;
    double total = 0.0;
    for (const Limb& limb : limbs) {
      const double w = std::exp(-20.0 * (distance(limb, c.skin.points.row(v).transpose()) - limb.radius));
      weight[limb.joint] += w;
      total += w;
    }
    auto& influences = c.skin.weights.emplace_back();
    for (const auto& [joint, w] : weight)
      if (w > 1e-3 * total) influences.push_back({joint, w / total});
  }
  return c;
}

/// The same character with its vertices and triangles in another order, and every triangle begun elsewhere.
inline Character shuffled(const Character& character, std::mt19937_64& rng) {
  Character other;
  other.joints = character.joints;
  const auto order_of = [&](Eigen::Index n) {
    std::vector<int> order(static_cast<std::size_t>(n));
    std::iota(order.begin(), order.end(), 0);
    for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[rng() % i]);
    return order;
  };
  const std::vector<int> vertices = order_of(character.skin.points.rows());
  std::vector<int> new_index(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i)
    new_index[static_cast<std::size_t>(vertices[i])] = static_cast<int>(i);
  other.skin.points = character.skin.points(vertices, Eigen::all);
  for (int v : vertices) other.skin.weights.push_back(character.skin.weights[static_cast<std::size_t>(v)]);
  other.skin.triangles = character.skin.triangles(order_of(character.skin.triangles.rows()), Eigen::all);
  for (Eigen::Index t = 0; t < other.skin.triangles.rows(); ++t) {
    const int turn = static_cast<int>(rng() % 3);
    const Eigen::RowVector3i old = other.skin.triangles.row(t);
    for (int k = 0; k < 3; ++k)
      other.skin.triangles(t, k) = new_index[static_cast<std::size_t>(old[(k + turn) % 3])];
  }
  return other;
}

}  // namespace sinew::tests
