#include "lattice/detail/skeleton_reduction.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lattice/detail/reduction.h"
#include "lattice/detail/segments.h"
#include "lattice/detail/symmetry.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// A chained bone may turn by so many degrees where it goes on.
constexpr double kSharpestChain = 60.0;

}  // namespace

ReducedSkeleton Reduction::run() {
  prune();
  place_nodes();
  chain_siblings();
  soften_close_bones();
  if (mirror_joint_ != nullptr) soften_bones_at_their_image();
  add_tips();
  soften_wanted_bones();
  drop_unused_nodes();
  if (mirror_joint_ != nullptr) add_mirror_images();
  name_bones();
  return std::move(result_);
}

/// Drops subtrees without skin weight, and weightless joints above the weighted skeleton that do not branch.
void Reduction::prune() {
  kept_.assign(n_, true);
  const double limit = kWeightless * total_area_;
  for (int j = 0; j < n_; ++j) {
    if (weights_.subtree_area[j] > limit) continue;
    kept_[j] = false;
    const int parent = joints_.parents[j];
    if (weights_.excluded[j]) {
      report(j, "excluded", "the options leave it out; what hung on it hangs on the joint above");
    } else if (parent < 0 || kept_[parent]) {
      report(j, "pruned", "no skin weight on it or below it");
    }
  }
  std::vector<int> num_children(n_, 0);
  for (int j = 0; j < n_; ++j)
    if (kept_[j] && joints_.parents[j] >= 0) ++num_children[joints_.parents[j]];
  for (int j = 0; j < n_; ++j) {
    const bool top = joints_.parents[j] < 0 || !kept_[joints_.parents[j]];
    if (!kept_[j] || !top || weights_.area[j] > limit || num_children[j] != 1) continue;
    kept_[j] = false;
    report(j, "pruned", "no skin weight on it and only one joint below it");
  }
  // Of a mirrored rig the other half follows from this one.
  for (int j = 0; j < n_; ++j)
    if (mirror_joint_ != nullptr && kept_[j] && position(j).x() < 0.0) kept_[j] = false;
}

bool Reduction::is_cut(int parent, int child, std::string& reason) const {
  const Vector3d a = position(parent), b = position(child);
  const double bone_length = (b - a).norm(), h = h_at(b);
  if (bone_length < options_.cut_length * h) return false;
  const int n = std::clamp(static_cast<int>(std::ceil(bone_length / (h / 8.0))), 8, 64);
  int outside = 0;
  double farthest = 0.0;
  for (int i = 0; i < n; ++i) {
    const Vector3d p = a + (b - a) * ((i + 0.5) / n);
    if (skin_.is_inside(p)) continue;
    ++outside;
    farthest = std::max(farthest, skin_.query.closest(p).distance);
  }
  if (2 * outside <= n || farthest <= options_.cut_distance * h) return false;
  reason = fmt::format("{:.0f} % of the bone from '{}' lies outside the skin, up to {:.3g} m away",
                       100.0 * outside / n, joints_.names[parent], metres(farthest));
  return true;
}

/// Nodes and bones from the top down: cut, weld and contract.
void Reduction::place_nodes() {
  node_of_.assign(n_, -1);
  const auto new_node = [&](int joint) {
    node_of_[joint] = static_cast<int>(result_.nodes.size());
    result_.nodes.push_back({joint, position(joint)});
  };
  for (int j = 0; j < n_; ++j) {
    if (!kept_[j]) continue;
    const int parent = joints_.parents[j];
    if (parent < 0 || !kept_[parent]) {
      new_node(j);
      continue;
    }
    std::string reason;
    if (is_cut(parent, j, reason)) {
      new_node(j);
      report(j, "cut", reason);
      continue;
    }
    const SkeletonNode from = result_.nodes[node_of_[parent]];
    const double distance = (position(j) - from.position).norm();
    const double smallest = options_.smallest_bone * h_at(position(j));
    if (distance < smallest) {
      node_of_[j] = node_of_[parent];
      report(j, distance < 1e-6 ? "welded" : "contracted",
             fmt::format("{:.3g} m from '{}', below {:.2g} h = {:.3g} m", metres(distance),
                         joints_.names[from.joint], options_.smallest_bone, metres(smallest)));
      continue;
    }
    new_node(j);
    ReducedBone bone;
    bone.frame = parent;
    bone.start = node_of_[parent];
    bone.end = node_of_[j];
    result_.bones.push_back(bone);
  }
}

