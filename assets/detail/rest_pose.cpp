#include "assets/detail/rest_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "assets/detail/loose_joints.h"
#include "assets/detail/text.h"
#include "assets/detail/transforms.h"
#include "assets/error.h"

namespace sinew::assets::detail {

namespace {

/// The promise of the self-check, as a share of the diagonal.
constexpr double kRestTolerance = 1e-4;
/// Node pose and bind pose count as the same below this share of a mesh's diagonal: bind matrices are floats
/// that went through several programs (1e-5 is usual), while another pose moves joints by many per cent.
constexpr double kSamePose = 1e-3;
/// Without a word of the file, a character that stands within this share of its diagonal from where it was
/// bound is left where it was bound, so that its feet stay on the ground it was modelled on.
constexpr double kLeaveInPlace = 0.5;
/// Joints whose scales differ by more are stretched by the pose; rounding stays a thousand times below.
constexpr double kStretch = 0.01;

/// Entries of an identity that went through text or single precision.
constexpr double kUnbound = 1e-5;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

Eigen::AlignedBox3d box_of(const lattice::Points& points) {
  Eigen::AlignedBox3d box;
  for (Eigen::Index v = 0; v < points.rows(); ++v) box.extend(points.row(v).transpose());
  return box;
}

/// Largest distance between two affine maps over a box, attained at a corner.
double distance(const Eigen::Affine3d& a, const Eigen::Affine3d& b, const Eigen::AlignedBox3d& box) {
  double largest = 0.0;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d corner = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(i));
    largest = std::max(largest, (a * corner - b * corner).norm());
  }
  return largest;
}

/// The signed permutation of axes nearest to `a`, among those whose determinant has the sign of `hand` (24 of
/// 48).
Eigen::Matrix3d snap_to_axes(const Eigen::Matrix3d& a, double hand) {
  std::array<int, 3> axes{0, 1, 2};
  Eigen::Matrix3d best = Eigen::Matrix3d::Identity();
  double best_trace = -1e300;
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d candidate = Eigen::Matrix3d::Zero();
      for (int c = 0; c < 3; ++c) candidate(axes[at(c)], c) = ((signs >> c) & 1) != 0 ? -1.0 : 1.0;
      if (candidate.determinant() * hand < 0.0) continue;
      const double trace = (candidate.transpose() * a).trace();
      if (trace > best_trace + 1e-12) {
        best_trace = trace;
        best = candidate;
      }
    }
  } while (std::next_permutation(axes.begin(), axes.end()));
  return best;
}

class RestFinder {
 public:
  explicit RestFinder(const ImportedScene& scene) : scene_(scene) {}

  RestPose run() {
    pose_nodes();
    weigh_joints();
    result_.rest_from_node.assign(scene_.nodes.size(), Eigen::Affine3d::Identity());
    result_.rest_from_mesh.assign(scene_.skins.size(), Eigen::Affine3d::Identity());
    resolved_.assign(scene_.nodes.size(), false);
    align_skins();
    hang_helpers();
    place_loose_joints();
    complete_tree();
    return std::move(result_);
  }

 private:
  void pose_nodes() {
    for (const ImportedNode& node : scene_.nodes) {
      result_.world_from_node.push_back(node.parent < 0 ? node.parent_from_node
                                                        : result_.world_from_node[at(node.parent)] *
                                                              node.parent_from_node);
    }
  }

  void weigh_joints() {
    result_.weight_of_node.assign(scene_.nodes.size(), 0.0);
    boxes_.resize(scene_.skins.size());
    for (const ImportedSkin& skin : scene_.skins) weights_.emplace_back(skin.joints.size(), 0.0);
    for (const ImportedInstance& instance : scene_.instances) {
      if (instance.skin < 0) continue;
      const ImportedMesh& mesh = scene_.meshes[at(instance.mesh)];
      boxes_[at(instance.skin)].extend(box_of(mesh.points));
      for (const auto& influences : mesh.weights) {
        for (const lattice::Influence& influence : influences) {
          weights_[at(instance.skin)][at(influence.frame)] += influence.weight;
          result_.weight_of_node[at(scene_.skins[at(instance.skin)].joints[at(influence.frame)])] +=
              influence.weight;
        }
      }
    }
  }

