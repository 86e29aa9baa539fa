#include "lattice/detail/symmetry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lattice/detail/mirror_planes.h"
#include "lattice/detail/point_finder.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// Two partners may differ by this share of the skin that hangs on them, plus kStrayWeight of the whole skin:
/// weights are painted in steps of a percent.
constexpr double kWeightShare = 0.02, kStrayWeight = 1e-3;

std::vector<MirrorPlane> candidates(const Points& points) {
  std::vector<MirrorPlane> planes;
  // The box is centred on 0, so that planes normal to the axes need no offset.
  for (const int axis : {0, 2, 1}) planes.push_back({Vector3d::Unit(axis), 0.0});
  for (const MirrorPlane& plane : principal_planes(points)) planes.push_back(plane);
  return planes;
}

/// Per joint its partner; nothing and a reason where one has none.
std::optional<std::vector<int>> match_joints(const MirrorPlane& plane, const JointTree& joints,
                                             const JointWeights& weights, std::string& why_not) {
  const int n = static_cast<int>(joints.parents.size());
  const double total = std::accumulate(weights.area.begin(), weights.area.end(), 0.0);
  std::vector<int> partner(n, -1);
  const auto position = [&](int j) -> Vector3d { return joints.positions.row(j).transpose(); };
  const auto carries = [&](int j) { return weights.subtree_area[j] > kWeightless * total; };
  for (int j = 0; j < n; ++j) {
    if (!carries(j) || partner[j] >= 0) continue;
    const int parent = joints.parents[j];
    const bool top = parent < 0 || !carries(parent);
    const Vector3d image = plane.image(position(j));
    int best = -1;
    double best_difference = std::numeric_limits<double>::infinity();
    for (int m = j; m < n; ++m) {
      if (!carries(m) || partner[m] >= 0 || (position(m) - image).norm() > kMirrorTolerance) continue;
      const int other = joints.parents[m];
      if (top ? other >= 0 && carries(other) : other != partner[parent]) continue;
      const double difference = std::abs(weights.area[m] - weights.area[j]);
      if (difference < best_difference) best = m, best_difference = difference;
      if (m == j) break;  // a joint on the plane is its own partner
    }
    if (best < 0) {
      why_not = fmt::format("joint '{}' has no mirror image", joints.names[j]);
      return std::nullopt;
    }
    if (best_difference > kWeightShare * (weights.area[j] + weights.area[best]) + kStrayWeight * total) {
      why_not = fmt::format("joints '{}' and '{}' carry different shares of the skin", joints.names[j],
                            joints.names[best]);
      return std::nullopt;
    }
    partner[j] = best;
    partner[best] = j;
    if (!top && partner[parent] != parent && plane.side(position(j)) * plane.side(position(parent)) < 0.0) {
      why_not =
          fmt::format("the bone from '{}' to '{}' crosses the plane", joints.names[parent], joints.names[j]);
      return std::nullopt;
    }
  }
  return partner;
}

}  // namespace

MirrorSearch find_mirror(const UnitSkin& skin, const JointTree& unit_joints, const JointWeights& weights) {
  const PointFinder finder(skin.points);
  MirrorSearch search;
  Eigen::Index fewest = skin.points.rows() + 1;
  for (const MirrorPlane& plane : candidates(skin.points)) {
    Eigen::Index alone = 0;
    for (Eigen::Index v = 0; v < skin.points.rows(); ++v)
      if (!finder.has_near(plane.image(skin.points.row(v).transpose()), kMirrorTolerance)) ++alone;
    std::string reason =
        fmt::format("{} of {} skin vertices have no mirror image", alone, skin.points.rows());
    if (alone == 0) {
      const auto partner = match_joints(plane, unit_joints, weights, reason);
      if (partner) return {true, {plane.normal, plane.offset, *partner}, ""};
    }
    if (alone < fewest) fewest = alone, search.why_not = reason;
  }
  return search;
}

MirrorFrame mirror_frame(const UnitSkin& skin, const RigMirror& mirror) {
  MirrorFrame frame;
  frame.origin = skin.centre + skin.scale * mirror.offset * mirror.normal;
  // Axes are permuted, not turned, where the normal is one of them: no rounding.
  for (int axis = 0; axis < 3; ++axis)
    if (mirror.normal == Vector3d::Unit(axis))
      for (int k = 0; k < 3; ++k) frame.axes.row(k) = Eigen::RowVector3d::Unit((axis + k) % 3);
  if (mirror.normal.cwiseAbs().maxCoeff() == 1.0) return frame;
  const Vector3d second = mirror.normal.unitOrthogonal();
  frame.axes << mirror.normal.transpose(), second.transpose(), mirror.normal.cross(second).transpose();
  return frame;
}

void symmetrise(const RigMirror& mirror, JointTree& joints) {
  for (int j = 0; j < static_cast<int>(joints.parents.size()); ++j) {
    const int m = mirror.joint[j];
    if (m < j && m >= 0) continue;  // done with its partner
    if (m == j) joints.positions(j, 0) = 0.0;
    if (m <= j) continue;
    const Vector3d a = joints.positions.row(j).transpose(),
                   b = reflected(joints.positions.row(m).transpose());
    const Vector3d mean = a == b ? a : Vector3d(0.5 * (a + b));
    joints.positions.row(j) = mean.transpose();
    joints.positions.row(m) = reflected(mean).transpose();
  }
}

}  // namespace sinew::lattice::detail
