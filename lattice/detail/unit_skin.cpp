#include "lattice/detail/unit_skin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <stdexcept>
#include <string>
#include <tuple>
#include <unordered_map>

#include <Eigen/Geometry>

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// Points closer than this are one, in units of the longest side of the box.
constexpr double kWeldDistance = 1e-6;
/// A component whose volume is below this share of a sphere's of equal area is a sheet: its winding is the
/// user's.
constexpr double kSheetShare = 1e-3;

using GridKey = std::array<std::int64_t, 3>;

struct GridHash {
  std::size_t operator()(const GridKey& k) const {
    return static_cast<std::size_t>(k[0] * 73856093) ^ static_cast<std::size_t>(k[1] * 19349663) ^
           static_cast<std::size_t>(k[2] * 83492791);
  }
};

/// Vertices ascending by position, then by weights: an order that the numbering of the input has no part in,
/// so that everything built from it has none either.
std::vector<int> canonical_order(const Points& points, const std::vector<std::vector<Influence>>& weights) {
  std::vector<int> order(static_cast<std::size_t>(points.rows()));
  std::iota(order.begin(), order.end(), 0);
  const auto before = [](const Influence& x, const Influence& y) {
    return std::tie(x.frame, x.weight) < std::tie(y.frame, y.weight);
  };
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    for (int k = 0; k < 3; ++k)
      if (points(a, k) != points(b, k)) return points(a, k) < points(b, k);
    if (weights.empty()) return false;
    return std::lexicographical_compare(weights[a].begin(), weights[a].end(), weights[b].begin(),
                                        weights[b].end(), before);
  });
  return order;
}

/// For every point the lowest-numbered earlier representative within the weld distance, or itself.
std::vector<int> weld(const Points& points) {
  std::unordered_map<GridKey, std::vector<int>, GridHash> grid;  // looked up only, never walked
  std::vector<int> representative(points.rows());
  for (int v = 0; v < points.rows(); ++v) {
    const Vector3d p = points.row(v).transpose();
    GridKey key;
    for (int k = 0; k < 3; ++k) key[k] = static_cast<std::int64_t>(std::floor(p[k] / kWeldDistance));
    int found = v;
    for (int n = 0; n < 27; ++n) {
      const auto bucket = grid.find({key[0] + n % 3 - 1, key[1] + n / 3 % 3 - 1, key[2] + n / 9 - 1});
      if (bucket == grid.end()) continue;
      for (int other : bucket->second)
        if ((points.row(other).transpose() - p).norm() < kWeldDistance) found = std::min(found, other);
    }
    representative[v] = found;
    if (found == v) grid[key].push_back(v);
  }
  return representative;
}

std::vector<std::array<int, 3>> clean_triangles(const Triangles& triangles,
                                                const std::vector<int>& new_vertex, const Points& points) {
  std::vector<std::array<int, 3>> kept;
  for (int t = 0; t < triangles.rows(); ++t) {
    const std::array<int, 3> tri{new_vertex[triangles(t, 0)], new_vertex[triangles(t, 1)],
                                 new_vertex[triangles(t, 2)]};
    if (tri[0] == tri[1] || tri[1] == tri[2] || tri[2] == tri[0]) continue;
    const Vector3d a = points.row(tri[0]), b = points.row(tri[1]), c = points.row(tri[2]);
    if (!((b - a).cross(c - a).norm() > 1e-14)) continue;  // area 1e-14 of a unit box: rounding only
    kept.push_back(tri);
  }
  // In an order of their own, whatever the input's.
  for (std::array<int, 3>& tri : kept)
    std::rotate(tri.begin(), std::min_element(tri.begin(), tri.end()), tri.end());
  std::sort(kept.begin(), kept.end());
  // Of triangles with the same three vertices the first stays.
  std::vector<std::pair<std::array<int, 3>, int>> order;
  for (int t = 0; t < static_cast<int>(kept.size()); ++t) {
    std::array<int, 3> key = kept[t];
    std::sort(key.begin(), key.end());
    order.emplace_back(key, t);
  }
  std::sort(order.begin(), order.end());
  std::vector<bool> doubled(kept.size(), false);
  for (std::size_t i = 1; i < order.size(); ++i)
    if (order[i].first == order[i - 1].first) doubled[order[i].second] = true;
  std::vector<std::array<int, 3>> unique;
  for (std::size_t t = 0; t < kept.size(); ++t)
    if (!doubled[t]) unique.push_back(kept[t]);
  return unique;
}

struct HalfEdge {
  int low, high, triangle;
  bool forward;  ///< runs from low to high in its triangle.
};

