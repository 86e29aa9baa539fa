#include "fem/skin/detail/judged_skin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>

#include <Eigen/Geometry>
#include <tbb/parallel_for.h>

#include "fem/skin/skin_judge.h"

namespace sinew::fem::detail {

using lattice::Points;
using lattice::Triangles;

namespace {

/// Vertices nearer than this are one [heights].
constexpr double kWeld = 2e-5;
/// Triangles smaller than this are none [heights^2].
constexpr double kNoArea = 1e-12;

/// Number of the place of every vertex, and the first vertex of every place.
struct Welding {
  std::vector<int> place_of, vertex_of;
};

Welding weld(const SkinJudgeInput& input) {
  const auto n = static_cast<std::size_t>(input.rest.rows());
  const std::size_t width = 3 * (1 + input.plain.size());
  std::vector<std::int64_t> key(n * width);
  const auto fill = [&](const Points& x, std::size_t offset) {
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t c = 0; c < 3; ++c)
        key[i * width + offset + c] = std::llrint(
            x(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(c)) / (kWeld * input.height));
    }
  };
  fill(input.rest, 0);
  for (std::size_t k = 0; k < input.plain.size(); ++k) fill(input.plain[k], 3 * (k + 1));
  const auto begin = [&](int i) {
    return key.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(i) * width);
  };
  const auto order = [&](int a, int b) {
    return std::lexicographical_compare(begin(a), begin(a + 1), begin(b), begin(b + 1));
  };
  std::vector<int> sorted(n);
  std::iota(sorted.begin(), sorted.end(), 0);
  std::stable_sort(sorted.begin(), sorted.end(), order);
  Welding welding;
  welding.place_of.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (i == 0 || order(sorted[i - 1], sorted[i])) welding.vertex_of.push_back(sorted[i]);
    welding.place_of[static_cast<std::size_t>(sorted[i])] = static_cast<int>(welding.vertex_of.size()) - 1;
  }
  return welding;
}

/// The triangles that are judged, in places; each set of corners once.
std::vector<std::array<int, 3>> judged_triangles(const SkinJudgeInput& input, const Welding& welding) {
  std::vector<char> flesh(welding.vertex_of.size(), 0);
  for (std::size_t i = 0; i < input.flesh.size(); ++i) {
    if (input.flesh[i]) flesh[static_cast<std::size_t>(welding.place_of[i])] = 1;
  }
  std::vector<std::array<int, 3>> kept, corners;
  for (Eigen::Index t = 0; t < input.triangles.rows(); ++t) {
    std::array<int, 3> v{};
    for (int k = 0; k < 3; ++k)
      v[static_cast<std::size_t>(k)] = welding.place_of[static_cast<std::size_t>(input.triangles(t, k))];
    if (v[0] == v[1] || v[1] == v[2] || v[0] == v[2]) continue;
    kept.push_back(v);
    std::sort(v.begin(), v.end());
    corners.push_back(v);
  }
  std::vector<std::size_t> order(kept.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return corners[a] < corners[b]; });
  std::vector<char> wanted(kept.size(), 0);
  for (std::size_t i = 0; i < order.size(); ++i)
    wanted[order[i]] = i == 0 || corners[order[i - 1]] != corners[order[i]];
  std::vector<std::array<int, 3>> judged;
  for (std::size_t t = 0; t < kept.size(); ++t) {
    const std::array<int, 3>& v = kept[t];
    const auto at = [&](std::size_t k) -> Eigen::RowVector3d {
      return input.rest.row(welding.vertex_of[static_cast<std::size_t>(v[k])]);
    };
    const bool moves = std::any_of(v.begin(), v.end(),
                                   [&](int place) { return flesh[static_cast<std::size_t>(place)] != 0; });
    const double area = 0.5 * (at(1) - at(0)).cross(at(2) - at(0)).norm();
    if (wanted[t] && moves && area > kNoArea * input.height * input.height) judged.push_back(v);
  }
  return judged;
}

