#include "lattice/detail/tetrahedralise.h"

#include <algorithm>
#include <utility>

#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Delaunay_triangulation_cell_base_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_cell_base_with_info_3.h>
#include <CGAL/Triangulation_vertex_base_with_info_3.h>

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_3<int, Kernel>;
using CellBase =
    CGAL::Triangulation_cell_base_with_info_3<bool, Kernel, CGAL::Delaunay_triangulation_cell_base_3<Kernel>>;
using Delaunay =
    CGAL::Delaunay_triangulation_3<Kernel, CGAL::Triangulation_data_structure_3<VertexBase, CellBase>>;

constexpr double kOffHull = 1e-9;         ///< from the plane of a half into it, unit coordinates.
constexpr std::size_t kPollEvery = 1000;  ///< of points and samples.
constexpr int kSplitRounds = 8;
constexpr int kRelaxRounds = 4;
constexpr double kRelaxReach = 2.0;  ///< free points this near a bone are relaxed, in units of h.

Kernel::Point_3 to_cgal(const Vector3d& p) { return {p.x(), p.y(), p.z()}; }

/// The triangulation of some points together with the handle of each.
struct Triangulation {
  Delaunay delaunay;
  std::vector<Delaunay::Vertex_handle> handles;

  explicit Triangulation(const std::vector<Vector3d>& points) {
    std::vector<std::pair<Kernel::Point_3, int>> list;
    list.reserve(points.size());
    for (std::size_t i = 0; i < points.size(); ++i)
      list.emplace_back(to_cgal(points[i]), static_cast<int>(i));
    delaunay.insert(list.begin(), list.end());
    handles.resize(points.size());
    for (auto v = delaunay.finite_vertices_begin(); v != delaunay.finite_vertices_end(); ++v)
      handles[v->info()] = v;
  }
  bool has_edge(int a, int b) const {
    Delaunay::Cell_handle cell;
    int i = 0, j = 0;
    return handles[a] != Delaunay::Vertex_handle() && handles[b] != Delaunay::Vertex_handle() &&
           delaunay.is_edge(handles[a], handles[b], cell, i, j);
  }
};

/// True where a vertex in the plane of a half has a face on the hull that is not in the plane.
bool on_rim(const LatticePoints& points, const Delaunay& delaunay, const Delaunay::Vertex_handle& vertex) {
  std::vector<Delaunay::Cell_handle> cells;
  delaunay.incident_cells(vertex, std::back_inserter(cells));
  return std::any_of(cells.begin(), cells.end(), [&](const Delaunay::Cell_handle& cell) {
    if (!delaunay.is_infinite(cell)) return false;
    for (int k = 0; k < 4; ++k)
      if (!delaunay.is_infinite(cell->vertex(k)) && !points.is_in_plane(cell->vertex(k)->info())) return true;
    return false;
  });
}

/// Moves free points near the bones half-way to the mean of their neighbours, so that the grid gives way.
void relax(LatticePoints& points, const Triangulation& triangulation, double h, const PointOptions& options) {
  const BoneClearance clearance(points, h, options);
  const Delaunay& delaunay = triangulation.delaunay;
  std::vector<Vector3d> moved = points.points;
  std::vector<Delaunay::Vertex_handle> neighbours;
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    if (i % kPollEvery == 0) options.poll();
    const LatticePoints::Place& place = points.places[i];
    if (place.fixed || place.bone >= 0) continue;
    // Far from the bones a grid of one size is regular as it is.
    if (options.is_uniform(h) && clearance.distance(points.points[i]) > kRelaxReach * h) continue;
    const bool in_plane = points.is_in_plane(static_cast<int>(i));
    neighbours.clear();
    delaunay.adjacent_vertices(triangulation.handles[i], std::back_inserter(neighbours));
    Vector3d sum = Vector3d::Zero();
    double count = 0.0;
    bool on_hull = false;
    for (const Delaunay::Vertex_handle& v : neighbours) {
      if (delaunay.is_infinite(v)) {
        on_hull = true;
        continue;
      }
      // A neighbour of a vertex in the plane counts for its mirror image too.
      const double times = in_plane && !points.is_in_plane(v->info()) ? 2.0 : 1.0;
      sum += times * points.points[v->info()];
      count += times;
    }
    if (in_plane ? on_rim(points, delaunay, triangulation.handles[i]) : on_hull) continue;
    Vector3d mean = sum / count;
    if (in_plane) mean.x() = 0.0;
    const Vector3d target = 0.5 * (points.points[i] + mean);
    if (!clearance.is_too_close(target)) moved[i] = target;
  }
  points.points = std::move(moved);
}

