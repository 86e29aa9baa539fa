#include "lattice/recover_bones.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "lattice/detail/cell_locator.h"
#include "lattice/detail/finish.h"
#include "lattice/detail/inspection.h"
#include "lattice/detail/rig_input.h"
#include "lattice/detail/segments.h"
#include "lattice/surface_query.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;
using namespace detail;

using Neighbours = std::vector<std::vector<int>>;

/// Per vertex the other ends of its edges, ascending.
Neighbours vertex_neighbours(const CellComplex& complex) {
  Neighbours result(complex.points.rows());
  for (const Cell& cell : complex.cells)
    for (const std::array<int, 2>& e : cell_edges(cell.type)) {
      result[cell.vertices[e[0]]].push_back(cell.vertices[e[1]]);
      result[cell.vertices[e[1]]].push_back(cell.vertices[e[0]]);
    }
  for (std::vector<int>& list : result) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return result;
}

double mean_edge_length(const CellComplex& complex, const Neighbours& neighbours) {
  double sum = 0.0;
  int count = 0;
  for (std::size_t v = 0; v < neighbours.size(); ++v)
    for (int u : neighbours[v]) {
      sum += (complex.points.row(u) - complex.points.row(static_cast<Eigen::Index>(v))).norm();
      ++count;
    }
  return sum / count;
}

struct Chain {
  std::vector<int> vertices;  ///< empty where there is none.
  std::vector<double> s;      ///< parameter of each.
};

/// Walks from the vertex at `a` along edges on the segment to the vertex at `b`, always to the nearest next
/// one.
Chain find_chain(const CellComplex& complex, const Neighbours& neighbours, const Vector3d& a,
                 const Vector3d& b, double tolerance) {
  const auto point = [&](int v) -> Vector3d { return complex.points.row(v).transpose(); };
  const auto nearest = [&](const Vector3d& p) {
    Eigen::Index v = 0;
    const double distance_squared =
        (complex.points.rowwise() - p.transpose()).rowwise().squaredNorm().minCoeff(&v);
    const bool usable = distance_squared <= tolerance * tolerance && !neighbours[v].empty();
    return usable ? static_cast<int>(v) : -1;
  };
  const int first = nearest(a), last = nearest(b);
  if (first < 0 || last < 0 || first == last) return {};
  const double length_squared = (b - a).squaredNorm();
  Chain chain{{first}, {0.0}};
  while (chain.vertices.back() != last) {
    int next = -1;
    double next_s = std::numeric_limits<double>::infinity();
    for (int v : neighbours[chain.vertices.back()]) {
      const double s = v == last ? 1.0 : (point(v) - a).dot(b - a) / length_squared;
      if (s <= chain.s.back() || s >= next_s || point_segment_distance(point(v), a, b) > tolerance) continue;
      next = v;
      next_s = s;
    }
    if (next < 0) return {};
    chain.vertices.push_back(next);
    chain.s.push_back(next_s);
  }
  return chain;
}

/// The triangles of faces that one cell alone has, quadrilaterals split about their mean.
struct Boundary {
  Points points;
  Triangles triangles;
};

Boundary boundary_surface(const CellComplex& complex) {
  const std::vector<TriangleCorners> corners = boundary_triangles(complex);
  Boundary out;
  out.points.resize(static_cast<Eigen::Index>(3 * corners.size()), 3);
  out.triangles.resize(static_cast<Eigen::Index>(corners.size()), 3);
  for (std::size_t t = 0; t < corners.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const auto row = static_cast<Eigen::Index>(3 * t) + k;
      out.points.row(row) = corners[t][k].transpose();
      out.triangles(static_cast<Eigen::Index>(t), k) = static_cast<int>(row);
    }
  return out;
}

/// The edge that comes nearest to being a piece of the bone: the distance counts its farther end, and edges
/// that run across the bone or beyond its ends do not compete while there are others.
struct NearestEdge {
  int a = -1, b = -1;
  double distance = std::numeric_limits<double>::infinity();
};

NearestEdge nearest_edge(const CellComplex& complex, const Neighbours& neighbours, const LatticeBone& bone) {
  const auto point = [&](int v) -> Vector3d { return complex.points.row(v).transpose(); };
  const Vector3d along = (bone.rest_end - bone.rest_start).normalized();
  NearestEdge aligned, any;
  for (int a = 0; a < static_cast<int>(neighbours.size()); ++a)
    for (int b : neighbours[a]) {
      if (b < a) continue;
      const double distance = std::max(point_segment_distance(point(a), bone.rest_start, bone.rest_end),
                                       point_segment_distance(point(b), bone.rest_start, bone.rest_end));
      if (distance < any.distance) any = {a, b, distance};
      const bool is_aligned = std::abs((point(b) - point(a)).normalized().dot(along)) > 0.7;  // 45 degrees
      if (is_aligned && distance < aligned.distance) aligned = {a, b, distance};
    }
  return aligned.a >= 0 ? aligned : any;
}

