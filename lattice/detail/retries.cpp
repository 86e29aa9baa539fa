#include "lattice/detail/retries.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include <fmt/format.h>

#include "lattice/quality.h"

namespace sinew::lattice::detail {
namespace {

/// Cells that the gate refuses for their shape.
std::vector<int> bad_cells(const ControlLattice& lattice, const Inspection& found,
                           const BuildOptions& options) {
  std::vector<int> cells = found.inverted_cells;
  for (int c = 0; c < static_cast<int>(lattice.complex.cells.size()); ++c) {
    const Cell& cell = lattice.complex.cells[c];
    if (min_dihedral_degrees(lattice.complex, cell) < options.min_dihedral_degrees ||
        min_scaled_jacobian(lattice.complex, cell) < options.min_scaled_jacobian)
      cells.push_back(c);
  }
  return cells;
}

bool is_leaf(const ControlLattice& lattice, const LatticeBone& bone) {
  return std::none_of(lattice.bones.begin(), lattice.bones.end(), [&](const LatticeBone& other) {
    return !other.soft && other.chain.front() == bone.chain.back();
  });
}

}  // namespace

std::vector<Attempt> planned_attempts(const BuildOptions& options) {
  Attempt first;
  first.name = "as asked";
  first.reduction.tip_bones = options.tip_bones;
  std::vector<Attempt> list;
  const auto add = [&](const char* name, const auto& change) {
    list.push_back(first);
    list.back().name = name;
    change(list.back());
  };
  add("as asked", [](Attempt&) {});
  add("grid moved by a quarter of its cubes",
      [](Attempt& a) { a.points.shift = 0.25, a.moves_grid_only = true; });
  add("h x 0.93", [](Attempt& a) { a.h_factor = 0.93, a.moves_grid_only = true; });
  add("h x 1.08", [](Attempt& a) { a.h_factor = 1.08, a.moves_grid_only = true; });
  add("bones below 0.6 h contracted", [](Attempt& a) { a.reduction.smallest_bone = 0.6; });
  add("bones below 0.7 h contracted", [](Attempt& a) { a.reduction.smallest_bone = 0.7; });
  add("vertices farther from bones", [](Attempt& a) { a.points.exclusion = 0.7, a.moves_grid_only = true; });
  add("siblings within 25 degrees or 0.3 h chained", [](Attempt& a) {
    a.reduction.chain_degrees = 25.0;
    a.reduction.too_close = 0.3;
  });
  add("siblings within 35 degrees or 0.4 h chained", [](Attempt& a) {
    a.reduction.chain_degrees = 35.0;
    a.reduction.too_close = 0.4;
  });
  list.resize(std::min<std::size_t>(list.size(), static_cast<std::size_t>(options.max_retries) + 1));
  return list;
}

std::vector<Attempt> moved_grids(const BuildOptions& options) {
  std::vector<Attempt> list;
  for (const double shift : {0.25, 0.125, 0.375}) {
    list.push_back(planned_attempts(options).front());
    list.back().points.shift = shift;
    list.back().moves_grid_only = true;
  }
  return list;
}

bool is_shaped_by_bones(const ControlLattice& lattice, const Inspection& found, const BuildOptions& options) {
  std::set<std::pair<int, int>> pieces;
  for (const LatticeBone& bone : lattice.bones)
    for (std::size_t i = 1; i < bone.chain.size(); ++i)
      pieces.insert(std::minmax(bone.chain[i - 1], bone.chain[i]));
  const std::vector<int> bad = bad_cells(lattice, found, options);
  return std::any_of(bad.begin(), bad.end(), [&](int c) {
    const Cell& cell = lattice.complex.cells[c];
    std::array<int, 8> count{};
    for (const std::array<int, 2>& e : cell_edges(cell.type))
      if (pieces.contains(std::minmax(cell.vertices[e[0]], cell.vertices[e[1]])))
        ++count[e[0]], ++count[e[1]];
    return *std::max_element(count.begin(), count.end()) >= 3;
  });
}

std::optional<SoftBone> offending_bone(const ControlLattice& lattice, const Inspection& found,
                                       const BuildOptions& options) {
  const std::vector<int> bad = bad_cells(lattice, found, options);
  // 2: a piece of the bone is an edge of a refused cell; 1: a vertex of it is there; 0: it is elsewhere.
  const auto guilt = [&](const LatticeBone& bone) {
    if (std::find(found.broken_chains.begin(), found.broken_chains.end(), bone.name) !=
        found.broken_chains.end())
      return 2L;
    long most = 0;
    for (const int c : bad)
      most = std::max(most, std::count_if(bone.chain.begin(), bone.chain.end(), [&](int v) {
                        const auto& corners = lattice.complex.cells[c].vertices;
                        return std::find(corners.begin(), corners.end(), v) != corners.end();
                      }));
    return std::min(most, 2L);
  };
  const LatticeBone* best = nullptr;
  std::tuple<long, bool, double> best_rank;
  for (const LatticeBone& bone : lattice.bones) {
    const long guilty = bone.soft ? 0 : guilt(bone);
    if (guilty == 0) continue;
    const std::tuple rank(guilty, is_leaf(lattice, bone), -(bone.rest_end - bone.rest_start).norm());
    if (best == nullptr || rank > best_rank) best = &bone, best_rank = rank;
  }
  if (best == nullptr) return std::nullopt;
  return SoftBone{best->frame, best->end.joint_a, best->tip,
                  fmt::format("the cells at it are too flat: {:.3g} degrees, scaled Jacobian {:.3g}",
                              found.quality.min_dihedral_degrees, found.quality.min_scaled_jacobian)};
}

}  // namespace sinew::lattice::detail
