#include "tools/session/whole_skin.h"

#include <algorithm>

#include <fmt/format.h>

namespace sinew::tools {

using lattice::Points;

Points rest_points(const assets::Rig& rig) {
  Points all(assets::num_vertices(rig), 3);
  Eigen::Index next = 0;
  for (const assets::Part& part : rig.parts) {
    all.middleRows(next, part.points.rows()) = part.points;
    next += part.points.rows();
  }
  return all;
}

lattice::Triangles all_triangles(const assets::Rig& rig) {
  Eigen::Index count = 0;
  for (const auto& part : rig.parts) count += part.triangles.rows();
  lattice::Triangles all(count, 3);
  Eigen::Index next = 0;
  int offset = 0;
  for (const auto& part : rig.parts) {
    all.middleRows(next, part.triangles.rows()) = part.triangles.array() + offset;
    next += part.triangles.rows();
    offset += static_cast<int>(part.points.rows());
  }
  return all;
}

Points with_flesh(const assets::PhysicsSkin& skin, const Points& skinned, const Points& surface) {
  Points all = skinned;
  for (std::size_t i = 0; i < skin.surface_of_vertex.size(); ++i) {
    const int at = skin.surface_of_vertex[i];
    if (at >= 0) all.row(static_cast<Eigen::Index>(i)) = surface.row(at);
  }
  return all;
}

std::string place_of(const assets::Rig& rig, int vertex) {
  for (const assets::Part& part : rig.parts) {
    if (vertex >= part.points.rows()) {
      vertex -= static_cast<int>(part.points.rows());
      continue;
    }
    int joint = part.joint;
    if (static_cast<std::size_t>(vertex) < part.weights.size() &&
        !part.weights[static_cast<std::size_t>(vertex)].empty()) {
      const auto& influences = part.weights[static_cast<std::size_t>(vertex)];
      joint = std::max_element(influences.begin(), influences.end(), [](const auto& a, const auto& b) {
                return a.weight < b.weight;
              })->frame;
    }
    const std::string name = joint < 0 ? "" : fmt::format("'{}'", rig.skeleton.joint(joint).name);
    if (rig.parts.size() == 1 && !name.empty()) return name;
    return name.empty() ? fmt::format("part '{}'", part.name)
                        : fmt::format("{} (part '{}')", name, part.name);
  }
  return "nowhere";
}

}  // namespace sinew::tools
