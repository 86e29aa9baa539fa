#include "lattice/detail/cell_sizes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

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

/// The finest that grading makes of h: what thinner limbs still ask for would cost more cells than it gains.
constexpr double kFinest = 0.4;
/// Limbs thinner than half their cells are a sheet with their neighbours.
constexpr double kEdgesPerThickness = 2.0;
/// Joints with less than this share of the skin are details (fingers, eyes), which cells of their size would
/// spend all cells on: the first, or where that is less, the second over the number of joints with skin.
constexpr double kSmallShare = 0.01, kSmallShareOfMean = 0.3;
/// Steps per doubling in which edges are allowed: as many searches as there are steps.
constexpr double kSteps = 4.0;

/// Per joint the edge that its limb is thick enough for; infinite for details and joints without skin. A limb
/// is twice as thick as its skin is far from its bones, in the median by area; `distance` is that of each
/// vertex.
std::vector<double> allowed_edges(const UnitSkin& skin, const std::vector<int>& joint_of_vertex,
                                  const std::vector<double>& distance, int num_joints,
                                  const std::vector<int>* partner) {
  using Sample = std::pair<double, double>;  // distance, area
  std::vector<std::vector<Sample>> samples(num_joints);
  for (std::size_t v = 0; v < distance.size(); ++v) {
    const int joint = joint_of_vertex[v];
    if (joint < 0) continue;
    const Sample sample{distance[v], skin.areas[v]};
    samples[joint].push_back(sample);
    if (partner == nullptr) continue;
    // Joints in the plane count twice as well, so that shares of the area stay what they are.
    const int image = (*partner)[joint];
    samples[image >= 0 ? image : joint].push_back(sample);
  }
  std::vector<double> area(num_joints, 0.0);
  double total = 0.0, joints_with_skin = 0.0;
  for (int j = 0; j < num_joints; ++j) {
    std::sort(samples[j].begin(), samples[j].end());
    for (const Sample& sample : samples[j]) area[j] += sample.second;
    total += area[j];
    if (area[j] > 0.0) joints_with_skin += 1.0;
  }
  const double least = total * std::min(kSmallShare, kSmallShareOfMean / joints_with_skin);
  std::vector<double> allowed(num_joints, std::numeric_limits<double>::infinity());
  for (int j = 0; j < num_joints; ++j) {
    if (!(area[j] > least)) continue;
    double sum = 0.0;
    const auto median = std::find_if(samples[j].begin(), samples[j].end(), [&](const Sample& sample) {
      return (sum += sample.second) >= 0.5 * area[j];
    });
    const double edge = kEdgesPerThickness * 2.0 * median->first;
    if (edge > 0.0) allowed[j] = std::exp2(std::floor(kSteps * std::log2(edge)) / kSteps);
  }
  return allowed;
}

}  // namespace

double SizeRule::edge(double h) const {
  const double most = std::min(h, thickest);
  return factor * h * std::max(kFinest, std::min(most, allowed) / most);
}

CellSizes::CellSizes(const UnitSkin& skin, const std::vector<SizeRule>& rule_of_vertex,
                     const std::vector<Flesh>& segments) {
  std::map<SizeRule, Shapes> shapes;
  // A triangle between two sizes is of the smaller, whatever h.
  for (int t = 0; t < skin.triangles.rows(); ++t) {
    SizeRule rule = rule_of_vertex[skin.triangles(t, 0)];
    for (int k = 1; k < 3; ++k) {
      rule.factor = std::min(rule.factor, rule_of_vertex[skin.triangles(t, k)].factor);
      rule.allowed = std::min(rule.allowed, rule_of_vertex[skin.triangles(t, k)].allowed);
      rule.thickest = std::min(rule.thickest, rule_of_vertex[skin.triangles(t, k)].thickest);
    }
    shapes[rule].add(skin.points.row(skin.triangles(t, 0)), skin.points.row(skin.triangles(t, 1)),
                     skin.points.row(skin.triangles(t, 2)));
  }
  for (const Flesh& segment : segments) shapes[segment.rule].add(segment.a, segment.b, segment.b);
  for (const auto& [rule, shape] : shapes) places_.push_back({rule, shape.query()});
}

double CellSizes::smallest(double h) const {
  if (places_.empty()) return h;
  double edge = std::numeric_limits<double>::infinity();
  for (const Place& place : places_) edge = std::min(edge, place.rule.edge(h));
  return edge;
}

