#include "tools/make_samples/skin_mesh.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>

#include "tools/make_samples/exact_math.h"

namespace sinew::samples {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;
using Quad = std::array<int, 4>;

/// Values of a solid at the nodes of a grid that is symmetric in x = 0.
class Grid {
 public:
  Grid(const Solid& solid, const PolygoniseOptions& options) : spacing_(options.spacing) {
    half_width_ = static_cast<int>(std::ceil(std::max(options.high.x(), -options.low.x()) / spacing_));
    cells_.x() = 2 * half_width_;
    low_ = options.low;
    for (int c = 1; c < 3; ++c)
      cells_[c] = static_cast<int>(std::ceil((options.high[c] - options.low[c]) / spacing_));
    for (int k = 0; k <= cells_.z(); ++k)
      for (int j = 0; j <= cells_.y(); ++j)
        for (int i = 0; i <= cells_.x(); ++i) values_.push_back(solid(position({i, j, k})));
  }
  const Vector3i& cells() const { return cells_; }
  Vector3d position(const Vector3i& n) const {
    return {(n.x() - half_width_) * spacing_, low_.y() + n.y() * spacing_, low_.z() + n.z() * spacing_};
  }
  double value(const Vector3i& n) const {
    return values_[static_cast<std::size_t>((n.z() * (cells_.y() + 1) + n.y()) * (cells_.x() + 1) + n.x())];
  }
  bool inside(const Vector3i& n) const { return value(n) < 0.0; }
  int cell_index(const Vector3i& c) const { return (c.z() * cells_.y() + c.y()) * cells_.x() + c.x(); }

 private:
  double spacing_;
  int half_width_;
  Vector3i cells_;
  Vector3d low_;
  std::vector<double> values_;
};

/// Mean of the points where the surface crosses the cell's edges; false where it crosses none.
bool cell_vertex(const Grid& grid, const Vector3i& cell, Vector3d& vertex) {
  Vector3d sum = Vector3d::Zero();
  int crossings = 0;
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 4; ++side) {
      Vector3i a = cell;
      a[(axis + 1) % 3] += side & 1;
      a[(axis + 2) % 3] += side >> 1;
      const Vector3i b = a + Vector3i::Unit(axis);
      if (grid.inside(a) == grid.inside(b)) continue;
      const double s = grid.value(a) / (grid.value(a) - grid.value(b));
      sum += grid.position(a) + s * (grid.position(b) - grid.position(a));
      ++crossings;
    }
  }
  if (crossings == 0) return false;
  vertex = sum / crossings;
  return true;
}

struct QuadNet {
  std::vector<Vector3d> points;
  std::vector<Quad> quads;
  std::vector<int> mirror;
};

void add_quads(const Grid& grid, const std::vector<int>& vertex_of_cell, QuadNet& net) {
  const Vector3i n = grid.cells();
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3i u = Vector3i::Unit((axis + 1) % 3), v = Vector3i::Unit((axis + 2) % 3);
    for (int k = 1; k < n.z(); ++k) {
      for (int j = 1; j < n.y(); ++j) {
        for (int i = 1; i < n.x(); ++i) {
          const Vector3i a(i, j, k), b = a + Vector3i::Unit(axis);
          if (grid.inside(a) == grid.inside(b)) continue;
          Quad quad = {grid.cell_index(a - u - v), grid.cell_index(a - v), grid.cell_index(a),
                       grid.cell_index(a - u)};
          for (int& corner : quad) corner = vertex_of_cell[static_cast<std::size_t>(corner)];
          if (!grid.inside(a)) std::reverse(quad.begin(), quad.end());
          net.quads.push_back(quad);
        }
      }
    }
  }
}

QuadNet surface_net(const Grid& grid) {
  QuadNet net;
  const Vector3i n = grid.cells();
  std::vector<int> vertex_of_cell(static_cast<std::size_t>(n.prod()), -1);
  std::vector<Vector3i> cell_of_vertex;
  for (int k = 0; k < n.z(); ++k) {
    for (int j = 0; j < n.y(); ++j) {
      for (int i = 0; i < n.x(); ++i) {
        Vector3d vertex;
        if (!cell_vertex(grid, {i, j, k}, vertex)) continue;
        vertex_of_cell[static_cast<std::size_t>(grid.cell_index({i, j, k}))] =
            static_cast<int>(net.points.size());
        net.points.push_back(vertex);
        cell_of_vertex.push_back({i, j, k});
      }
    }
  }
  for (const Vector3i& cell : cell_of_vertex)
    net.mirror.push_back(vertex_of_cell[static_cast<std::size_t>(
        grid.cell_index({n.x() - 1 - cell.x(), cell.y(), cell.z()}))]);
  if (std::count(net.mirror.begin(), net.mirror.end(), -1) > 0)
    throw std::invalid_argument("the solid is not symmetric in x = 0");
  add_quads(grid, vertex_of_cell, net);
  return net;
}