  /// T_kj of the joints of skin k that carry weight, with that weight.
  std::vector<std::pair<Eigen::Affine3d, double>> joint_maps(std::size_t k) const {
    std::vector<std::pair<Eigen::Affine3d, double>> maps;
    for (std::size_t j = 0; j < weights_[k].size(); ++j) {
      if (weights_[k][j] <= 0.0) continue;
      maps.emplace_back(
          result_.world_from_node[at(scene_.skins[k].joints[j])] * scene_.skins[k].joint_from_mesh[j],
          weights_[k][j]);
    }
    return maps;
  }

  static bool usable(const Eigen::Affine3d& map) {
    return map.matrix().allFinite() && std::abs(map.linear().determinant()) > 1e-30;
  }

  struct Alignment {
    Eigen::Affine3d map = Eigen::Affine3d::Identity();
    bool same_pose = false;  ///< the nodes hold the pose of binding.
  };

  Alignment own_alignment(std::size_t k) const {
    auto maps = joint_maps(k);
    std::erase_if(maps, [](const auto& map) { return !usable(map.first); });
    if (maps.empty()) return {};
    const auto& heaviest = *std::max_element(
        maps.begin(), maps.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
    const double scale = character_scale(maps);
    const double size = scale * boxes_[k].diagonal().norm();
    const bool same_pose = std::all_of(maps.begin(), maps.end(), [&](const auto& map) {
      return distance(map.first, heaviest.first, boxes_[k]) <= kSamePose * size;
    });
    if (same_pose) return {heaviest.first, true};
    const Eigen::Affine3d guess = similarity(maps, scale, k);
    const std::optional<Eigen::Affine3d>& bound = scene_.skins[k].world_from_mesh;
    return {bound && stands_like(*bound, guess) ? *bound : guess, false};
  }

  /// The file's word for where the mesh was bound counts where it agrees with the guess in size and rough
  /// direction; it may be a leftover.
  static bool stands_like(const Eigen::Affine3d& bound, const Eigen::Affine3d& guess) {
    if (!usable(bound)) return false;
    const Eigen::Matrix3d change = guess.linear().inverse() * bound.linear();
    const double scale = std::cbrt(change.determinant());
    if (!(scale > 0.5 && scale < 2.0)) return false;
    // trace = 1 + 2 cos(angle); 45 degrees is half way to the next turn of axes.
    return nearest_orthogonal(change).trace() > 1.0 + 2.0 * std::cos(0.25 * std::numbers::pi);
  }

  /// Scale from mesh to world: the joints' median. Where joints are stretched (their scales disagree) and it
  /// is near 1, the stretch is part of the pose and the mesh keeps its size.
  static double character_scale(const std::vector<std::pair<Eigen::Affine3d, double>>& maps) {
    std::vector<std::pair<double, double>> scales;
    double total = 0.0;
    for (const auto& [map, weight] : maps) {
      scales.emplace_back(std::cbrt(std::abs(map.linear().determinant())), weight);
      total += weight;
    }
    std::sort(scales.begin(), scales.end());
    const auto quantile = [&](double share) {
      double below = 0.0;
      for (const auto& [scale, weight] : scales) {
        below += weight;
        if (below >= share * total) return scale;
      }
      return scales.back().first;
    };
    const double median = quantile(0.5);
    const bool stretched = quantile(0.9) > (1.0 + kStretch) * quantile(0.1);
    return stretched && median > 0.5 && median < 2.0 ? 1.0 : median;
  }

  Eigen::Affine3d similarity(const std::vector<std::pair<Eigen::Affine3d, double>>& maps, double scale,
                             std::size_t k) const {
    double hand = 0.0;
    for (const auto& [map, weight] : maps) hand += map.linear().determinant() < 0.0 ? -weight : weight;
    Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();
    double total = 0.0;
    for (const auto& [map, weight] : maps) {
      if ((map.linear().determinant() < 0.0) != (hand < 0.0)) continue;
      mean += weight * nearest_orthogonal(map.linear());
    }
    Eigen::Affine3d result = Eigen::Affine3d::Identity();
    result.linear() = scale * snap_to_axes(mean, hand < 0.0 ? -1.0 : 1.0);
    const Eigen::Vector3d centre = boxes_[k].center();
    for (const auto& [map, weight] : maps) {
      shift += weight * (map * centre - result * centre);
      total += weight;
    }
    shift /= total;
    if (shift.norm() > kLeaveInPlace * scale * boxes_[k].diagonal().norm()) result.translation() = shift;
    return result;
  }

  void align_skins() {
    std::vector<std::size_t> order(scene_.skins.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    const auto total = [this](std::size_t k) {
      return std::accumulate(weights_[k].begin(), weights_[k].end(), 0.0);
    };
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return total(a) > total(b); });
    for (const std::size_t k : order) {
      // Skins that no mesh uses may hold leftovers; they decide nothing.
      if (total(k) <= 0.0) continue;
      const Alignment own = own_alignment(k);
      result_.rest_from_mesh[k] = align_skin(k, own);
      const ImportedSkin& skin = scene_.skins[k];
      for (std::size_t j = 0; j < skin.joints.size(); ++j) {
        const int node = skin.joints[j];
        if (resolved_[at(node)]) continue;
        const Eigen::Affine3d bound = result_.rest_from_mesh[k] * skin.joint_from_mesh[j].inverse();
        if (weights_[k][j] > 0.0) {
          result_.rest_from_node[at(node)] = bound;
          resolved_[at(node)] = true;
        } else if (is_loose_.insert(node).second) {
          const bool is_unbound = skin.joint_from_mesh[j].isApprox(Eigen::Affine3d::Identity(), kUnbound);
          loose_.push_back({node, bound, is_unbound, own.same_pose});
        }
      }
      if (!first_aligned_) {
        first_aligned_ = k;
        first_in_same_pose_ = own.same_pose;
      }
    }
  }