double CellSizes::largest(double h) const {
  if (places_.empty()) return h;
  double edge = 0.0;
  for (const Place& place : places_) edge = std::max(edge, place.rule.edge(h));
  return edge;
}

double CellSizes::edge_at(const Vector3d& p, double h) const {
  double edge = largest(h);
  for (const Place& place : places_) {
    const double least = place.rule.edge(h);
    if (least >= edge) continue;
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
                          const std::vector<int>& stand_in, const BuildOptions& options,
                          const std::vector<int>* partner) {
  const bool coarsen = options.coarsen_rigid == CoarsenRigid::On;
  const bool grade = options.grade == Grade::On;
  if (options.size_factors.empty() && !coarsen && !grade) return {};
  const int n = static_cast<int>(unit_joints.parents.size());
  const auto position = [&](int joint) -> Vector3d { return unit_joints.positions.row(joint).transpose(); };
  const std::vector<std::vector<Vector3d>> ends = bone_ends(skin, unit_joints, weights);
  std::vector<bool> is_leaf(n, true);
  for (int j = 0; j < n; ++j)
    if (unit_joints.parents[j] >= 0 && weights.subtree_area[j] > 0.0) is_leaf[unit_joints.parents[j]] = false;
  std::vector<int> joint_of_vertex;
  for (const std::vector<Influence>& influences : skin.weights)
    joint_of_vertex.push_back(skin_frame(influences, stand_in));
  // What lies between the skin and its bone: a straight line to the nearest.
  std::vector<Vector3d> foot(skin.weights.size());
  std::vector<double> distance(skin.weights.size(), 0.0);
  for (std::size_t v = 0; v < skin.weights.size(); ++v) {
    const int joint = joint_of_vertex[v];
    const Vector3d p = skin.points.row(static_cast<Eigen::Index>(v)).transpose();
    foot[v] = p;
    if (joint < 0) continue;
    foot[v] = position(joint);
    distance[v] = (p - foot[v]).norm();
    for (const Vector3d& end : ends[joint]) {
      const Vector3d q = closest_on_segment(p, position(joint), end);
      if ((q - p).squaredNorm() < (foot[v] - p).squaredNorm()) foot[v] = q;
      // A bone that ends in the middle of its skin would go on to the far end.
      const Vector3d far = is_leaf[joint] ? Vector3d(2.0 * end - position(joint)) : end;
      distance[v] = std::min(distance[v], (closest_on_segment(p, position(joint), far) - p).norm());
    }
  }
  std::vector<SizeRule> rule(n);
  if (grade) {
    const std::vector<double> allowed = allowed_edges(skin, joint_of_vertex, distance, n, partner);
    double thickest = 0.0;
    for (const double edge : allowed)
      if (edge < SizeRule::kAny) thickest = std::max(thickest, edge);
    if (thickest > 0.0)
      for (int j = 0; j < n; ++j) rule[j] = {1.0, allowed[j], thickest};
  }
  for (const SizeFactor& size : options.size_factors) rule[size.joint] = {.factor = size.factor};
  const auto stiff = [](SizeRule r) { return SizeRule{kRigidFactor * r.factor, r.allowed, r.thickest}; };
  const std::vector<bool> rigid = coarsen ? rigid_vertices(skin, stand_in, joint_of_vertex)
                                          : std::vector<bool>(skin.weights.size(), false);

  std::vector<CellSizes::Flesh> segments;
  for (int j = 0; j < n; ++j) {
    if (!(weights.area[j] > 0.0)) continue;
    // Where flesh is stiff the ends of its bones still are joints about which it turns.
    if (coarsen) segments.push_back({rule[j], position(j), position(j)});
    for (const Vector3d& end : ends[j])
      segments.push_back({coarsen ? stiff(rule[j]) : rule[j], position(j), end});
  }
  std::vector<SizeRule> rule_of_vertex(skin.weights.size());
  for (std::size_t v = 0; v < skin.weights.size(); ++v) {
    const int joint = joint_of_vertex[v];
    if (joint < 0) continue;
    rule_of_vertex[v] = rigid[v] ? stiff(rule[joint]) : rule[joint];
    segments.push_back(
        {rule_of_vertex[v], skin.points.row(static_cast<Eigen::Index>(v)).transpose(), foot[v]});
  }
  return CellSizes(skin, rule_of_vertex, segments);
}

}  // namespace sinew::lattice::detail