/// Splits every missing piece of every bone once; the number of splits.
int split_missing_pieces(LatticePoints& points, const ReducedSkeleton& skeleton,
                         const Triangulation& triangulation) {
  int splits = 0;
  for (int b = 0; b < static_cast<int>(points.chains.size()); ++b) {
    std::vector<int> chain;
    const auto parameter = [&](int vertex, double at_end) {
      return points.places[vertex].fixed ? at_end : points.places[vertex].s;
    };
    const std::vector<int> old = points.chains[b];
    for (std::size_t i = 0; i < old.size(); ++i) {
      if (i > 0 && !triangulation.has_edge(old[i - 1], old[i])) {
        const double s = 0.5 * (parameter(old[i - 1], 0.0) + parameter(old[i], 1.0));
        chain.push_back(points.add(point_on_bone(skeleton, b, s), {.bone = b, .s = s, .fixed = false}));
        ++splits;
      }
      chain.push_back(old[i]);
    }
    points.chains[b] = std::move(chain);
  }
  return splits;
}

std::vector<int> unfinished_bones(const LatticePoints& points, const Triangulation& triangulation) {
  std::vector<int> bones;
  for (int b = 0; b < static_cast<int>(points.chains.size()); ++b)
    for (std::size_t i = 1; i < points.chains[b].size(); ++i)
      if (!triangulation.has_edge(points.chains[b][i - 1], points.chains[b][i])) {
        bones.push_back(b);
        break;
      }
  return bones;
}

/// Keeps every cell beyond a face that a skin triangle crosses, until none leaves the kept cells.
void keep_crossed_cells(const LatticePoints& points, Delaunay& delaunay, const SkinSamples& samples) {
  std::vector<Delaunay::Cell_handle> open;
  for (auto c = delaunay.finite_cells_begin(); c != delaunay.finite_cells_end(); ++c)
    if (c->info()) open.push_back(c);
  while (!open.empty()) {
    const Delaunay::Cell_handle cell = open.back();
    open.pop_back();
    for (int k = 0; k < 4; ++k) {
      const Delaunay::Cell_handle neighbour = cell->neighbor(k);
      if (neighbour->info() || delaunay.is_infinite(neighbour)) continue;
      const auto corner = [&](int i) { return points.points[cell->vertex((k + i) % 4)->info()]; };
      if (!samples.triangles.crosses({corner(1), corner(2), corner(3)}, 0.0)) continue;
      neighbour->info() = true;
      open.push_back(neighbour);
    }
  }
}

/// The cells that hold a sample, a piece of a skin triangle or an edge of a bone.
Tetrahedra cull(const LatticePoints& points, Triangulation& triangulation, const SkinSamples& samples,
                const Poll& poll) {
  Delaunay& delaunay = triangulation.delaunay;
  for (auto c = delaunay.all_cells_begin(); c != delaunay.all_cells_end(); ++c) c->info() = false;
  Delaunay::Cell_handle hint;
  for (std::size_t i = 0; i < samples.points.size(); ++i) {
    if (i % kPollEvery == 0) poll();
    const Vector3d& p = samples.points[i];
    hint = delaunay.locate(to_cgal(p), hint);
    if (delaunay.is_infinite(hint)) {
      // A point on the hull, as in the plane of a half, may be found outside, and beside any face of that
      // plane.
      hint = delaunay.locate(to_cgal(p + Vector3d(kOffHull, 0.0, 0.0)), hint);
      if (delaunay.is_infinite(hint)) hint = hint->neighbor(hint->index(delaunay.infinite_vertex()));
    }
    hint->info() = true;
  }
  for (const std::vector<int>& chain : points.chains)
    for (std::size_t i = 1; i < chain.size(); ++i) {
      Delaunay::Cell_handle cell;
      int a = 0, b = 0;
      if (!delaunay.is_edge(triangulation.handles[chain[i - 1]], triangulation.handles[chain[i]], cell, a, b))
        continue;
      Delaunay::Cell_circulator circulator = delaunay.incident_cells(cell, a, b), first = circulator;
      do {
        circulator->info() = true;
      } while (++circulator != first);
    }
  keep_crossed_cells(points, delaunay, samples);
  Tetrahedra cells;
  for (auto c = delaunay.finite_cells_begin(); c != delaunay.finite_cells_end(); ++c)
    if (c->info())
      cells.push_back(
          {c->vertex(0)->info(), c->vertex(1)->info(), c->vertex(2)->info(), c->vertex(3)->info()});
  return cells;
}

}  // namespace

TetrahedraResult tetrahedralise(LatticePoints& points, const ReducedSkeleton& skeleton,
                                const SkinSamples& samples, double h, const PointOptions& options) {
  TetrahedraResult result;
  // A triangulation cannot be interrupted: a second for a million cells.
  for (int round = 0; round < kRelaxRounds; ++round) relax(points, Triangulation(points.points), h, options);
  for (int round = 0; round < kSplitRounds; ++round) {
    options.poll();
    const int splits = split_missing_pieces(points, skeleton, Triangulation(points.points));
    result.splits += splits;
    if (splits == 0) break;
  }
  options.poll();
  Triangulation triangulation(points.points);
  result.unfinished = unfinished_bones(points, triangulation);
  result.cells = cull(points, triangulation, samples, options.poll);
  return result;
}

}  // namespace sinew::lattice::detail