  /// Through a joint that carries weight in this skin and in an earlier one; `own` where there is none.
  Eigen::Affine3d align_skin(std::size_t k, const Alignment& own) const {
    const ImportedSkin& skin = scene_.skins[k];
    // The joint with the largest weight here; among those without weight here, with the largest elsewhere.
    std::pair<double, double> best{-1.0, -1.0};
    std::size_t joint = 0;
    for (std::size_t j = 0; j < skin.joints.size(); ++j) {
      const std::pair weight{weights_[k][j], result_.weight_of_node[at(skin.joints[j])]};
      if (!resolved_[at(skin.joints[j])] || weight <= best) continue;
      best = weight;
      joint = j;
    }
    if (best.second >= 0.0) {
      const Eigen::Affine3d shared =
          result_.rest_from_node[at(skin.joints[joint])] * skin.joint_from_mesh[joint];
      // No vertex vouches for the matrix of a joint that carries nothing here.
      const double scale =
          std::cbrt(std::abs(shared.linear().determinant() / own.map.linear().determinant()));
      if (best.first > 0.0 || (scale > 0.5 && scale < 2.0)) return shared;
    }
    if (!first_aligned_) return own.map;
    const Eigen::Affine3d& first = result_.rest_from_mesh[*first_aligned_];
    // Skins without a common joint stand where the nodes have them, if these hold the pose of binding.
    if (own.same_pose && first_in_same_pose_) {
      const double size = std::cbrt(std::abs(first.linear().determinant())) * boxes_[k].diagonal().norm();
      return distance(own.map, first, boxes_[k]) <= kSamePose * size ? first : own.map;
    }
    // Otherwise they were bound in the same space if they were turned and scaled alike.
    return own.map.linear().isApprox(first.linear(), kSamePose) ? first : own.map;
  }

  /// Diagonal of all skins at rest.
  double size_at_rest() const {
    Eigen::AlignedBox3d box;
    for (std::size_t k = 0; k < boxes_.size(); ++k) {
      for (int i = 0; i < 8 && !boxes_[k].isEmpty(); ++i)
        box.extend(result_.rest_from_mesh[k] *
                   boxes_[k].corner(static_cast<Eigen::AlignedBox3d::CornerType>(i)));
    }
    return box.isEmpty() ? 0.0 : box.diagonal().norm();
  }

