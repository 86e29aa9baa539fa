#include "lattice/detail/cell_sizes.h"

#include <algorithm>
#include <map>

#include "lattice/detail/segments.h"
#include "lattice/limb_copies.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// Skin that hangs on one joint with this share follows it alone: weights are painted in steps of a percent.
constexpr double kRigidShare = 0.99;
/// Cells of stiff flesh are so much larger.
constexpr double kRigidFactor = 2.0;

/// Triangles and segments (as triangles of no area) of flesh of one size.
struct Shapes {
  std::vector<Vector3d> corners;

  void add(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    corners.insert(corners.end(), {a, b, c});
  }
  SurfaceQuery query() const {
    Points points(static_cast<Eigen::Index>(corners.size()), 3);
    Triangles triangles(static_cast<Eigen::Index>(corners.size() / 3), 3);
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      points.row(i) = corners[static_cast<std::size_t>(i)].transpose();
      triangles(i / 3, i % 3) = static_cast<int>(i);
    }
    return SurfaceQuery(points, triangles);
  }
};

Vector3d closest_on_segment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const double length_squared = (b - a).squaredNorm();
  if (!(length_squared > 0.0)) return a;
  return a + std::clamp((p - a).dot(b - a) / length_squared, 0.0, 1.0) * (b - a);
}

/// Where each joint's bones end: at the joints below; where there is none, in the middle of its skin.
std::vector<std::vector<Vector3d>> bone_ends(const UnitSkin& skin, const JointTree& joints,
                                             const JointWeights& weights) {
  const int n = static_cast<int>(joints.parents.size());
  std::vector<std::vector<Vector3d>> ends(n);
  for (int j = 0; j < n; ++j) {
    const int parent = joints.parents[j];
    if (parent >= 0 && weights.subtree_area[j] > 0.0)
      ends[parent].push_back(joints.positions.row(j).transpose());
  }
  for (int j = 0; j < n; ++j) {
    if (!ends[j].empty() || weights.vertices[j].empty()) continue;
    Vector3d sum = Vector3d::Zero();
    double total = 0.0;
    for (const auto& [v, w] : weights.vertices[j]) {
      sum += w * skin.areas[v] * skin.points.row(v).transpose();
      total += w * skin.areas[v];
    }
    if (total > 0.0) ends[j].push_back(sum / total);
  }
  return ends;
}

/// Per welded point whether it moves stiffly with all skin about it: it follows one joint, `joint_of_vertex`,
/// and so do the other corners of its triangles.
std::vector<bool> rigid_vertices(const UnitSkin& skin, const std::vector<int>& stand_in,
                                 const std::vector<int>& joint_of_vertex) {
  std::vector<bool> rigid(skin.weights.size());
  for (std::size_t v = 0; v < skin.weights.size(); ++v) {
    double own = 0.0, total = 0.0;
    for (const Influence& influence : skin.weights[v]) {
      total += influence.weight;
      if (stand_in[influence.frame] == joint_of_vertex[v]) own += influence.weight;
    }
    rigid[v] = own >= kRigidShare * total && total > 0.0;
  }
  const std::vector<bool> alone = rigid;
  for (int t = 0; t < skin.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int v = skin.triangles(t, k), w = skin.triangles(t, (k + 1) % 3);
      if (joint_of_vertex[v] == joint_of_vertex[w] && alone[v] && alone[w]) continue;
      rigid[v] = rigid[w] = false;
    }
  return rigid;
}

}  // namespace

