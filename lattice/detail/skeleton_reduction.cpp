#include "lattice/detail/skeleton_reduction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lattice/detail/cell_sizes.h"
#include "lattice/detail/segments.h"
#include "lattice/detail/symmetry.h"

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
/// A chained bone may turn by so many degrees where it goes on.
constexpr double kSharpestChain = 60.0;

class Reduction {
 public:
  Reduction(const UnitSkin& skin, const JointTree& joints, const JointWeights& weights, double h,
            const ReductionOptions& options, const std::vector<int>* mirror_joint)
      : skin_(skin),
        joints_(joints),
        weights_(weights),
        h_(h),
        options_(options),
        mirror_joint_(mirror_joint),
        n_(num_joints()) {
    for (double a : weights_.area) total_area_ += a;
  }

  ReducedSkeleton run() {
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

 private:
  int num_joints() const { return static_cast<int>(joints_.parents.size()); }
  Vector3d position(int joint) const { return joints_.positions.row(joint).transpose(); }
  Vector3d start(const ReducedBone& b) const { return result_.nodes[b.start].position; }
  Vector3d end(const ReducedBone& b) const { return result_.nodes[b.end].position; }
  double length(const ReducedBone& b) const { return (end(b) - start(b)).norm(); }
  double h_at(const Vector3d& p) const {
    return options_.sizes == nullptr ? h_ : options_.sizes->edge_at(p, h_);
  }
  double metres(double unit_length) const { return unit_length * skin_.scale; }
  void report(int joint, const char* what, std::string reason) {
    result_.changes.push_back({joints_.names[joint], what, std::move(reason)});
    changed_joints_.push_back(joint);
  }

  void prune();
  bool is_cut(int parent, int child, std::string& reason) const;
  void place_nodes();
  void chain_siblings();
  bool chain_one_pair();
  bool lie_side_by_side(const ReducedBone& shorter, const ReducedBone& longer) const;
  void soften_close_bones();
  void soften_wanted_bones();
  void soften_bones_at_their_image();
  bool is_close_to_image(const Vector3d& a, const Vector3d& b) const;
  void add_mirror_images();
  void soften(int bone, const std::string& reason);
  bool is_leaf(const ReducedBone& bone) const;
  void add_tips();
  bool add_tip(int joint, double smallest, const std::vector<double>& vertex_weight);
  Vector3d soft_position(int joint, const std::vector<double>& vertex_weight) const;
  std::string conflict(const Vector3d& a, const Vector3d& b, int node) const;
  void drop_unused_nodes();
  void name_bones();

  const UnitSkin& skin_;
  const JointTree& joints_;
  const JointWeights& weights_;
  double h_;
  ReductionOptions options_;
  const std::vector<int>* mirror_joint_;
  int n_;
  double total_area_ = 0.0;
  std::vector<bool> kept_;           ///< per joint.
  std::vector<int> node_of_;         ///< per joint; -1 where pruned.
  std::vector<int> changed_joints_;  ///< of result_.changes.
  ReducedSkeleton result_;
};

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
  if (on.norm() <= options_.too_close * h_) return false;  // one place
  const double turn = std::cos(kSharpestChain * std::numbers::pi / 180.0);
  return on.normalized().dot((end(shorter) - start(shorter)).normalized()) < turn;
}