/// Rounds of Laplacian smoothing, each followed by a projection back to the solid. The side x > 0 is
/// computed, the other copied, so that the symmetry is exact.
void relax(const Solid& solid, int rounds, QuadNet& net) {
  std::vector<std::set<int>> neighbours(net.points.size());
  for (const Quad& quad : net.quads) {
    for (std::size_t c = 0; c < 4; ++c) {
      neighbours[static_cast<std::size_t>(quad[c])].insert(quad[(c + 1) % 4]);
      neighbours[static_cast<std::size_t>(quad[(c + 1) % 4])].insert(quad[c]);
    }
  }
  for (int round = 0; round <= rounds; ++round) {
    const std::vector<Vector3d> old = net.points;
    for (std::size_t v = 0; v < old.size(); ++v) {
      if (old[v].x() <= 0.0) continue;
      Vector3d p = old[v];
      if (round < rounds) {
        p = Vector3d::Zero();
        for (const int w : neighbours[v]) p += old[static_cast<std::size_t>(w)];
        p /= static_cast<double>(neighbours[v].size());
      }
      p = projected(solid, p);
      net.points[v] = p;
      net.points[static_cast<std::size_t>(net.mirror[v])] = Vector3d(-p.x(), p.y(), p.z());
    }
  }
}

/// Quads may share two opposite corners: no diagonal may run where an edge or another diagonal is.
lattice::Triangles split(const QuadNet& net, const lattice::Points& points) {
  std::set<std::pair<int, int>> edges;
  for (const Quad& quad : net.quads)
    for (std::size_t c = 0; c < 4; ++c) edges.insert(std::minmax({quad[c], quad[(c + 1) % 4]}));
  lattice::Triangles triangles(2 * static_cast<Eigen::Index>(net.quads.size()), 3);
  for (std::size_t q = 0; q < net.quads.size(); ++q) {
    const int a = net.quads[q][0], b = net.quads[q][1], c = net.quads[q][2], d = net.quads[q][3];
    bool diagonal_ac =
        (points.row(a) - points.row(c)).squaredNorm() <= (points.row(b) - points.row(d)).squaredNorm();
    const auto diagonal = [&] { return diagonal_ac ? std::minmax({a, c}) : std::minmax({b, d}); };
    if (!edges.insert(diagonal()).second) {
      diagonal_ac = !diagonal_ac;
      edges.insert(diagonal());
    }
    const auto row = 2 * static_cast<Eigen::Index>(q);
    if (diagonal_ac) {
      triangles.row(row) << a, b, c;
      triangles.row(row + 1) << a, c, d;
    } else {
      triangles.row(row) << a, b, d;
      triangles.row(row + 1) << b, c, d;
    }
  }
  return triangles;
}

struct Nearest {
  int joint;
  double distance;  ///< to the bone's axis [m].
};

