#include "assets/detail/part_copies.h"

#include <array>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "assets/detail/text.h"
#include "lattice/surface_query.h"

namespace sinew::assets::detail {

namespace {

using lattice::Influence;

/// A copy spans at least this share of the skin's diagonal; smaller parts are props.
constexpr double kCopySize = 0.6;
/// A copy's vertices lie on average within this share of the skin's diagonal from the skin. A coat of paint,
/// a smoothed version or loose clothes do; a table the character stands at does not.
constexpr double kCopyDistance = 0.05;

Eigen::AlignedBox3d box_of(const lattice::Points& points) {
  Eigen::AlignedBox3d box;
  for (Eigen::Index v = 0; v < points.rows(); ++v) box.extend(points.row(v).transpose());
  return box;
}

/// Weights at a point of a triangle: the corners' mixed by barycentric coordinates, largest eight kept.
std::vector<Influence> weights_at(const lattice::Surface& skin, int triangle, const Eigen::Vector3d& p) {
  std::array<Eigen::Vector3d, 3> corner;
  for (int c = 0; c < 3; ++c)
    corner[static_cast<std::size_t>(c)] = skin.points.row(skin.triangles(triangle, c));
  const Eigen::Vector3d normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
  const double area = normal.squaredNorm();
  Eigen::Vector3d share(1, 0, 0);
  if (area > 0.0) {
    share[1] = (p - corner[0]).cross(corner[2] - corner[0]).dot(normal) / area;
    share[2] = (corner[1] - corner[0]).cross(p - corner[0]).dot(normal) / area;
    share[0] = 1.0 - share[1] - share[2];
    share = share.cwiseMax(0.0) / share.cwiseMax(0.0).sum();
  }
  std::map<int, double> sums;
  for (int c = 0; c < 3; ++c) {
    for (const Influence& influence : skin.weights[static_cast<std::size_t>(skin.triangles(triangle, c))]) {
      sums[influence.frame] += share[c] * influence.weight;
    }
  }
  std::vector<Influence> result;
  double total = 0.0;
  for (const auto& [frame, weight] : sums) {
    // Corners that contribute nothing leave traces of rounding.
    if (weight < 1e-6) continue;
    result.push_back({frame, weight});
    total += weight;
  }
  for (Influence& influence : result) influence.weight /= total;
  return result;
}

/// Joints that carry the skin, and those below them: a part that hangs there moves with the character
/// already.
std::vector<bool> moving_joints(const Rig& rig) {
  std::vector<bool> moving(static_cast<std::size_t>(rig.skeleton.num_joints()), false);
  for (const Part& part : rig.parts) {
    for (const auto& influences : part.weights) {
      for (const Influence& influence : influences) moving[static_cast<std::size_t>(influence.frame)] = true;
    }
  }
  for (std::size_t j = 0; j < moving.size(); ++j) {
    const int parent = rig.skeleton.joint(static_cast<int>(j)).parent;
    if (parent >= 0 && moving[static_cast<std::size_t>(parent)]) moving[j] = true;
  }
  return moving;
}

}  // namespace

void bind_coincident_copies(Rig& rig) {
  const PhysicsSkin physics = physics_skin(rig);
  const lattice::Surface& skin = physics.surface;
  if (skin.triangles.rows() == 0) return;
  const Eigen::AlignedBox3d skin_box = box_of(skin.points);
  const double diagonal = skin_box.diagonal().norm();
  const std::vector<bool> moving = moving_joints(rig);
  std::unique_ptr<lattice::SurfaceQuery> query;
  for (Part& part : rig.parts) {
    if (part.role != PartRole::Rigid) continue;
    if (part.joint >= 0 && moving[static_cast<std::size_t>(part.joint)]) continue;
    const Eigen::AlignedBox3d common = box_of(part.points).intersection(skin_box);
    if (common.isEmpty() || common.diagonal().norm() < kCopySize * diagonal) continue;
    if (!query) query = std::make_unique<lattice::SurfaceQuery>(skin.points, skin.triangles);
    std::vector<std::vector<Influence>> weights;
    double mean_distance = 0.0;
    for (Eigen::Index v = 0; v < part.points.rows(); ++v) {
      const auto closest = query->closest(part.points.row(v).transpose());
      mean_distance += closest.distance / static_cast<double>(part.points.rows());
      weights.push_back(weights_at(skin, closest.triangle, closest.point));
    }
    if (mean_distance > kCopyDistance * diagonal) continue;
    part.role = PartRole::Simulated;
    part.joint = -1;
    part.weights = std::move(weights);
    rig.findings.push_back(
        {Finding::Severity::Warning, "part-follows-skin", part.name,
         "the part has no skin weights but covers the skinned body (" +
             number(100.0 * mean_distance / diagonal) +
             " % of its diagonal away on average); it was given the body's weights and moves with its flesh",
         "bind it to the skeleton yourself, or leave it out of the file if it is not meant to be seen"});
  }
}

}  // namespace sinew::assets::detail
