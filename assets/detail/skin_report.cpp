#include "assets/detail/skin_report.h"

#include <algorithm>
#include <numeric>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "assets/detail/text.h"

namespace sinew::assets::detail {

namespace {

/// A triangle lower than this share of its longest side is a needle: single precision coordinates cannot tell
/// its normal.
constexpr double kNeedle = 1e-6;
/// Of a kind, so many are named.
constexpr std::size_t kNamed = 20;

bool is_degenerate(const Part& part, Eigen::Index triangle) {
  const Eigen::Vector3d a = part.points.row(part.triangles(triangle, 0));
  const Eigen::Vector3d b = part.points.row(part.triangles(triangle, 1));
  const Eigen::Vector3d c = part.points.row(part.triangles(triangle, 2));
  const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return (b - a).cross(c - a).norm() <= kNeedle * longest;
}

void report_degenerate(Rig& rig, const Part& part) {
  std::string named;
  std::size_t count = 0;
  for (Eigen::Index t = 0; t < part.triangles.rows(); ++t) {
    if (!is_degenerate(part, t)) continue;
    if (count++ < kNamed) named += (named.empty() ? "" : ", ") + std::to_string(t);
  }
  if (count == 0) return;
  if (count > kNamed) named += " and " + std::to_string(count - kNamed) + " more";
  rig.findings.push_back({Finding::Severity::Warning, "degenerate-triangles", part.name,
                          std::to_string(count) + " triangles have no area (" + named +
                              "); they are exported, but physics goes without them",
                          "remove them with a mesh clean-up"});
}

/// Number of connected components of a set of triangles over `num_points` points that use any point.
std::size_t num_shells(const lattice::Surface& surface) {
  std::vector<int> root(static_cast<std::size_t>(surface.points.rows()));
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](int i) {
    while (root[static_cast<std::size_t>(i)] != i) {
      root[static_cast<std::size_t>(i)] = root[static_cast<std::size_t>(root[static_cast<std::size_t>(i)])];
      i = root[static_cast<std::size_t>(i)];
    }
    return i;
  };
  for (Eigen::Index t = 0; t < surface.triangles.rows(); ++t) {
    for (int c = 1; c < 3; ++c) {
      root[static_cast<std::size_t>(find(surface.triangles(t, c)))] = find(surface.triangles(t, 0));
    }
  }
  std::set<int> shells;
  for (Eigen::Index t = 0; t < surface.triangles.rows(); ++t) shells.insert(find(surface.triangles(t, 0)));
  return shells.size();
}

struct EdgeCounts {
  std::size_t open = 0;     ///< one triangle.
  std::size_t crowded = 0;  ///< more than two.
};

EdgeCounts count_edges(const lattice::Surface& surface) {
  std::vector<std::pair<int, int>> edges;
  for (Eigen::Index t = 0; t < surface.triangles.rows(); ++t) {
    for (int c = 0; c < 3; ++c) {
      edges.push_back(std::minmax({surface.triangles(t, c), surface.triangles(t, (c + 1) % 3)}));
    }
  }
  std::sort(edges.begin(), edges.end());
  EdgeCounts counts;
  for (auto begin = edges.begin(); begin != edges.end();) {
    const auto end = std::upper_bound(begin, edges.end(), *begin);
    if (end - begin == 1) ++counts.open;
    if (end - begin > 2) ++counts.crowded;
    begin = end;
  }
  return counts;
}

}  // namespace

void report_skin(Rig& rig) {
  for (const Part& part : rig.parts) {
    if (part.role == PartRole::Simulated) report_degenerate(rig, part);
  }
  // Two places with different weights are two points for physics, but no gap in the surface.
  Rig bare = rig;
  for (Part& part : bare.parts) {
    for (auto& influences : part.weights) influences = {{0, 1.0}};
  }
  const lattice::Surface surface = physics_skin(bare).surface;
  if (surface.triangles.rows() == 0) return;
  const double diagonal = (surface.points.colwise().maxCoeff() - surface.points.colwise().minCoeff()).norm();
  const double thin = thickness(surface.points);
  if (!(thin > kFlatSkin * diagonal)) {
    rig.findings.push_back({Finding::Severity::Error, "flat-skin", "",
                            "the skin is flat and holds no flesh: " + number(thin) +
                                " m thick, expected more than " + number(kFlatSkin * diagonal) + " m",
                            "give the mesh a volume"});
  }
  const EdgeCounts edges = count_edges(surface);
  if (edges.open > 0) {
    rig.findings.push_back(
        {Finding::Severity::Info, "open-surface", "",
         "the skin is not closed: " + std::to_string(edges.open) +
             " edges belong to one triangle only; inside and outside are told apart by the winding "
             "number",
         ""});
  }
  if (edges.crowded > 0) {
    rig.findings.push_back({Finding::Severity::Info, "crowded-edges", "",
                            std::to_string(edges.crowded) + " edges belong to more than two triangles", ""});
  }
  const std::size_t shells = num_shells(surface);
  if (shells > 1) {
    rig.findings.push_back({Finding::Severity::Info, "several-shells", "",
                            "the skin consists of " + std::to_string(shells) +
                                " separate shells; they share one lattice where they lie together",
                            ""});
  }
}

}  // namespace sinew::assets::detail