/// The bone whose flesh reaches closest to p.
Nearest nearest_bone(const std::vector<WeightBone>& bones, const Vector3d& p) {
  Nearest nearest{-1, 0.0};
  double least = std::numeric_limits<double>::infinity();
  for (const WeightBone& bone : bones) {
    const Vector3d axis = bone.end - bone.start;
    const double s = std::clamp((p - bone.start).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
    const double distance = (p - bone.start - s * axis).norm();
    const double depth = distance - (bone.radius_start + s * (bone.radius_end - bone.radius_start));
    if (depth < least) {
      least = depth;
      nearest = {bone.joint, distance};
    }
  }
  return nearest;
}

/// Heat of every joint at every vertex, num_vertices x num_joints: (L + H) w = H p with L the graph
/// Laplacian.
Eigen::MatrixXd heat_equilibrium(const SkinMesh& mesh, const std::vector<WeightBone>& bones,
                                 std::size_t num_joints) {
  const Eigen::Index n = mesh.points.rows();
  std::vector<Eigen::Triplet<double>> entries;
  double squared_edges = 0.0;
  for (Eigen::Index t = 0; t < mesh.triangles.rows(); ++t) {
    for (int c = 0; c < 3; ++c) {
      const int a = mesh.triangles(t, c), b = mesh.triangles(t, (c + 1) % 3);
      squared_edges += (mesh.points.row(a) - mesh.points.row(b)).squaredNorm();
      entries.emplace_back(a, b, -1.0);  // the neighbouring triangle adds (b, a)
      entries.emplace_back(a, a, 1.0);
    }
  }
  // How tightly the flesh follows its own bone: 1 in the paper; more keeps legs from pulling at each other.
  constexpr double kGrip = 4.0;
  // On a regular triangulation the sum over six neighbours is 3/2 edge^2 times the Laplace operator.
  const double edge_squared = squared_edges / static_cast<double>(mesh.triangles.size());
  Eigen::MatrixXd heat = Eigen::MatrixXd::Zero(n, static_cast<Eigen::Index>(num_joints));
  for (Eigen::Index v = 0; v < n; ++v) {
    const Nearest nearest = nearest_bone(bones, mesh.points.row(v).transpose());
    const double strength = kGrip * 1.5 * edge_squared / (nearest.distance * nearest.distance);
    entries.emplace_back(v, v, strength);
    heat(v, nearest.joint) = strength;
  }
  Eigen::SparseMatrix<double> matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(matrix).solve(heat);
}

}  // namespace

SkinMesh polygonise(const Solid& solid, const PolygoniseOptions& options) {
  QuadNet net = surface_net(Grid(solid, options));
  relax(solid, options.relaxations, net);
  SkinMesh mesh;
  mesh.points.resize(static_cast<Eigen::Index>(net.points.size()), 3);
  for (std::size_t v = 0; v < net.points.size(); ++v)
    mesh.points.row(static_cast<Eigen::Index>(v)) = to_grid(net.points[v]).transpose();
  mesh.triangles = split(net, mesh.points);
  mesh.mirror = net.mirror;
  return mesh;
}

lattice::Points vertex_normals(const lattice::Points& points, const lattice::Triangles& triangles) {
  lattice::Points normals = lattice::Points::Zero(points.rows(), 3);
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Vector3d a = points.row(triangles(t, 0)), b = points.row(triangles(t, 1)),
                   c = points.row(triangles(t, 2));
    const Vector3d area = (b - a).cross(c - a);
    for (int k = 0; k < 3; ++k) normals.row(triangles(t, k)) += area.transpose();
  }
  for (Eigen::Index v = 0; v < normals.rows(); ++v) {
    const Vector3d unit = Vector3d(normals.row(v)).normalized();
    normals.row(v) = to_grid(unit).transpose();
  }
  return normals;
}

std::vector<std::vector<lattice::Influence>> heat_weights(const SkinMesh& mesh,
                                                          const std::vector<WeightBone>& bones,
                                                          const std::vector<int>& mirror_joint) {
  constexpr double kSmallest = 0.02;  // influences of one or two per cent are noise to the eye
  constexpr std::size_t kMost = 4;
  const Eigen::MatrixXd heat = heat_equilibrium(mesh, bones, mirror_joint.size());
  std::vector<std::vector<lattice::Influence>> weights(static_cast<std::size_t>(mesh.points.rows()));
  for (std::size_t v = 0; v < weights.size(); ++v) {
    std::vector<lattice::Influence> all;
    for (std::size_t j = 0; j < mirror_joint.size(); ++j)
      all.push_back({static_cast<int>(j),
                     to_grid(0.5 * (heat(static_cast<Eigen::Index>(v), static_cast<Eigen::Index>(j)) +
                                    heat(mesh.mirror[v], mirror_joint[j])))});
    std::stable_sort(all.begin(), all.end(),
                     [](const auto& a, const auto& b) { return a.weight > b.weight; });
    // What is left over the fifth weight: dropping it outright would tear the weights where the fifth
    // changes.
    const double floor = std::max(all.size() > kMost ? all[kMost].weight : 0.0, kSmallest);
    double sum = 0.0;
    for (const auto& influence : all) {
      if (influence.weight <= floor) break;
      weights[v].push_back({influence.frame, influence.weight - floor});
      sum += weights[v].back().weight;
    }
    for (auto& influence : weights[v]) influence.weight /= sum;
  }
  return weights;
}

}  // namespace sinew::samples