void Reduction::chain_siblings() {
  while (chain_one_pair()) {
  }
}

/// True for two bones out of one node, at a small angle, of which the longer could not go on behind the
/// shorter but would have to turn aside there: the two legs of a biped whose hips are one node.
bool Reduction::lie_side_by_side(const ReducedBone& shorter, const ReducedBone& longer) const {
  const Vector3d on = end(longer) - end(shorter);
  if (on.norm() <= options_.too_close * h_at(end(shorter))) return false;  // one place
  const double turn = std::cos(kSharpestChain * std::numbers::pi / 180.0);
  return on.normalized().dot(direction(shorter)) < turn;
}

/// Looks for two bones out of one node that nearly coincide, and chains them.
bool Reduction::chain_one_pair() {
  const double cosine = std::cos(options_.chain_degrees * std::numbers::pi / 180.0);
  for (std::size_t i = 0; i < result_.bones.size(); ++i)
    for (std::size_t k = i + 1; k < result_.bones.size(); ++k) {
      const ReducedBone &a = result_.bones[i], &b = result_.bones[k];
      if (a.start != b.start || a.soft || b.soft) continue;
      const bool swap = length(a) > length(b);
      const ReducedBone &shorter = swap ? b : a, &longer = swap ? a : b;
      const double distance = point_segment_distance(end(shorter), start(longer), end(longer));
      if (direction(shorter).dot(direction(longer)) < cosine &&
          distance > options_.too_close * h_at(end(shorter)))
        continue;
      chain(static_cast<int>(swap ? k : i), static_cast<int>(swap ? i : k));
      return true;
    }
  return false;
}

/// Of two bones out of one node the longer starts behind the shorter from now on; where it cannot, the
/// shorter is held by penalty instead.
void Reduction::chain(int shorter, int longer) {
  const ReducedBone first = result_.bones[shorter];
  ReducedBone& second = result_.bones[longer];
  const double distance = point_segment_distance(end(first), start(second), end(second));
  const double angle =
      std::acos(std::min(1.0, direction(first).dot(direction(second)))) * 180.0 / std::numbers::pi;
  const std::string leaves = fmt::format("leaves '{}' within {:.0f} degrees",
                                         joints_.names[result_.nodes[second.start].joint], angle);
  const int joint = result_.nodes[second.end].joint;
  if (mirror_joint_ != nullptr && end(second).x() == 0.0 && end(first).x() != 0.0) {
    // A bone in the plane of symmetry cannot start at one side.
    soften(shorter,
           fmt::format("it {} of the bone to '{}' in the plane of symmetry", leaves, joints_.names[joint]));
    return;
  }
  if (lie_side_by_side(first, second)) {
    soften(shorter,
           fmt::format("it {} of the bone to '{}', beside which it ends", leaves, joints_.names[joint]));
    return;
  }
  report(joint, "chained",
         fmt::format("its bone {} and {:.3g} m of the bone to '{}', so it starts there", leaves,
                     metres(distance), joints_.names[result_.nodes[first.end].joint]));
  second.start = first.end;
  const double smallest = options_.smallest_bone * h_at(end(second));
  if (length(second) >= smallest) return;
  const int from = second.end, to = second.start;
  report(joint, "contracted",
         fmt::format("{:.3g} m from '{}', below {:.2g} h = {:.3g} m", metres(length(second)),
                     joints_.names[result_.nodes[to].joint], options_.smallest_bone, metres(smallest)));
  result_.bones.erase(result_.bones.begin() + longer);
  for (ReducedBone& bone : result_.bones)
    if (bone.start == from) bone.start = to;
  for (int& node : node_of_)
    if (node == from) node = to;
}

