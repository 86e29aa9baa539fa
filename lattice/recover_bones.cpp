#include "lattice/recover_bones.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "lattice/detail/finish.h"
#include "lattice/detail/inspection.h"
#include "lattice/detail/rig_input.h"
#include "lattice/detail/segments.h"

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

}  // namespace

ControlLattice recover_bones(const CellComplex& complex, const Surface& skin, const JointTree& joints) {
  const RigInput input = make_rig_input(skin, joints);
  ControlLattice lattice;
  lattice.complex = complex;
  validate(lattice);
  if (complex.cells.empty()) throw std::invalid_argument("lattice: there is no cell");
  const Neighbours neighbours = vertex_neighbours(complex);
  lattice.edge_length = mean_edge_length(complex, neighbours);
  const ReducedSkeleton skeleton = reduce_skeleton(input.unit_skin, input.unit_joints, input.weights,
                                                   lattice.edge_length / input.unit_skin.scale, {});
  lattice.changes = skeleton.changes;
  lattice.bones = lattice_bones(input, skeleton);
  std::vector<std::vector<double>> parameters;
  for (LatticeBone& bone : lattice.bones) {
    Chain chain;
    if (!bone.soft)
      chain = find_chain(complex, neighbours, bone.rest_start, bone.rest_end,
                         kRecoverTolerance * input.unit_skin.scale);
    if (!bone.soft && chain.vertices.empty()) {
      lattice.changes.push_back({joints.names[bone.frame], "soft",
                                 fmt::format("bone '{}' is no chain of edges of the lattice within {:.3g} m",
                                             bone.name, kRecoverTolerance * input.unit_skin.scale)});
      bone.soft = true;
    }
    bone.chain = chain.vertices;
    parameters.push_back(chain.s);
  }
  place_chains(lattice, parameters);
  hang_joints(input, skeleton, lattice);
  lattice.quality = inspect(lattice, skin, input.unit_skin).quality;
  return lattice;
}

}  // namespace sinew::lattice