  void place_loose_joints() {
    // A joint may be loose in one skin and carry weight in the next.
    std::erase_if(loose_, [&](const LooseJoint& joint) { return resolved_[at(joint.node)]; });
    if (loose_.empty()) return;
    std::vector<std::optional<Eigen::Affine3d>> placed(scene_.nodes.size());
    for (std::size_t n = 0; n < placed.size(); ++n) {
      if (resolved_[n]) placed[n] = result_.rest_from_node[n];
    }
    LooseRest rest = hang_loose_joints(scene_, placed, loose_, size_at_rest());
    for (std::size_t l = 0; l < loose_.size(); ++l) {
      result_.rest_from_node[at(loose_[l].node)] = rest.rest_from_node[l];
      resolved_[at(loose_[l].node)] = true;
    }
    result_.rehung = std::move(rest.rehung);
  }

  /// Gives the parent of a placed node the place from which its child is where it is.
  void hang_on_child(std::size_t child) {
    const int parent = scene_.nodes[child].parent;
    result_.rest_from_node[at(parent)] =
        result_.rest_from_node[child] * invertible_local(scene_.nodes[child]).inverse();
    resolved_[at(parent)] = true;
  }

  void hang_helpers() {
    for (std::size_t i = scene_.nodes.size(); i-- > 0;) {
      const int parent = scene_.nodes[i].parent;
      if (resolved_[i] && parent >= 0 && scene_.nodes[at(parent)].helper) hang_on_child(i);
    }
  }

  void complete_tree() {
    hang_helpers();
    const std::size_t n = scene_.nodes.size();
    const auto hang_on_parents = [&] {
      for (std::size_t i = 0; i < n; ++i) {
        const int parent = scene_.nodes[i].parent;
        if (resolved_[i] || parent < 0 || !resolved_[at(parent)]) continue;
        result_.rest_from_node[i] = result_.rest_from_node[at(parent)] * invertible_local(scene_.nodes[i]);
        resolved_[i] = true;
      }
    };
    hang_on_parents();
    // What stands above the skin (armatures, groups) is part of the scene, not of the bind pose: it rests
    // where it is, and so does what hangs on it alone.
    for (std::size_t i = 0; i < n; ++i) {
      if (resolved_[i]) continue;
      const int parent = scene_.nodes[i].parent;
      result_.rest_from_node[i] =
          parent < 0 ? invertible_local(scene_.nodes[i])
                     : result_.rest_from_node[at(parent)] * invertible_local(scene_.nodes[i]);
      resolved_[i] = true;
    }
  }

  const ImportedScene& scene_;
  RestPose result_;
  std::vector<std::vector<double>> weights_;  ///< per skin and joint.
  std::vector<Eigen::AlignedBox3d> boxes_;    ///< per skin, of its meshes' points.
  std::vector<bool> resolved_;                ///< per node.
  std::vector<LooseJoint> loose_;             ///< in the order of the skins that name them.
  std::set<int> is_loose_;                    ///< their nodes.
  std::optional<std::size_t> first_aligned_;
  bool first_in_same_pose_ = false;
};

/// The up to three things with the largest error, worst first.
template <typename Name>
std::string worst_three(const std::vector<double>& errors, double limit, const Name& name) {
  std::vector<std::size_t> offenders;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (errors[i] > limit) offenders.push_back(i);
  }
  std::stable_sort(offenders.begin(), offenders.end(),
                   [&](std::size_t a, std::size_t b) { return errors[a] > errors[b]; });
  std::string list;
  for (std::size_t i = 0; i < offenders.size() && i < 3; ++i) {
    list += (i > 0 ? ", '" : "'") + printable(name(offenders[i])) + "'";
  }
  if (offenders.size() > 3) list += " and " + std::to_string(offenders.size() - 3) + " more";
  return list;
}

}  // namespace

RestPose find_rest_pose(const ImportedScene& scene) { return RestFinder(scene).run(); }

