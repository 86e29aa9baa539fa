#include "tools/session/body_fields.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <fmt/format.h>

namespace sinew::tools {
namespace {

/// Cell of the lattice that a leaf cell is part of.
std::size_t coarse_cell(const fem::Body& body, std::size_t leaf) {
  int hex = body.mesh.hex[leaf];
  for (int level = body.mesh.level[leaf]; level > 1; --level) hex /= 8;
  return static_cast<std::size_t>(body.hierarchy.coarse_cell(hex));
}

/// Means over the leaf cells of every cell, each counting by its share of it.
struct CellMeans {
  std::vector<double> share, fill, young, poisson, density;
  std::vector<std::int64_t> level;
};

CellMeans cell_means(const fem::Body& body) {
  const std::vector<lattice::Cell>& cells = body.hierarchy.coarse().cells;
  CellMeans means;
  for (auto* values : {&means.share, &means.fill, &means.young, &means.poisson, &means.density})
    values->assign(cells.size(), 0.0);
  means.level.assign(cells.size(), 0);
  for (std::size_t leaf = 0; leaf < body.mesh.cells.size(); ++leaf) {
    const std::size_t c = coarse_cell(body, leaf);
    const int level = body.mesh.level[leaf];
    const double share = std::ldexp(1.0, -3 * (level - 1)) / num_corners(cells[c].type);
    means.share[c] += share;
    for (const double octant : body.fill[leaf]) means.fill[c] += share * octant / 8.0;
    means.young[c] += share * body.materials[leaf].young;
    means.poisson[c] += share * body.materials[leaf].poisson;
    means.density[c] += share * body.materials[leaf].density;
    means.level[c] = std::max<std::int64_t>(means.level[c], level);
  }
  for (auto* values : {&means.young, &means.poisson, &means.density})
    for (std::size_t c = 0; c < cells.size(); ++c)
      (*values)[c] =
          means.share[c] > 0.0 ? (*values)[c] / means.share[c] : std::numeric_limits<double>::quiet_NaN();
  return means;
}

std::string region_name(const fem::Body& body, const fem::Region& region) {
  const auto frame = [&](int f) { return body.tree.frames[static_cast<std::size_t>(f)].name; };
  if (region.first == region.second) return "region " + frame(region.first);
  std::string name = fmt::format("region {}-{}", frame(region.first), frame(region.second));
  if (region.t != 0.5) name += fmt::format(" {:.2f}", region.t);
  return name;
}

}  // namespace

assets::LatticeFields body_fields(const fem::Body& body) {
  assets::LatticeFields fields;
  CellMeans means = cell_means(body);
  fields.cells = {{"fill", 1, std::move(means.fill)},
                  {"level", 1, std::move(means.level)},
                  {"young", 1, std::move(means.young)},
                  {"poisson", 1, std::move(means.poisson)},
                  {"density", 1, std::move(means.density)}};
  const auto num_vertices = static_cast<std::size_t>(body.hierarchy.num_vertices(0));
  for (const fem::Region& region : body.regions) {
    std::vector<double> weights(num_vertices, 0.0);
    for (std::size_t i = 0; i < region.vertices.size(); ++i) {
      const auto vertex =
          static_cast<std::size_t>(body.mesh.vertices[static_cast<std::size_t>(region.vertices[i])]);
      if (vertex < num_vertices) weights[vertex] = region.weights[i];
    }
    fields.points.push_back({region_name(body, region), 1, std::move(weights)});
  }
  return fields;
}

}  // namespace sinew::tools