CellSizes::CellSizes(const UnitSkin& skin, const std::vector<double>& factor_of_vertex,
                     const std::vector<Flesh>& segments) {
  std::map<double, Shapes> shapes;
  // A triangle between two sizes is of the smaller.
  for (int t = 0; t < skin.triangles.rows(); ++t) {
    double factor = factor_of_vertex[skin.triangles(t, 0)];
    for (int k = 1; k < 3; ++k) factor = std::min(factor, factor_of_vertex[skin.triangles(t, k)]);
    shapes[factor].add(skin.points.row(skin.triangles(t, 0)), skin.points.row(skin.triangles(t, 1)),
                       skin.points.row(skin.triangles(t, 2)));
  }
  for (const Flesh& segment : segments) shapes[segment.factor].add(segment.a, segment.b, segment.b);
  largest_ = shapes.rbegin()->first;
  for (const auto& [factor, shape] : shapes)
    if (factor < largest_) finer_.push_back({factor, shape.query()});
}

double CellSizes::edge_at(const Vector3d& p, double h) const {
  double edge = h * largest_;
  for (const Place& place : finer_) {
    const double least = h * place.factor;
    if (least >= edge) break;
    // Farther away than this the flesh does not matter, and asking for that is cheaper.
    if (place.flesh.is_within(p, (edge - least) / kGrowth))
      edge = std::min(edge, least + kGrowth * place.flesh.closest(p).distance);
  }
  return edge;
}

std::vector<int> idle_sizes(const JointWeights& weights, const BuildOptions& options) {
  std::vector<int> joints;
  for (const SizeFactor& size : options.size_factors)
    if (!(weights.area[size.joint] > 0.0)) joints.push_back(size.joint);
  std::sort(joints.begin(), joints.end());
  return joints;
}

CellSizes sizes_of_joints(const UnitSkin& skin, const JointTree& unit_joints, const JointWeights& weights,
                          const std::vector<int>& stand_in, const BuildOptions& options) {
  const bool coarsen = options.coarsen_rigid == CoarsenRigid::On;
  if (options.size_factors.empty() && !coarsen) return {};
  const int n = static_cast<int>(unit_joints.parents.size());
  std::vector<double> factor(n, 1.0);
  for (const SizeFactor& size : options.size_factors) factor[size.joint] = size.factor;
  const auto position = [&](int joint) -> Vector3d { return unit_joints.positions.row(joint).transpose(); };
  const std::vector<std::vector<Vector3d>> ends = bone_ends(skin, unit_joints, weights);
  std::vector<int> joint_of_vertex;
  for (const std::vector<Influence>& influences : skin.weights)
    joint_of_vertex.push_back(skin_frame(influences, stand_in));
  const std::vector<bool> rigid = coarsen ? rigid_vertices(skin, stand_in, joint_of_vertex)
                                          : std::vector<bool>(skin.weights.size(), false);

  std::vector<CellSizes::Flesh> segments;
  for (int j = 0; j < n; ++j) {
    if (!(weights.area[j] > 0.0)) continue;
    // Where flesh is stiff the ends of its bones still are joints about which it turns.
    if (coarsen) segments.push_back({factor[j], position(j), position(j)});
    for (const Vector3d& end : ends[j])
      segments.push_back({coarsen ? kRigidFactor * factor[j] : factor[j], position(j), end});
  }
  std::vector<double> factor_of_vertex(skin.weights.size(), 1.0);
  for (std::size_t v = 0; v < skin.weights.size(); ++v) {
    const int joint = joint_of_vertex[v];
    if (joint < 0) continue;
    factor_of_vertex[v] = rigid[v] ? kRigidFactor * factor[joint] : factor[joint];
    // What lies between the skin and its bone: a straight line to the nearest.
    const Vector3d p = skin.points.row(static_cast<Eigen::Index>(v)).transpose();
    Vector3d nearest = position(joint);
    for (const Vector3d& end : ends[joint]) {
      const Vector3d q = closest_on_segment(p, position(joint), end);
      if ((q - p).squaredNorm() < (nearest - p).squaredNorm()) nearest = q;
    }
    segments.push_back({factor_of_vertex[v], p, nearest});
  }
  return CellSizes(skin, factor_of_vertex, segments);
}

}  // namespace sinew::lattice::detail