void check_crowd(const std::string& file, const ImportedScene& scene, const RestPose& rest) {
  const auto first_joint = [&](const ImportedInstance& instance) {
    return "'" + printable(name_of(scene, scene.skins[at(instance.skin)].joints.front())) + "'";
  };
  // First instance of every mesh with each skin, by mesh.
  std::map<int, std::vector<const ImportedInstance*>> bodies;
  for (const ImportedInstance& instance : scene.instances) {
    if (instance.skin < 0) continue;
    const lattice::Points& points = scene.meshes[at(instance.mesh)].points;
    std::vector<const ImportedInstance*>& of_mesh = bodies[instance.mesh];
    const auto has_this_skin = [&](const ImportedInstance* other) { return other->skin == instance.skin; };
    if (std::any_of(of_mesh.begin(), of_mesh.end(), has_this_skin)) continue;
    const std::vector<int>& joints = scene.skins[at(instance.skin)].joints;
    for (const ImportedInstance* other : of_mesh) {
      const std::vector<int>& others = scene.skins[at(other->skin)].joints;
      if (std::find_first_of(joints.begin(), joints.end(), others.begin(), others.end()) != joints.end())
        continue;
      const Eigen::AlignedBox3d box = box_of(points);
      const Eigen::Affine3d& map = rest.rest_from_mesh[at(instance.skin)];
      const double size = (map.linear() * box.diagonal()).norm();
      if (distance(map, rest.rest_from_mesh[at(other->skin)], box) > kSamePose * size) continue;
      throw InputError(file, "mesh '" + printable(scene.meshes[at(instance.mesh)].name) +
                                 "': is bound to the skeletons of " + first_joint(*other) + " and " +
                                 first_joint(instance) +
                                 ", which rest in one place, expected one; hint: export every character to a "
                                 "file of its own");
    }
    of_mesh.push_back(&instance);
  }
}

void check_rest_pose(const std::string& file, const ImportedScene& scene, const RestPose& rest) {
  Eigen::AlignedBox3d box;
  std::vector<double> parts(scene.meshes.size(), 0.0), joints(scene.nodes.size(), 0.0);
  double worst = 0.0;
  for (const ImportedInstance& instance : scene.instances) {
    if (instance.skin < 0) continue;
    const ImportedMesh& mesh = scene.meshes[at(instance.mesh)];
    const ImportedSkin& skin = scene.skins[at(instance.skin)];
    std::vector<Eigen::Affine3d> maps;
    for (std::size_t j = 0; j < skin.joints.size(); ++j) {
      maps.push_back(rest.rest_from_node[at(skin.joints[j])] * skin.joint_from_mesh[j]);
    }
    for (std::size_t v = 0; v < mesh.weights.size(); ++v) {
      const Eigen::Vector3d p = mesh.points.row(static_cast<Eigen::Index>(v)).transpose();
      const Eigen::Vector3d expected = rest.rest_from_mesh[at(instance.skin)] * p;
      box.extend(expected);
      Eigen::Vector3d skinned = Eigen::Vector3d::Zero();
      for (const lattice::Influence& influence : mesh.weights[v]) {
        const Eigen::Vector3d moved = maps[at(influence.frame)] * p;
        skinned += influence.weight * moved;
        double& joint = joints[at(skin.joints[at(influence.frame)])];
        joint = std::max(joint, influence.weight * (moved - expected).norm());
      }
      const double error = (skinned - expected).norm();
      double& part = parts[at(instance.mesh)];
      part = std::max(part, error);
      worst = std::max(worst, error);
    }
  }
  if (box.isEmpty()) return;
  const double limit = kRestTolerance * box.diagonal().norm();
  if (worst <= limit) return;
  throw InputError(
      file,
      "skin: the bind matrices do not agree: skinning the rest pose misses the mesh, got " +
          number(100.0 * worst / box.diagonal().norm()) + " % of its diagonal, expected at most " +
          number(100.0 * kRestTolerance) + " %; worst joints " +
          worst_three(joints, limit, [&](std::size_t n) { return name_of(scene, static_cast<int>(n)); }) +
          "; worst parts " + worst_three(parts, limit, [&](std::size_t m) { return scene.meshes[m].name; }) +
          "; hint: put the character into one pose and bind all its meshes again");
}

}  // namespace sinew::assets::detail