/// One line: the first bone without a chain, and the names of the others.
std::string missing_chains(const CellComplex& complex, const Neighbours& neighbours,
                           const std::vector<const LatticeBone*>& missing, double tolerance,
                           const Numbering& numbering) {
  const LatticeBone& first = *missing.front();
  const NearestEdge edge = nearest_edge(complex, neighbours, first);
  std::string line = fmt::format(
      "bone '{}': is no chain of edges: the nearest edge, from vertex {} to {}, lies {:.3g} m from it, "
      "expected "
      "at most {:.3g} m",
      first.name, numbering.vertex(static_cast<std::size_t>(edge.a)),
      numbering.vertex(static_cast<std::size_t>(edge.b)), edge.distance, tolerance);
  constexpr std::size_t kShown = 20;
  for (std::size_t i = 1; i < std::min(missing.size(), kShown); ++i)
    line += fmt::format("{}'{}'", i == 1 ? fmt::format(" ({} such bones more: ", missing.size() - 1) : ", ",
                        missing[i]->name);
  if (missing.size() > kShown) line += fmt::format(", ... and {} more", missing.size() - kShown);
  if (missing.size() > 1) line += ')';
  return line +
         "; hint: mesh with the bones as edges, allow more with `snap_tolerance`, or hold such bones by "
         "penalty with `soft_bones`";
}

}  // namespace

void RecoverOptions::validate() const {
  if (!(snap_tolerance > 0.0 && snap_tolerance <= 0.1)) {
    throw std::invalid_argument(
        fmt::format("snap_tolerance: got {}, expected a share in (0, 0.1]", snap_tolerance));
  }
}

ControlLattice recover_bones(const CellComplex& complex, const Surface& skin, const JointTree& joints,
                             const RecoverOptions& options, const Numbering& numbering) {
  options.validate();
  const RigInput input = make_rig_input(skin, joints, {.symmetry = Symmetry::Off});
  ControlLattice lattice;
  lattice.complex = complex;
  validate(lattice);
  if (complex.cells.empty()) throw std::invalid_argument("lattice: there is no cell");
  const Neighbours neighbours = vertex_neighbours(complex);
  lattice.edge_length = mean_edge_length(complex, neighbours);
  const double tolerance = options.snap_tolerance * input.unit_skin.scale;
  const ReducedSkeleton skeleton = reduce_skeleton(input.unit_skin, input.unit_joints, input.weights,
                                                   lattice.edge_length / input.unit_skin.scale, {});
  lattice.changes = skeleton.changes;
  lattice.bones = lattice_bones(input, skeleton);
  std::vector<std::vector<double>> parameters;
  std::vector<const LatticeBone*> missing;
  for (LatticeBone& bone : lattice.bones) {
    Chain chain;
    if (!bone.soft) chain = find_chain(complex, neighbours, bone.rest_start, bone.rest_end, tolerance);
    if (!bone.soft && chain.vertices.empty()) {
      missing.push_back(&bone);
      lattice.changes.push_back({joints.names[bone.frame], "soft",
                                 fmt::format("bone '{}' is no chain of edges of the lattice within {:.3g} m",
                                             bone.name, tolerance)});
      bone.soft = true;
    }
    bone.chain = chain.vertices;
    parameters.push_back(chain.s);
  }
  if (!missing.empty() && !options.soft_bones)
    throw std::invalid_argument(missing_chains(complex, neighbours, missing, tolerance, numbering));
  place_chains(lattice, parameters);
  hang_joints(input, skeleton, lattice, options.soft_bones ? FloatingParts::Tie : FloatingParts::Leave);
  if (const std::string parts = parts_without_bone(lattice, numbering); !parts.empty())
    throw std::invalid_argument(parts);
  lattice.quality = inspect(lattice, skin, input.unit_skin).quality;
  return lattice;
}

std::string skin_outside(const CellComplex& complex, const Surface& skin) {
  constexpr double kInsideSlack = 1e-9;  // as the gate's
  const CellLocator locator(complex);
  std::vector<std::int64_t> outside;
  for (Eigen::Index v = 0; v < skin.points.rows(); ++v)
    if (locator.find(skin.points.row(v).transpose(), kInsideSlack) < 0) outside.push_back(v);
  if (outside.empty()) return {};
  const Boundary boundary = boundary_surface(complex);
  const SurfaceQuery query(boundary.points, boundary.triangles);
  double farthest = -1.0;
  std::int64_t which = -1;
  for (std::int64_t v : outside) {
    const double distance = query.closest(skin.points.row(v).transpose()).distance;
    if (distance > farthest) farthest = distance, which = v;
  }
  return fmt::format(
      "{} of {} skin vertices lie outside the lattice, the farthest, {}, by {:.3g} m: {}; hint: make the "
      "lattice larger, or mind its units: metres and Y up, or the rig's with `lattice_space` file",
      outside.size(), skin.points.rows(), which, farthest, number_list(outside));
}

std::string parts_without_bone(const ControlLattice& lattice, const Numbering& numbering) {
  const std::vector<std::vector<int>> floating = floating_components(lattice);
  if (floating.empty()) return {};
  std::vector<std::int64_t> numbers;
  for (int c : floating.front()) numbers.push_back(numbering.cell(static_cast<std::size_t>(c)));
  return fmt::format(
      "cell {}: belongs to a part of {} cells that no bone reaches ({} of {} parts; its cells: {}); hint: "
      "remove "
      "the part, join it to the rest, or tie such parts to their joints with `soft_bones`",
      numbers.front(), floating.front().size(), floating.size(), components(lattice.complex).size(),
      number_list(numbers));
}

}  // namespace sinew::lattice