bool Reduction::is_leaf(const ReducedBone& bone) const {
  return std::none_of(result_.bones.begin(), result_.bones.end(),
                      [&](const ReducedBone& b) { return b.start == bone.end; });
}

void Reduction::soften(int bone, const std::string& reason) {
  result_.bones[bone].soft = true;
  report(result_.bones[bone].frame, "soft", reason);
}

/// Bones that come too close to be edges of one lattice: the leaf, or the shorter, is held by penalty
/// instead.
void Reduction::soften_close_bones() {
  const double cosine = std::cos(options_.chain_degrees * std::numbers::pi / 180.0);
  const int count = static_cast<int>(result_.bones.size());
  for (int i = 0; i < count; ++i)
    for (int k = i + 1; k < count; ++k) {
      const ReducedBone &a = result_.bones[i], &b = result_.bones[k];
      if (a.soft || b.soft || a.start == b.start) continue;
      const double limit = options_.too_close * h_at(end(a));
      double distance = 0.0;
      if (a.end == b.start || b.end == a.start) {
        const ReducedBone &upper = a.end == b.start ? a : b, &lower = a.end == b.start ? b : a;
        const Vector3d back = (start(upper) - end(upper)).normalized();
        const Vector3d on = (end(lower) - start(lower)).normalized();
        distance = std::min(point_segment_distance(end(lower), start(upper), end(upper)),
                            point_segment_distance(start(upper), start(lower), end(lower)));
        if (back.dot(on) < cosine && distance > limit) continue;
      } else {
        distance = segment_segment_distance(start(a), end(a), start(b), end(b));
        if (distance > limit) continue;
      }
      const bool leaf_a = is_leaf(a), leaf_b = is_leaf(b);
      const bool take_a = leaf_a != leaf_b ? leaf_a : length(a) < length(b);
      const ReducedBone &taken = take_a ? a : b, &other = take_a ? b : a;
      soften(take_a ? i : k,
             fmt::format("its bone to '{}' comes within {:.3g} m of the bone from '{}' to '{}'",
                         joints_.names[result_.nodes[taken.end].joint], metres(distance),
                         joints_.names[result_.nodes[other.start].joint],
                         joints_.names[result_.nodes[other.end].joint]));
    }
}

void Reduction::soften_wanted_bones() {
  const auto is = [&](int joint, int wanted) {
    return joint == wanted || (mirror_joint_ != nullptr && (*mirror_joint_)[joint] == wanted);
  };
  for (const SoftBone& wanted : options_.soft_bones)
    for (int b = 0; b < static_cast<int>(result_.bones.size()); ++b) {
      const ReducedBone& bone = result_.bones[b];
      if (!bone.soft && bone.tip == wanted.tip && is(bone.frame, wanted.frame) &&
          is(result_.nodes[bone.end].joint, wanted.end_joint))
        soften(b, wanted.reason);
    }
}

/// True where a bone of the half x >= 0 is too close to its own mirror image for both to be edges: cells
/// between it and the plane would be flat.
bool Reduction::is_close_to_image(const Vector3d& a, const Vector3d& b) const {
  if (a.x() == 0.0 && b.x() == 0.0) return false;
  const double limit = options_.too_close * h_at(b);
  if (a.x() != 0.0) return std::min(a.x(), b.x()) < limit;
  const double to_plane = std::asin((b - a).normalized().x()) * 180.0 / std::numbers::pi;
  return b.x() < limit || 2.0 * to_plane < options_.chain_degrees;
}