/// Numbers the places that triangles use.
void number_vertices(const std::vector<std::array<int, 3>>& triangles, const Welding& welding,
                     const Points& rest, JudgedSkin& skin) {
  std::vector<int> number(welding.vertex_of.size(), -1);
  for (const auto& v : triangles) {
    for (int place : v) number[static_cast<std::size_t>(place)] = 0;
  }
  for (std::size_t place = 0; place < number.size(); ++place) {
    if (number[place] < 0) continue;
    number[place] = skin.num_vertices();
    skin.vertex.push_back(welding.vertex_of[place]);
  }
  skin.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k)
      skin.triangles(static_cast<Eigen::Index>(t), static_cast<Eigen::Index>(k)) =
          number[static_cast<std::size_t>(triangles[t][k])];
  }
  skin.rest.resize(skin.num_vertices(), 3);
  for (int v = 0; v < skin.num_vertices(); ++v)
    skin.rest.row(v) = rest.row(skin.vertex[static_cast<std::size_t>(v)]);
}

/// Neighbours of vertices, and the edges that two triangles share.
void connect(JudgedSkin& skin) {
  struct Side {
    int a, b, triangle;
  };
  std::vector<Side> sides;
  for (int t = 0; t < skin.num_triangles(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int a = skin.triangles(t, k), b = skin.triangles(t, (k + 1) % 3);
      sides.push_back({std::min(a, b), std::max(a, b), t});
    }
  }
  std::stable_sort(sides.begin(), sides.end(),
                   [](const Side& p, const Side& q) { return std::pair(p.a, p.b) < std::pair(q.a, q.b); });
  std::vector<std::vector<int>> around(static_cast<std::size_t>(skin.num_vertices()));
  for (std::size_t i = 0, end = 0; i < sides.size(); i = end) {
    while (end < sides.size() && sides[end].a == sides[i].a && sides[end].b == sides[i].b) ++end;
    const Side& side = sides[i];
    around[static_cast<std::size_t>(side.a)].push_back(side.b);
    around[static_cast<std::size_t>(side.b)].push_back(side.a);
    if (end - i != 2) continue;
    Hinge hinge{side.triangle,
                sides[i + 1].triangle,
                side.a,
                side.b,
                (skin.rest.row(side.a) - skin.rest.row(side.b)).norm(),
                1.0};
    hinge.cos_rest =
        skin.normal.row(hinge.triangle_a).normalized().dot(skin.normal.row(hinge.triangle_b).normalized());
    skin.hinges.push_back(hinge);
  }
  skin.first.push_back(0);
  for (int v = 0; v < skin.num_vertices(); ++v) {
    std::vector<int>& near = around[static_cast<std::size_t>(v)];
    std::sort(near.begin(), near.end());
    for (int w : near) {
      skin.neighbour.push_back(w);
      skin.length.push_back((skin.rest.row(w) - skin.rest.row(v)).norm());
    }
    skin.first.push_back(static_cast<int>(skin.neighbour.size()));
  }
}

}  // namespace

void triangle_normals(const Points& x, const Triangles& triangles, Points& normals) {
  normals.resize(triangles.rows(), 3);
  tbb::parallel_for(Eigen::Index{0}, triangles.rows(), [&](Eigen::Index t) {
    const Eigen::RowVector3d a = x.row(triangles(t, 0));
    normals.row(t) = (x.row(triangles(t, 1)) - a).cross(x.row(triangles(t, 2)) - a);
  });
}

Gram gram(const Points& x, const Triangles& triangles, Eigen::Index t) {
  const Eigen::RowVector3d origin = x.row(triangles(t, 0)), a = x.row(triangles(t, 1)) - origin,
                           b = x.row(triangles(t, 2)) - origin;
  return {a.squaredNorm(), a.dot(b), b.squaredNorm()};
}

JudgedSkin judged_skin(const SkinJudgeInput& input) {
  const Welding welding = weld(input);
  JudgedSkin skin;
  skin.height = input.height;
  skin.all = welding.vertex_of;
  number_vertices(judged_triangles(input, welding), welding, input.rest, skin);
  triangle_normals(skin.rest, skin.triangles, skin.normal);
  skin.share.assign(static_cast<std::size_t>(skin.num_vertices()), 0.0);
  for (int t = 0; t < skin.num_triangles(); ++t) {
    const double area = 0.5 * skin.normal.row(t).norm();
    skin.area.push_back(area);
    skin.total_area += area;
    skin.gram.push_back(gram(skin.rest, skin.triangles, t));
    for (int k = 0; k < 3; ++k) skin.share[static_cast<std::size_t>(skin.triangles(t, k))] += area / 3.0;
  }
  connect(skin);
  return skin;
}

}  // namespace sinew::fem::detail