/// Makes neighbours across two-sided edges agree, then turns every closed-looking component outward.
void orient(std::vector<std::array<int, 3>>& triangles, const Points& points) {
  std::vector<HalfEdge> edges;
  for (int t = 0; t < static_cast<int>(triangles.size()); ++t)
    for (int k = 0; k < 3; ++k) {
      const int a = triangles[t][k], b = triangles[t][(k + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), t, a < b});
    }
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& x, const HalfEdge& y) {
    return std::tie(x.low, x.high, x.triangle) < std::tie(y.low, y.high, y.triangle);
  });
  struct Neighbour {
    int triangle;
    bool agrees;
  };
  std::vector<std::vector<Neighbour>> neighbours(triangles.size());
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t j = i;
    while (j < edges.size() && edges[j].low == edges[i].low && edges[j].high == edges[i].high) ++j;
    if (j - i == 2) {
      const bool agrees = edges[i].forward != edges[i + 1].forward;
      neighbours[edges[i].triangle].push_back({edges[i + 1].triangle, agrees});
      neighbours[edges[i + 1].triangle].push_back({edges[i].triangle, agrees});
    }
    i = j;
  }
  enum : char { kUnseen, kAsIs, kFlipped };
  std::vector<char> state(triangles.size(), kUnseen);
  for (int seed = 0; seed < static_cast<int>(triangles.size()); ++seed) {
    if (state[seed] != kUnseen) continue;
    std::vector<int> component{seed};
    state[seed] = kAsIs;
    for (std::size_t i = 0; i < component.size(); ++i)
      for (const Neighbour& n : neighbours[component[i]]) {
        if (state[n.triangle] != kUnseen) continue;
        const bool flipped = (state[component[i]] == kFlipped) != !n.agrees;
        state[n.triangle] = flipped ? kFlipped : kAsIs;
        component.push_back(n.triangle);
      }
    Vector3d centre = Vector3d::Zero();
    for (int t : component)
      centre += points.row(triangles[t][0]).transpose() / static_cast<double>(component.size());
    double volume = 0.0, area = 0.0;
    for (int t : component) {
      const Vector3d a = points.row(triangles[t][0]).transpose() - centre;
      const Vector3d b = points.row(triangles[t][1]).transpose() - centre;
      const Vector3d c = points.row(triangles[t][2]).transpose() - centre;
      volume += a.dot(b.cross(c)) / 6.0 * (state[t] == kFlipped ? -1.0 : 1.0);
      area += 0.5 * (b - a).cross(c - a).norm();
    }
    // A sphere of area A has the volume A^1.5 / (6 sqrt(pi)).
    const bool turn = volume < -kSheetShare * std::pow(area, 1.5) / 10.6;
    for (int t : component)
      if ((state[t] == kFlipped) != turn) std::swap(triangles[t][1], triangles[t][2]);
  }
}

void check(const Surface& skin) {
  if (skin.triangles.rows() == 0) throw std::invalid_argument("lattice: the skin has no triangle");
  if (!skin.weights.empty() && static_cast<Eigen::Index>(skin.weights.size()) != skin.points.rows()) {
    throw std::invalid_argument("lattice: the skin has " + std::to_string(skin.points.rows()) +
                                " vertices but " + std::to_string(skin.weights.size()) + " sets of weights");
  }
  for (Eigen::Index v = 0; v < skin.points.rows(); ++v)
    if (!skin.points.row(v).allFinite()) {
      throw std::invalid_argument("lattice: skin vertex " + std::to_string(v) + " is not finite");
    }
  if (skin.triangles.minCoeff() < 0 || skin.triangles.maxCoeff() >= skin.points.rows()) {
    throw std::invalid_argument("lattice: a skin triangle names a vertex that does not exist");
  }
}

}  // namespace

UnitSkin make_unit_skin(const Surface& skin, const MirrorFrame* frame) {
  check(skin);
  const Vector3d low = skin.points.colwise().minCoeff(), high = skin.points.colwise().maxCoeff();
  const Vector3d centre = frame != nullptr ? frame->origin : Vector3d(0.5 * (low + high));
  const Eigen::Matrix3d axes = frame != nullptr ? frame->axes : Eigen::Matrix3d::Identity();
  const double scale = (high - low).maxCoeff();
  if (!(scale > 0.0)) throw std::invalid_argument("lattice: all skin vertices are one point");
  const Points unit = (skin.points.rowwise() - centre.transpose()) * axes.transpose() / scale;

  const std::vector<int> order = canonical_order(unit, skin.weights);
  const std::vector<int> representative = weld(unit(order, Eigen::all));
  std::vector<int> new_vertex(unit.rows());
  std::vector<int> kept;
  std::vector<std::vector<Influence>> weights;
  for (int i = 0; i < unit.rows(); ++i) {
    const int v = order[i];
    if (representative[i] == i) {
      new_vertex[v] = static_cast<int>(kept.size());
      kept.push_back(v);
      weights.push_back(skin.weights.empty() ? std::vector<Influence>{} : skin.weights[v]);
    } else {
      new_vertex[v] = new_vertex[order[representative[i]]];
      if (weights[new_vertex[v]].empty() && !skin.weights.empty()) weights[new_vertex[v]] = skin.weights[v];
    }
  }
  const Points points = unit(kept, Eigen::all);
  std::vector<std::array<int, 3>> list = clean_triangles(skin.triangles, new_vertex, points);
  if (list.empty()) throw std::invalid_argument("lattice: no skin triangle has an area");
  orient(list, points);

  Triangles triangles(static_cast<Eigen::Index>(list.size()), 3);
  std::vector<Vector3d> normals(kept.size(), Vector3d::Zero());
  std::vector<double> areas(kept.size(), 0.0);
  for (std::size_t t = 0; t < list.size(); ++t) {
    triangles.row(static_cast<Eigen::Index>(t)) << list[t][0], list[t][1], list[t][2];
    const Vector3d a = points.row(list[t][0]), b = points.row(list[t][1]), c = points.row(list[t][2]);
    const Vector3d area_normal = 0.5 * (b - a).cross(c - a);
    for (int v : list[t]) {
      normals[v] += area_normal;
      areas[v] += area_normal.norm() / 3.0;
    }
  }
  for (Vector3d& n : normals) n.stableNormalize();
  SurfaceQuery query(points, triangles);
  return {centre,
          axes,
          scale,
          points,
          triangles,
          std::move(weights),
          std::move(normals),
          std::move(areas),
          std::move(new_vertex),
          std::move(query)};
}

}  // namespace sinew::lattice::detail