void Reduction::soften_bones_at_their_image() {
  for (int b = 0; b < static_cast<int>(result_.bones.size()); ++b) {
    const ReducedBone& bone = result_.bones[b];
    if (bone.soft || !is_close_to_image(start(bone), end(bone))) continue;
    soften(b, fmt::format("its bone to '{}' comes within {:.3g} m of its mirror image",
                          joints_.names[result_.nodes[bone.end].joint],
                          2.0 * metres(start(bone).x() == 0.0 ? end(bone).x()
                                                              : std::min(start(bone).x(), end(bone).x()))));
  }
}

/// The half x < 0 from the other one.
void Reduction::add_mirror_images() {
  const std::vector<int>& partner = *mirror_joint_;
  std::vector<int> image(result_.nodes.size());
  for (std::size_t i = 0; i < image.size(); ++i) {
    const SkeletonNode node = result_.nodes[i];
    image[i] = static_cast<int>(i);
    if (node.position.x() == 0.0) continue;
    image[i] = static_cast<int>(result_.nodes.size());
    result_.nodes.push_back({partner[node.joint], reflected(node.position)});
  }
  const std::size_t count = result_.bones.size();
  result_.mirror_bone.resize(count);
  for (std::size_t b = 0; b < count; ++b) {
    ReducedBone bone = result_.bones[b];
    result_.mirror_bone[b] = static_cast<int>(b);
    if (image[bone.start] == bone.start && image[bone.end] == bone.end) continue;
    bone.frame = partner[bone.frame];
    bone.start = image[bone.start];
    bone.end = image[bone.end];
    result_.mirror_bone[b] = static_cast<int>(result_.bones.size());
    result_.mirror_bone.push_back(static_cast<int>(b));
    result_.bones.push_back(bone);
  }
  const std::size_t frames = result_.soft_frames.size();
  for (std::size_t i = 0; i < frames; ++i) {
    const SoftFrame frame = result_.soft_frames[i];
    if (partner[frame.frame] != frame.frame)
      result_.soft_frames.push_back({partner[frame.frame], reflected(frame.position)});
  }
  const std::size_t changes = result_.changes.size();
  for (std::size_t i = 0; i < changes; ++i) {
    const int other = partner[changed_joints_[i]];
    if (other < 0 || other == changed_joints_[i]) continue;
    const SkeletonChange& change = result_.changes[i];
    result_.changes.push_back({joints_.names[other], change.what,
                               fmt::format("like its mirror image '{}': {}", change.joint, change.reason)});
  }
}

void Reduction::drop_unused_nodes() {
  std::vector<int> new_index(result_.nodes.size(), -1);
  for (const ReducedBone& bone : result_.bones) new_index[bone.start] = new_index[bone.end] = 0;
  std::vector<SkeletonNode> nodes;
  for (std::size_t i = 0; i < result_.nodes.size(); ++i) {
    if (new_index[i] < 0) continue;
    new_index[i] = static_cast<int>(nodes.size());
    nodes.push_back(result_.nodes[i]);
  }
  for (ReducedBone& bone : result_.bones) {
    bone.start = new_index[bone.start];
    bone.end = new_index[bone.end];
  }
  result_.nodes = std::move(nodes);
}

/// The frame's name where it owns one bone, else with the joint at the end added.
void Reduction::name_bones() {
  std::vector<int> bones_of(n_, 0);
  for (const ReducedBone& bone : result_.bones) ++bones_of[bone.frame];
  for (ReducedBone& bone : result_.bones) {
    bone.name = joints_.names[bone.frame];
    if (bones_of[bone.frame] > 1) bone.name += "/" + joints_.names[result_.nodes[bone.end].joint];
  }
}

ReducedSkeleton reduce_skeleton(const UnitSkin& skin, const JointTree& joints, const JointWeights& weights,
                                double h, const ReductionOptions& options,
                                const std::vector<int>* mirror_joint) {
  return Reduction(skin, joints, weights, h, options, mirror_joint).run();
}

}  // namespace sinew::lattice::detail
