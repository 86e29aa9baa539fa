#include "assets/islands.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "assets/detail/island_roles.h"
#include "assets/detail/rest_points.h"
#include "assets/detail/text.h"
#include "assets/error.h"
#include "assets/riding.h"

namespace sinew::assets {

namespace {

using lattice::Influence;
using lattice::Points;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// Sets of vertices that hang together; the smallest one stands for its set.
class Sets {
 public:
  explicit Sets(int count) : parent_(at(count)) { std::iota(parent_.begin(), parent_.end(), 0); }

  int find(int i) {
    while (parent_[at(i)] != i) i = parent_[at(i)] = parent_[at(parent_[at(i)])];
    return i;
  }
  void join(int a, int b) {
    a = find(a);
    b = find(b);
    parent_[at(std::max(a, b))] = std::min(a, b);
  }

 private:
  std::vector<int> parent_;
};

/// Joins points closer than `tolerance` [m] in every coordinate: the boxes round such points meet, so that
/// they share a cell of a grid, and the box of a point rarely lies in more than one.
void join_coincident(const Points& points, const std::vector<bool>& wanted, double tolerance, Sets& sets) {
  using Key = std::array<std::int64_t, 3>;
  std::vector<std::pair<Key, int>> cells;
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    if (!wanted[static_cast<std::size_t>(v)]) continue;
    std::set<Key> keys;
    for (int corner = 0; corner < 8; ++corner) {
      Key key{};
      for (int c = 0; c < 3; ++c) {
        const double side = (corner >> c & 1) != 0 ? 0.5 : -0.5;
        key[at(c)] = static_cast<std::int64_t>(std::floor(points(v, c) / (4.0 * tolerance) + 0.25 * side));
      }
      keys.insert(key);
    }
    for (const Key& key : keys) cells.emplace_back(key, static_cast<int>(v));
  }
  std::sort(cells.begin(), cells.end());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    for (std::size_t j = i + 1; j < cells.size() && cells[j].first == cells[i].first; ++j) {
      const auto apart = points.row(cells[i].second) - points.row(cells[j].second);
      if (apart.cwiseAbs().maxCoeff() <= tolerance) sets.join(cells[i].second, cells[j].second);
    }
  }
}

/// The rig as one list of vertices.
struct Whole {
  explicit Whole(const Rig& rig) : points(detail::rest_points(rig)) {
    for (std::size_t p = 0; p < rig.parts.size(); ++p) {
      first.push_back(static_cast<int>(part.size()));
      part.insert(part.end(), static_cast<std::size_t>(rig.parts[p].points.rows()), static_cast<int>(p));
    }
  }
  Points points;
  std::vector<int> first;  ///< vertex of every part.
  std::vector<int> part;   ///< of every vertex.
};

double area_of(const Points& points, const lattice::Triangles& triangles) {
  double area = 0.0;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Eigen::Vector3d a = points.row(triangles(t, 0)), b = points.row(triangles(t, 1)),
                          c = points.row(triangles(t, 2));
    area += 0.5 * (b - a).cross(c - a).norm();
  }
  return area;
}

/// The joint that the vertices hang on alone, or -1.
int only_joint(const Rig& rig, const Whole& whole, const std::vector<int>& vertices) {
  std::map<int, double> weight_of;
  double total = 0.0;
  for (const int v : vertices) {
    const int p = whole.part[at(v)];
    for (const Influence& influence : rig.parts[at(p)].weights[at(v - whole.first[at(p)])]) {
      weight_of[influence.frame] += influence.weight;
      total += influence.weight;
    }
  }
  for (const auto& [joint, weight] : weight_of)
    if (weight >= kOneJoint * total) return joint;
  return -1;
}

lattice::Triangles to_triangles(const std::vector<std::array<int, 3>>& list) {
  lattice::Triangles triangles(static_cast<Eigen::Index>(list.size()), 3);
  for (std::size_t t = 0; t < list.size(); ++t)
    for (std::size_t c = 0; c < 3; ++c)
      triangles(static_cast<Eigen::Index>(t), static_cast<Eigen::Index>(c)) = list[t][c];
  return triangles;
}

