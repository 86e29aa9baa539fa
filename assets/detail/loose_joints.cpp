#include "assets/detail/loose_joints.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "assets/detail/transforms.h"

namespace sinew::assets::detail {

namespace {

/// Bind matrices are floats that went through several programs: 1e-5 of the size is usual.
constexpr double kSamePose = 1e-3;
/// Another pose than that of binding moves control joints by as much of the size, at most.
constexpr double kSamePlace = 0.5;
/// A joint bound by the identity that is right stands at the root. No pose turns a root by half the way to
/// the next axis, or moves it farther against the body than a crouch.
constexpr double kRootTurn = 0.25 * std::numbers::pi;
constexpr double kRootPlace = 0.1;
/// Steps along the tree that the clips do not move: the shorter way wins among equals.
constexpr double kStep = 1e-3;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

double scale_of(const Eigen::Affine3d& map) { return std::cbrt(std::abs(map.linear().determinant())); }

/// Angle between two frames, whatever their sizes [rad].
double angle_between(const Eigen::Affine3d& a, const Eigen::Affine3d& b) {
  const Eigen::Matrix3d turn = nearest_orthogonal(a.linear().inverse() * b.linear());
  return std::acos(std::clamp(0.5 * (turn.trace() - 1.0), -1.0, 1.0));
}

/// How far the clips move each node against its parent from where the node tree has it: angle [rad] plus way
/// over `size`.
std::vector<double> movement(const ImportedScene& scene, double size) {
  std::vector<double> moved(scene.nodes.size(), 0.0);
  for (const skeleton::Clip& clip : scene.clips) {
    for (const skeleton::Channel& channel : clip.channels) {
      const skeleton::LocalTransform& still = scene.nodes[at(channel.joint)].local;
      double angle = 0.0, way = 0.0;
      if (channel.rotation) {
        for (const Eigen::Quaterniond& q : channel.rotation->values)
          angle = std::max(angle, still.rotation.angularDistance(q.normalized()));
      }
      if (channel.translation) {
        for (const Eigen::Vector3d& t : channel.translation->values)
          way = std::max(way, (t - still.translation).norm());
      }
      moved[at(channel.joint)] = std::max(moved[at(channel.joint)], angle + way / size);
    }
  }
  return moved;
}

/// The node tree below one more node, the world, in which the roots stand; the world comes last.
class Hanger {
 public:
  Hanger(const ImportedScene& scene, const std::vector<std::optional<Eigen::Affine3d>>& rest,
         const std::vector<LooseJoint>& loose, double size)
      : scene_(scene), loose_(loose), size_(size), world_(scene.nodes.size()), rest_(rest) {
    rest_.resize(world_ + 1);
    loose_of_node_.assign(world_ + 1, -1);
    for (std::size_t l = 0; l < loose.size(); ++l) loose_of_node_[at(loose[l].node)] = static_cast<int>(l);
    for (const ImportedNode& node : scene.nodes) local_.push_back(invertible_local(node));
  }

  LooseRest run() {
    find_ways();
    LooseRest result;
    for (std::size_t l = 0; l < loose_.size(); ++l) {
      const std::size_t node = at(loose_[l].node);
      result.rest_from_node.push_back(place(node));
      if (rehung_[node]) result.rehung.push_back(loose_[l].node);
    }
    return result;
  }

 private:
  std::size_t above(std::size_t node) const {
    return scene_.nodes[node].parent < 0 ? world_ : at(scene_.nodes[node].parent);
  }

  /// The neighbour through which the way to a placed node is cheapest, for every node: up the tree, then
  /// down.
  void find_ways() {
    const std::vector<double> moved = movement(scene_, size_);
    cost_.assign(world_ + 1, std::numeric_limits<double>::infinity());
    via_.assign(world_ + 1, world_ + 1);
    rehung_.assign(world_ + 1, false);
    for (std::size_t n = 0; n <= world_; ++n) {
      if (rest_[n]) cost_[n] = 0.0;
    }
    const auto offer = [&](std::size_t from, std::size_t to, double step) {
      if (cost_[from] + step >= cost_[to]) return;
      cost_[to] = cost_[from] + step;
      via_[to] = from;
    };
    for (std::size_t n = world_; n-- > 0;) offer(n, above(n), kStep + moved[n]);
    for (std::size_t n = 0; n < world_; ++n) offer(above(n), n, kStep + moved[n]);
  }

  /// Rest frame of a node; placed along its way, which is walked back from the placed end.
  const Eigen::Affine3d& place(std::size_t node) {
    std::vector<std::size_t> way;
    for (std::size_t n = node; !rest_[n]; n = via_[n]) {
      way.push_back(n);
      if (via_[n] > world_) break;
    }
    for (auto n = way.rbegin(); n != way.rend(); ++n) rest_[*n] = frame_of(*n);
    return *rest_[node];
  }

  Eigen::Affine3d frame_of(std::size_t node) {
    const int l = loose_of_node_[node];
    // Without any relative there is nothing to agree with.
    if (via_[node] > world_) return loose_[at(l)].bound;
    const std::size_t via = via_[node];
    const bool down = node != world_ && via == above(node);
    const Eigen::Affine3d hung = down ? *rest_[via] * local_[node] : *rest_[via] * local_[via].inverse();
    if (l < 0) return hung;
    if (agrees(loose_[at(l)], hung)) return loose_[at(l)].bound;
    rehung_[node] = true;
    return hung;
  }

  bool agrees(const LooseJoint& joint, const Eigen::Affine3d& hung) const {
    const double away = (joint.bound.translation() - hung.translation()).norm();
    const double scale = scale_of(joint.bound) / scale_of(hung);
    const double angle = angle_between(hung, joint.bound);
    if (joint.same_pose)
      return away < kSamePose * size_ && std::abs(scale - 1.0) < kSamePose && angle < kSamePose;
    if (joint.is_unbound && (angle > kRootTurn || away > kRootPlace * size_)) return false;
    return away < kSamePlace * size_ && scale > 0.5 && scale < 2.0;
  }

  const ImportedScene& scene_;
  const std::vector<LooseJoint>& loose_;
  const double size_;
  const std::size_t world_;
  std::vector<std::optional<Eigen::Affine3d>> rest_;
  std::vector<Eigen::Affine3d> local_;  ///< by node.
  std::vector<int> loose_of_node_;
  std::vector<double> cost_;
  std::vector<std::size_t> via_;  ///< world_ + 1: there is no way.
  std::vector<bool> rehung_;
};

}  // namespace

Eigen::Affine3d invertible_local(const ImportedNode& node) {
  const double volume = std::abs(node.parent_from_node.linear().determinant());
  if (volume > 1e-12 * std::pow(node.parent_from_node.linear().norm(), 3)) return node.parent_from_node;
  skeleton::LocalTransform local = node.local;
  for (int c = 0; c < 3; ++c) {
    if (std::abs(local.scale[c]) < 1e-6 * std::max(local.scale.cwiseAbs().maxCoeff(), 1e-6))
      local.scale[c] = 1.0;
  }
  return local.matrix();
}

LooseRest hang_loose_joints(const ImportedScene& scene,
                            const std::vector<std::optional<Eigen::Affine3d>>& rest_from_node,
                            const std::vector<LooseJoint>& loose, double size) {
  // A skin without extent has no size to compare ways with; any will do.
  return Hanger(scene, rest_from_node, loose, size > 0.0 ? size : 1.0).run();
}

}  // namespace sinew::assets::detail
