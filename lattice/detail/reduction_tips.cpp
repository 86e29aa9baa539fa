// What holds skin whose joints own no bone: tip bones, else soft frames.
#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "lattice/detail/reduction.h"
#include "lattice/detail/segments.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// A joint needs this share of the skin's area for a frame of its own; below, its parent's frame serves it.
constexpr double kOwnFrame = 1e-4;
/// A tip bone reaches this share of the way from its joint to its farthest vertex.
constexpr double kTipReach = 0.8;
/// A tip bone of a contracted joint must be this long, in units of h: five fingers contracted into a hand
/// shall not become five bones out of one point.
constexpr double kContractedTip = 1.0;

}  // namespace

/// True where a bone from a (at `node`) to b would come too close to another one for both to be edges.
bool Reduction::conflicts(const Vector3d& a, const Vector3d& b, int node) const {
  const double cosine = std::cos(options_.chain_degrees * std::numbers::pi / 180.0);
  const double limit = options_.too_close * h_at(b);
  const Vector3d direction = (b - a).normalized();
  for (const ReducedBone& bone : result_.bones) {
    if (bone.soft) continue;
    double distance = 0.0;
    if (bone.start == node || bone.end == node) {
      const Vector3d other = bone.start == node ? end(bone) : start(bone);
      distance = std::min(point_segment_distance(b, a, other), point_segment_distance(other, a, b));
      if ((other - a).normalized().dot(direction) < cosine && distance > limit) continue;
    } else {
      distance = segment_segment_distance(a, b, start(bone), end(bone));
      if (distance > limit) continue;
    }
    return true;
  }
  return false;
}

bool Reduction::add_tip(int joint, double smallest, const std::vector<double>& vertex_weight) {
  if (options_.tip_bones == TipBones::Off) return false;
  const int node = node_of_[joint];
  const Vector3d from = result_.nodes[node].position;
  const double h = h_at(from);
  Vector3d centroid = Vector3d::Zero();
  double area = 0.0;
  for (std::size_t v = 0; v < vertex_weight.size(); ++v) {
    const double w = vertex_weight[v] * skin_.areas[v];
    centroid += w * skin_.points.row(static_cast<Eigen::Index>(v)).transpose();
    area += w;
  }
  if (!(area > 0.0)) return false;
  Vector3d toward = centroid / area - from;
  const bool in_plane = mirror_joint_ != nullptr && (*mirror_joint_)[joint] == joint;
  if (in_plane) toward.x() = 0.0;
  if (toward.norm() < 0.05 * h) return false;  // no direction to speak of
  const Vector3d direction = toward.normalized();
  double reach = 0.0;
  for (std::size_t v = 0; v < vertex_weight.size(); ++v)
    if (vertex_weight[v] >= 0.5)
      reach =
          std::max(reach, (skin_.points.row(static_cast<Eigen::Index>(v)).transpose() - from).dot(direction));
  double tip_length = kTipReach * reach;
  const auto is_inside = [&](double l) {
    int inside = 0;
    for (int i = 1; i <= 4; ++i) inside += skin_.is_inside(from + direction * (l * i / 4.0));
    return inside >= 3 && skin_.is_inside(from + direction * l);
  };
  while (tip_length >= smallest * h && !is_inside(tip_length)) tip_length *= 0.9;
  if (tip_length < smallest * h) return false;
  const Vector3d tip = from + tip_length * direction;
  if (conflicts(from, tip, node)) return false;
  if (mirror_joint_ != nullptr && is_close_to_image(from, tip)) return false;

  ReducedBone bone;
  bone.frame = joint;
  bone.start = node;
  bone.end = static_cast<int>(result_.nodes.size());
  bone.tip = true;
  result_.nodes.push_back({joint, tip});
  result_.bones.push_back(bone);
  report(joint, "tip",
         fmt::format("carries skin but no bone of its own: a bone of {:.3g} m toward that skin was added",
                     metres(tip_length)));
  return true;
}

/// A place for a soft frame: the centroid of its skin, or the joint, whichever is inside; else the vertex of
/// greatest weight.
Vector3d Reduction::soft_position(int joint, const std::vector<double>& vertex_weight) const {
  Vector3d centroid = Vector3d::Zero();
  double area = 0.0;
  std::size_t heaviest = 0;
  for (std::size_t v = 0; v < vertex_weight.size(); ++v) {
    const double w = vertex_weight[v] * skin_.areas[v];
    centroid += w * skin_.points.row(static_cast<Eigen::Index>(v)).transpose();
    area += w;
    if (vertex_weight[v] > vertex_weight[heaviest]) heaviest = v;
  }
  if (area > 0.0 && skin_.is_inside(centroid / area)) return centroid / area;
  if (skin_.is_inside(position(joint))) return position(joint);
  return skin_.points.row(static_cast<Eigen::Index>(heaviest)).transpose();
}

/// Weighted joints that own no bone, leaves first: a tip bone, else a soft frame, else (contracted joints)
/// their weight counts for the parent.
void Reduction::add_tips() {
  std::vector<bool> owns(n_, false);
  for (const ReducedBone& bone : result_.bones) owns[bone.frame] = true;
  std::vector<std::vector<int>> served(n_);  // joints whose weight counts for this one
  for (int j = n_ - 1; j >= 0; --j) {
    if (!kept_[j]) continue;
    served[j].push_back(j);
    if (owns[j]) continue;
    double area = 0.0;
    for (int s : served[j]) area += weights_.area[s];
    const bool is_anchor = result_.nodes[node_of_[j]].joint == j;
    // The frame is the joint that carries the skin: a weightless joint at the same place (a control that
    // scales or turns what is below it) may move otherwise.
    int carrier = j;
    for (int s : served[j])
      if (node_of_[s] == node_of_[j] && weights_.area[s] > weights_.area[carrier]) carrier = s;
    if (weights_.area[j] > 0.0) carrier = j;
    if (area > kOwnFrame * total_area_) {
      std::vector<double> vertex_weight(skin_.points.rows(), 0.0);
      for (int s : served[j])
        for (const auto& [v, w] : weights_.vertices[s]) vertex_weight[v] += w;
      if (add_tip(carrier,
                  is_anchor ? options_.smallest_bone : std::max(options_.smallest_bone, kContractedTip),
                  vertex_weight)) {
        continue;
      }
      if (is_anchor) {
        SoftFrame frame;
        frame.frame = carrier;
        frame.position = soft_position(j, vertex_weight);
        if (mirror_joint_ != nullptr && (*mirror_joint_)[carrier] == carrier) frame.position.x() = 0.0;
        result_.soft_frames.push_back(frame);
        report(carrier, "soft frame",
               fmt::format("carries {:.2g} % of the skin but {}", 100.0 * area / total_area_,
                           options_.tip_bones == TipBones::On ? "has no room for a bone"
                                                              : "has no bone, and tip bones are off"));
        continue;
      }
    }
    const int parent = joints_.parents[j];
    if (parent >= 0 && kept_[parent])
      served[parent].insert(served[parent].end(), served[j].begin(), served[j].end());
  }
}

}  // namespace sinew::lattice::detail