std::vector<Island> skinned_islands(const Rig& rig, const Whole& whole) {
  const int count = static_cast<int>(whole.part.size());
  Sets sets(count);
  std::vector<bool> wanted(at(count), false);
  Eigen::AlignedBox3d box;
  for (int v = 0; v < count; ++v) {
    if (rig.parts[at(whole.part[at(v)])].weights.empty()) continue;
    wanted[at(v)] = true;
    box.extend(whole.points.row(v).transpose());
  }
  if (!box.isEmpty() && box.diagonal().norm() > 0.0)
    join_coincident(whole.points, wanted, 1e-6 * box.diagonal().norm(), sets);
  const auto for_each_triangle = [&](const auto& visit) {
    for (std::size_t p = 0; p < rig.parts.size(); ++p) {
      if (rig.parts[p].weights.empty()) continue;
      const lattice::Triangles& t = rig.parts[p].triangles;
      for (Eigen::Index i = 0; i < t.rows(); ++i)
        visit(
            std::array<int, 3>{whole.first[p] + t(i, 0), whole.first[p] + t(i, 1), whole.first[p] + t(i, 2)});
    }
  };
  for_each_triangle([&](const std::array<int, 3>& t) {
    sets.join(t[0], t[1]);
    sets.join(t[1], t[2]);
  });
  // A piece without triangles is no island: such vertices go with the flesh.
  std::map<int, std::vector<std::array<int, 3>>> triangles_of;
  for_each_triangle([&](const std::array<int, 3>& t) { triangles_of[sets.find(t[0])].push_back(t); });
  std::map<int, std::vector<int>> vertices_of;
  for (int v = 0; v < count; ++v)
    if (wanted[at(v)]) vertices_of[sets.find(v)].push_back(v);
  std::vector<Island> islands;
  for (const auto& [root, triangles] : triangles_of) {
    Island island;
    island.vertices = vertices_of[root];
    island.triangles = to_triangles(triangles);
    island.joint = only_joint(rig, whole, island.vertices);
    island.area = area_of(whole.points, island.triangles);
    island.is_skinned = true;
    islands.push_back(std::move(island));
  }
  return islands;
}

/// Meshes that the file hangs on a joint as they are.
void add_hanging_parts(const Rig& rig, const Whole& whole, std::vector<Island>& islands) {
  for (std::size_t p = 0; p < rig.parts.size(); ++p) {
    const Part& part = rig.parts[p];
    if (!part.weights.empty() || part.joint < 0 || part.triangles.rows() == 0) continue;
    Island island;
    island.vertices.resize(static_cast<std::size_t>(part.points.rows()));
    std::iota(island.vertices.begin(), island.vertices.end(), whole.first[p]);
    island.triangles = part.triangles.array() + whole.first[p];
    island.joint = part.joint;
    island.area = area_of(whole.points, island.triangles);
    islands.push_back(std::move(island));
  }
  std::sort(islands.begin(), islands.end(),
            [](const Island& a, const Island& b) { return a.vertices.front() < b.vertices.front(); });
}

void name_islands(const Rig& rig, const Whole& whole, std::vector<Island>& islands) {
  const auto part_of = [&](const Island& island) { return whole.part[at(island.vertices.front())]; };
  std::map<int, int> count_in;
  for (const Island& island : islands) ++count_in[part_of(island)];
  std::map<std::string, int> uses;
  for (Island& island : islands) {
    const Part& part = rig.parts[at(part_of(island))];
    island.name = part.name;
    if (count_in[part_of(island)] > 1 && island.joint >= 0)
      island.name += "/" + rig.skeleton.joint(island.joint).name;
    const int use = ++uses[island.name];
    if (use > 1) island.name += "/" + std::to_string(use);
  }
}

}  // namespace

std::vector<Island> find_islands(const Rig& rig) {
  const Whole whole(rig);
  std::vector<Island> islands = skinned_islands(rig, whole);
  add_hanging_parts(rig, whole, islands);
  name_islands(rig, whole, islands);
  detail::choose_roles(rig, islands);
  return islands;
}

void set_roles(Rig& rig, const std::vector<Island>& islands) {
  const Whole whole(rig);
  rig.props.clear();
  for (const Island& island : islands) {
    if (island.role == PartRole::Simulated) {
      if (island.is_skinned) continue;
      Part& part = rig.parts[at(whole.part[at(island.vertices.front())])];
      part.weights.assign(static_cast<std::size_t>(part.points.rows()), {{part.joint, 1.0}});
      part.role = PartRole::Simulated;
      part.joint = -1;
      continue;
    }
    if (island.role == PartRole::Rigid && island.joint < 0)
      throw ConfigError("part '" + detail::printable(island.name) +
                        "': cannot be rigid, as it hangs on several joints; hint: role = \"skinned\"");
    rig.props.push_back({island.name, island.role, island.joint, island.vertices, {}, island.reason});
  }
  hang_riders(rig);
}

}  // namespace sinew::assets