/// Two bones out of one node that nearly coincide: the longer starts behind the shorter.
bool Reduction::chain_one_pair() {
  const double cosine = std::cos(options_.chain_degrees * std::numbers::pi / 180.0);
  for (std::size_t i = 0; i < result_.bones.size(); ++i)
    for (std::size_t k = i + 1; k < result_.bones.size(); ++k) {
      if (result_.bones[i].start != result_.bones[k].start) continue;
      if (result_.bones[i].soft || result_.bones[k].soft) continue;
      const bool swap = length(result_.bones[i]) > length(result_.bones[k]);
      const ReducedBone shorter = result_.bones[swap ? k : i];
      ReducedBone& longer = result_.bones[swap ? i : k];
      const Vector3d u = (end(shorter) - start(shorter)).normalized(),
                     v = (end(longer) - start(longer)).normalized();
      const double distance = point_segment_distance(end(shorter), start(longer), end(longer));
      if (u.dot(v) < cosine && distance > options_.too_close * h_at(end(shorter))) continue;
      if (mirror_joint_ != nullptr && end(longer).x() == 0.0 && end(shorter).x() != 0.0) {
        // A bone in the plane of symmetry cannot start at one side.
        soften(
            static_cast<int>(swap ? k : i),
            fmt::format("it leaves '{}' within {:.0f} degrees of the bone to '{}' in the plane of symmetry",
                        joints_.names[result_.nodes[longer.start].joint],
                        std::acos(std::min(1.0, u.dot(v))) * 180.0 / std::numbers::pi,
                        joints_.names[result_.nodes[longer.end].joint]));
        return true;
      }
      if (lie_side_by_side(shorter, longer)) {
        soften(static_cast<int>(swap ? k : i),
               fmt::format("it leaves '{}' within {:.0f} degrees of the bone to '{}', beside which it ends",
                           joints_.names[result_.nodes[longer.start].joint],
                           std::acos(std::min(1.0, u.dot(v))) * 180.0 / std::numbers::pi,
                           joints_.names[result_.nodes[longer.end].joint]));
        return true;
      }
      const int joint = result_.nodes[longer.end].joint;
      report(joint, "chained",
             fmt::format("its bone leaves '{}' within {:.0f} degrees and {:.3g} m of the bone to '{}', so it "
                         "starts there",
                         joints_.names[result_.nodes[longer.start].joint],
                         std::acos(std::min(1.0, u.dot(v))) * 180.0 / std::numbers::pi, metres(distance),
                         joints_.names[result_.nodes[shorter.end].joint]));
      longer.start = shorter.end;
      const double smallest = options_.smallest_bone * h_at(end(longer));
      if (length(longer) >= smallest) return true;
      const int from = longer.end, to = longer.start;
      report(joint, "contracted",
             fmt::format("{:.3g} m from '{}', below {:.2g} h = {:.3g} m", metres(length(longer)),
                         joints_.names[result_.nodes[to].joint], options_.smallest_bone, metres(smallest)));
      result_.bones.erase(result_.bones.begin() + static_cast<std::ptrdiff_t>(swap ? i : k));
      for (ReducedBone& bone : result_.bones)
        if (bone.start == from) bone.start = to;
      for (int& node : node_of_)
        if (node == from) node = to;
      return true;
    }
  return false;
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

/// Why no bone from a (at `node`) to b can be added; empty where it can.
std::string Reduction::conflict(const Vector3d& a, const Vector3d& b, int node) const {
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
    return fmt::format("comes within {:.3g} m of the bone from '{}' to '{}'", metres(distance),
                       joints_.names[result_.nodes[bone.start].joint],
                       joints_.names[result_.nodes[bone.end].joint]);
  }
  return "";
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
  if (!conflict(from, tip, node).empty()) return false;
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

/// Breadth-first nearest descendant that is a frame, or -1.
int nearest_descendant(int joint, const std::vector<std::vector<int>>& children,
                       const std::vector<bool>& is_frame) {
  std::vector<int> queue{joint};
  for (std::size_t i = 0; i < queue.size(); ++i) {
    if (is_frame[queue[i]]) return queue[i];
    queue.insert(queue.end(), children[queue[i]].begin(), children[queue[i]].end());
  }
  return -1;
}

}  // namespace

JointWeights joint_weights(const UnitSkin& skin, const JointTree& joints, const std::vector<int>& stand_in) {
  const int n = static_cast<int>(joints.parents.size());
  JointWeights result{std::vector<double>(n, 0.0),
                      {},
                      std::vector<std::vector<std::pair<int, double>>>(n),
                      std::vector<bool>(n, false)};
  for (std::size_t v = 0; v < skin.weights.size(); ++v)
    for (const Influence& influence : skin.weights[v]) {
      if (!(influence.weight > 0.0)) continue;
      const int joint = stand_in[influence.frame];
      result.area[joint] += influence.weight * skin.areas[v];
      result.vertices[joint].emplace_back(static_cast<int>(v), influence.weight);
    }
  result.subtree_area = result.area;
  for (int j = n - 1; j >= 0; --j)
    if (joints.parents[j] >= 0) result.subtree_area[joints.parents[j]] += result.subtree_area[j];
  return result;
}

ReducedSkeleton reduce_skeleton(const UnitSkin& skin, const JointTree& joints, const JointWeights& weights,
                                double h, const ReductionOptions& options,
                                const std::vector<int>* mirror_joint) {
  return Reduction(skin, joints, weights, h, options, mirror_joint).run();
}

std::vector<int> frame_of_joint(const std::vector<int>& parents, const std::vector<int>& frames) {
  const int n = static_cast<int>(parents.size());
  std::vector<int> result(n, -1);
  if (frames.empty()) return result;
  std::vector<bool> is_frame(n, false);
  for (int f : frames) is_frame[f] = true;
  std::vector<std::vector<int>> children(n);
  for (int j = 0; j < n; ++j)
    if (parents[j] >= 0) children[parents[j]].push_back(j);
  for (int j = 0; j < n; ++j) {
    int found = j;
    while (found >= 0 && !is_frame[found]) found = parents[found];
    if (found < 0) found = nearest_descendant(j, children, is_frame);
    result[j] = found >= 0 ? found : *std::min_element(frames.begin(), frames.end());
  }
  return result;
}

}  // namespace sinew::lattice::detail
