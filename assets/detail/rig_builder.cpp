#include "assets/detail/rig_builder.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <utility>

#include "assets/collapse.h"
#include "assets/detail/part_copies.h"
#include "assets/detail/rest_pose.h"
#include "assets/detail/skin_report.h"
#include "assets/detail/skin_weights.h"
#include "assets/detail/text.h"
#include "assets/detail/turned_shells.h"
#include "assets/detail/units.h"
#include "assets/error.h"

namespace sinew::assets::detail {

namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// Hands out names: the wished one, made printable, or with a number behind it where it is taken.
class Names {
 public:
  std::string take(const std::string& wish, const std::string& otherwise) {
    const std::string base = wish.empty() ? otherwise : printable(wish);
    std::string name = base;
    // Counting on from the last number keeps a file that uses one name ten thousand times linear.
    int& number_used = last_number_.try_emplace(base, 1).first->second;
    while (!taken_.insert(name).second) name = base + "_" + std::to_string(++number_used);
    if (wish.empty()) ++num_invented;
    if (!wish.empty() && name != base) ++num_changed;
    return name;
  }
  int num_invented = 0;
  int num_changed = 0;

 private:
  std::set<std::string> taken_;
  std::map<std::string, int> last_number_;
};

class RigBuilder {
 public:
  RigBuilder(const std::string& file, ImportedScene scene, const LoadOptions& options)
      : scene_(std::move(scene)), options_(options) {
    rig_.file = file;
  }

  Rig run() {
    rig_.format = scene_.format;
    rig_.file_vertex_order = scene_.file_vertex_order;
    rig_.up_axis = scene_.up_axis;
    normalise_weights(scene_);
    rest_ = find_rest_pose(scene_);
    check_crowd(rig_.file, scene_, rest_);
    check_rest_pose(rig_.file, scene_, rest_);
    report_rehung();
    choose_joints();
    make_parts();
    find_units();
    make_skeleton();
    make_clips();
    rig_.findings.insert(rig_.findings.begin(), scene_.findings.begin(), scene_.findings.end());
    bind_coincident_copies(rig_);
    turn_shells(rig_);
    report_collapses();
    report_skin(rig_);
    judge();
    return std::move(rig_);
  }

 private:
  void find(Finding::Severity severity, const char* code, const std::string& where,
            const std::string& message, const std::string& remedy = "") {
    rig_.findings.push_back({severity, code, where, message, remedy});
  }

  // ---- joints

  void report_rehung() {
    constexpr std::size_t kNamed = 3;
    if (rest_.rehung.empty()) return;
    std::string named;
    for (std::size_t i = 0; i < std::min(rest_.rehung.size(), kNamed); ++i)
      named += (i > 0 ? ", '" : "'") + printable(name_of(scene_, rest_.rehung[i])) + "'";
    if (rest_.rehung.size() > kNamed)
      named += " and " + std::to_string(rest_.rehung.size() - kNamed) + " more";
    find(Finding::Severity::Warning, "bind-matrix-ignored", "",
         "joints without weight (" + named +
             ") have bind matrices that contradict their nodes; they rest where the nodes have them",
         "bind the skin again, or export its deforming joints only");
  }

  bool animated(std::size_t node) const {
    return std::any_of(scene_.clips.begin(), scene_.clips.end(), [&](const skeleton::Clip& clip) {
      return std::any_of(clip.channels.begin(), clip.channels.end(),
                         [&](const skeleton::Channel& channel) { return at(channel.joint) == node; });
    });
  }

  /// Joints are: what a skin names; what lies above; what hangs below without a mesh of its own (end points
  /// of limbs); nodes that animate a rigid part. In files without a skin: everything without a mesh, cameras
  /// too.
  void choose_joints() {
    const std::size_t n = scene_.nodes.size();
    std::vector<bool> in_skin(n, false), has_mesh(n, false), below(n, false);
    for (const ImportedInstance& instance : scene_.instances) {
      has_mesh[at(instance.node)] = true;
      if (instance.skin < 0) continue;
      for (const int joint : scene_.skins[at(instance.skin)].joints) in_skin[at(joint)] = true;
    }
    const bool no_skin = std::none_of(in_skin.begin(), in_skin.end(), [](bool b) { return b; });
    keep_.assign(n, false);
    for (std::size_t i = 0; i < n; ++i) {
      const int parent = scene_.nodes[i].parent;
      below[i] = in_skin[i] || (parent >= 0 && below[at(parent)]);
      keep_[i] = in_skin[i] || ((below[i] || no_skin) && !has_mesh[i]);
    }
    for (const ImportedInstance& instance : scene_.instances) {
      if (instance.skin < 0 && animated(at(instance.node))) keep_[at(instance.node)] = true;
    }
    for (std::size_t i = n; i-- > 0;) {
      if (keep_[i] && scene_.nodes[i].parent >= 0) keep_[at(scene_.nodes[i].parent)] = true;
    }
    joint_of_node_.assign(n, -1);
    int next = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if (keep_[i]) joint_of_node_[i] = next++;
    }
    in_skin_ = std::move(in_skin);
  }

  void make_skeleton() {
    // Joints of the skin choose their names first, so that a mesh node cannot take "Head" away from the head.
    Names names;
    std::vector<std::string> name_of_node(scene_.nodes.size());
    for (const bool skin_joints : {true, false}) {
      for (std::size_t i = 0; i < scene_.nodes.size(); ++i) {
        if (!keep_[i] || in_skin_[i] != skin_joints) continue;
        name_of_node[i] = names.take(scene_.nodes[i].name, "joint_" + std::to_string(joint_of_node_[i]));
      }
    }
    std::vector<skeleton::Joint> joints;
    for (std::size_t i = 0; i < scene_.nodes.size(); ++i) {
      if (!keep_[i]) continue;
      const ImportedNode& node = scene_.nodes[i];
      skeleton::Joint joint;
      joint.name = name_of_node[i];
      joint.parent = node.parent < 0 ? -1 : joint_of_node_[at(node.parent)];
      joint.parent_from_joint = to_rig(node.parent_from_node, node.parent < 0);
      joint.local.translation = to_rig(node.local.translation, node.parent < 0);
      joint.local.rotation = to_rig(node.local.rotation, node.parent < 0);
      joint.local.scale = node.local.scale;
      joint.rest_from_joint = to_rig(rest_.rest_from_node[i], true);
      joints.push_back(std::move(joint));
    }
    report_names(names, "joint");
    try {
      rig_.skeleton = skeleton::Skeleton(std::move(joints));
    } catch (const std::invalid_argument& e) {
      throw InputError(rig_.file,
                       std::string(e.what()) + "; hint: bind the skin again while every joint has a size");
    }
  }

  void report_names(const Names& names, const std::string& kind) {
    if (names.num_invented > 0) {
      find(Finding::Severity::Info, "names-invented", "",
           std::to_string(names.num_invented) + " unnamed " + kind + "s were given names",
           "name them in the modelling program");
    }
    if (names.num_changed > 0) {
      find(Finding::Severity::Warning, "names-made-unique", "",
           std::to_string(names.num_changed) + " " + kind +
               " names were used twice; a number was put behind them",
           "give every " + kind + " a name of its own");
    }
  }

  // The rig's space is U = s Q after file world coordinates (s metres per unit, Q the turn to Y up). Joint
  // frames keep their size: world' = U world S^-1 with S the plain scaling by s, so local translations become
  // metres.

  Eigen::Affine3d to_rig(const Eigen::Affine3d& map, bool is_root) const {
    Eigen::Affine3d result;
    result.linear() = is_root ? Eigen::Matrix3d(turn_ * map.linear()) : Eigen::Matrix3d(map.linear());
    result.translation() = to_rig(Eigen::Vector3d(map.translation()), is_root);
    result.makeAffine();
    return result;
  }
  Eigen::Vector3d to_rig(const Eigen::Vector3d& translation, bool is_root) const {
    return rig_.metres_per_unit * (is_root ? Eigen::Vector3d(turn_ * translation) : translation);
  }
  Eigen::Quaterniond to_rig(const Eigen::Quaterniond& rotation, bool is_root) const {
    return is_root ? (Eigen::Quaterniond(turn_) * rotation).normalized() : rotation;
  }

  // ---- parts

  /// A rigid part hangs on the nearest joint above it; everything between is still.
  int joint_above(int node) const {
    while (node >= 0 && !keep_[at(node)]) node = scene_.nodes[at(node)].parent;
    return node;
  }

  void make_parts() {
    Names names;
    std::vector<int> uses(scene_.meshes.size(), 0);
    for (const ImportedInstance& instance : scene_.instances) ++uses[at(instance.mesh)];
    for (const ImportedInstance& instance : scene_.instances) {
      const ImportedMesh& mesh = scene_.meshes[at(instance.mesh)];
      if (mesh.triangles.rows() == 0) {
        find(Finding::Severity::Warning, "part-without-triangles", printable(mesh.name),
             "the mesh has no triangle and is left out");
        continue;
      }
      Part part;
      const std::string& node_name = scene_.nodes[at(instance.node)].name;
      const bool by_node = mesh.name.empty() || (uses[at(instance.mesh)] > 1 && !node_name.empty());
      part.name = names.take(by_node ? node_name : mesh.name, "part_" + std::to_string(rig_.parts.size()));
      Eigen::Affine3d rest_from_mesh;
      if (instance.skin >= 0) {
        part.role = PartRole::Simulated;
        rest_from_mesh = rest_.rest_from_mesh[at(instance.skin)];
        part.weights = mesh.weights;
        for (auto& influences : part.weights) {
          for (lattice::Influence& influence : influences) {
            influence.frame = joint_of_node_[at(scene_.skins[at(instance.skin)].joints[at(influence.frame)])];
          }
        }
      } else {
        part.role = PartRole::Rigid;
        const int joint_node = joint_above(instance.node);
        part.joint = joint_node < 0 ? -1 : joint_of_node_[at(joint_node)];
        rest_from_mesh = rest_.rest_from_node[at(instance.node)];
      }
      part.points = (mesh.points * rest_from_mesh.linear().transpose()).rowwise() +
                    rest_from_mesh.translation().transpose();
      part.triangles = mesh.triangles;
      if (rest_from_mesh.linear().determinant() < 0.0) part.triangles.col(1).swap(part.triangles.col(2));
      rig_.parts.push_back(std::move(part));
    }
    report_names(names, "part");
  }

  // ---- units

  /// Extents of what is simulated, else of any part, else of the joints.
  BodySize size_in_file_units() const {
    Eigen::AlignedBox3d flesh, any, joints;
    for (const Part& part : rig_.parts) {
      for (Eigen::Index v = 0; v < part.points.rows(); ++v) {
        any.extend(part.points.row(v).transpose());
        if (part.role == PartRole::Simulated) flesh.extend(part.points.row(v).transpose());
      }
    }
    for (std::size_t i = 0; i < scene_.nodes.size(); ++i) {
      if (keep_[i]) joints.extend(rest_.rest_from_node[i].translation());
    }
    const Eigen::AlignedBox3d& box = !flesh.isEmpty() ? flesh : !any.isEmpty() ? any : joints;
    if (box.isEmpty()) return {};
    return {box.sizes()[static_cast<int>(scene_.up_axis)], box.sizes().maxCoeff()};
  }

  void find_units() {
    const BodySize size = size_in_file_units();
    rig_.metres_per_unit = metres_per_unit(size, {scene_.metres_per_unit, scene_.unit_by_standard},
                                           options_.height, rig_.findings);
    rig_.height = size.height * rig_.metres_per_unit;
    turn_ = y_up_from(scene_.up_axis);
    rig_.rig_from_file.setIdentity();
    rig_.rig_from_file.linear() = rig_.metres_per_unit * turn_;
    for (Part& part : rig_.parts)
      part.points = (part.points * rig_.rig_from_file.linear().transpose()).eval();
  }

  // ---- clips

  /// Names are taken in the file's order, so that a faulty clip changes nobody else's.
  void make_clips() {
    std::map<int, const FaultyClip*> faulty;
    for (const FaultyClip& clip : scene_.faulty_clips) faulty[clip.index] = &clip;
    int index = 0;
    const auto name_faulty = [&] {
      for (auto at_index = faulty.find(index); at_index != faulty.end(); at_index = faulty.find(++index)) {
        FaultyClip clip = *at_index->second;
        clip.name = clip_names_.take(clip.name, "clip_" + std::to_string(index));
        const std::size_t hint = clip.reason.find("; hint: ");
        find(Finding::Severity::Warning, "clip-faulty", clip.name, clip.reason.substr(0, hint),
             hint == std::string::npos ? "export the clip again" : clip.reason.substr(hint + 8));
        rig_.faulty_clips.push_back(std::move(clip));
      }
    };
    for (std::size_t c = 0; c < scene_.clips.size(); ++c, ++index) {
      name_faulty();
      make_clip(c, "clip_" + std::to_string(index));
    }
    name_faulty();
  }

  void make_clip(std::size_t c, const std::string& otherwise) {
    skeleton::Clip clip;
    clip.name = clip_names_.take(scene_.clips[c].name, otherwise);
    std::set<double> keys;
    std::size_t num_dropped = 0;
    for (skeleton::Channel& source : scene_.clips[c].channels) {
      const ImportedNode& node = scene_.nodes[at(source.joint)];
      const bool is_root = node.parent < 0;
      // Readers sample what they compute for helpers; only the file's own keys count.
      const bool sampled = node.helper || (!is_root && scene_.nodes[at(node.parent)].helper);
      source.joint = joint_of_node_[at(source.joint)];
      if (source.joint < 0) {
        ++num_dropped;
        continue;
      }
      if (source.translation) convert(*source.translation, is_root, keys);
      if (source.rotation) convert(*source.rotation, is_root, clip.name, keys);
      if (source.scale && !sampled) keys.insert(source.scale->times.begin(), source.scale->times.end());
      clip.channels.push_back(std::move(source));
    }
    clip.num_keys = static_cast<int>(keys.size());
    if (!keys.empty()) {
      clip.start = *keys.begin();
      clip.end = *keys.rbegin();
    }
    if (num_dropped > 0) {
      find(Finding::Severity::Info, "channels-without-joint", clip.name,
           std::to_string(num_dropped) +
               " channels move cameras, lights or nodes that carry nothing; they are left out");
    }
    if (clip.channels.empty()) {
      find(Finding::Severity::Warning, "clip-empty", clip.name, "the clip moves no joint",
           "remove the clip or key the skeleton in it");
    }
    report_steps(clip);
    rig_.clips.push_back(std::move(clip));
  }

  void convert(skeleton::VectorTrack& track, bool is_root, std::set<double>& keys) const {
    for (auto* values : {&track.values, &track.in_tangents, &track.out_tangents}) {
      for (Eigen::Vector3d& value : *values) value = to_rig(value, is_root);
    }
    keys.insert(track.times.begin(), track.times.end());
  }

  void convert(skeleton::RotationTrack& track, bool is_root, const std::string& clip,
               std::set<double>& keys) {
    const Eigen::Quaterniond turn = is_root ? Eigen::Quaterniond(turn_) : Eigen::Quaterniond::Identity();
    double worst = 0.0;
    for (std::size_t k = 0; k < track.values.size(); ++k) {
      Eigen::Quaterniond& q = track.values[k];
      worst = std::max(worst, std::abs(q.norm() - 1.0));
      q = turn * q.normalized();
      // q and -q are one rotation; neighbours in one hemisphere make slerp take the short way. A cubic
      // spline's tangents belong to the sign the file chose.
      const bool cubic = track.interpolation == skeleton::Interpolation::CubicSpline;
      if (!cubic && k > 0 && track.values[k - 1].dot(q) < 0.0) q.coeffs() *= -1.0;
    }
    for (auto* tangents : {&track.in_tangents, &track.out_tangents}) {
      for (Eigen::Vector4d& tangent : *tangents) tangent = (turn * Eigen::Quaterniond(tangent)).coeffs();
    }
    keys.insert(track.times.begin(), track.times.end());
    if (worst > 0.01 && quaternions_reported_.insert(clip).second) {
      find(Finding::Severity::Warning, "quaternions-normalised", clip,
           "rotation keys are off unit length by up to " + number(worst) + "; they were normalised",
           "bake the animation and export again");
    }
  }

  /// Step keys are jumps; flesh answers them with a jolt, so their size is worth a word.
  void report_steps(const skeleton::Clip& clip) {
    double metres = 0.0, degrees = 0.0;
    for (const skeleton::Channel& channel : clip.channels) {
      if (channel.translation && channel.translation->interpolation == skeleton::Interpolation::Step) {
        const auto& values = channel.translation->values;
        for (std::size_t k = 1; k < values.size(); ++k)
          metres = std::max(metres, (values[k] - values[k - 1]).norm());
      }
      if (channel.rotation && channel.rotation->interpolation == skeleton::Interpolation::Step) {
        const auto& values = channel.rotation->values;
        for (std::size_t k = 1; k < values.size(); ++k) {
          degrees = std::max(degrees, values[k - 1].angularDistance(values[k]) * 180.0 / std::numbers::pi);
        }
      }
    }
    // Exporters write constant channels as steps; below a hundredth of a degree and of a millimetre nothing
    // jumps.
    if (metres < 1e-5 && degrees < 1e-2) return;
    find(Finding::Severity::Warning, "step-keys", clip.name,
         "joints jump between keys by up to " + number(metres) + " m and " + number(degrees) + " degrees",
         "export with linear or spline interpolation");
  }

  void report_collapses() {
    for (const skeleton::Clip& clip : rig_.clips) {
      const auto collapse = first_collapse(rig_, clip, clip.start, clip.end);
      if (!collapse) continue;
      find(Finding::Severity::Info, "flesh-scaled-to-nothing", clip.name,
           collapse_text(rig_, *collapse) + "; only frames before that can be simulated",
           "hide it by other means than its scale, or state the frames");
    }
  }

  // ---- verdict

  void judge() {
    const auto is_flesh = [](const Part& part) { return part.role == PartRole::Simulated; };
    const auto num_flesh = std::count_if(rig_.parts.begin(), rig_.parts.end(), is_flesh);
    if (num_flesh == 0) {
      find(Finding::Severity::Error, "no-skin", "",
           !rig_.parts.empty() ? "none of the file's meshes is bound to a skeleton"
                               : "the file holds no mesh of triangles" + what_was_left_out(),
           "export the character's mesh with its skin weights, skeleton and animation in one file");
    }
    std::vector<std::string> moving;
    for (const skeleton::Clip& clip : rig_.clips) {
      if (clip.num_keys >= 2 && clip.duration() > 0.0) moving.push_back("'" + clip.name + "'");
    }
    const auto pose = std::find_if(rig_.clips.begin(), rig_.clips.end(),
                                   [](const skeleton::Clip& clip) { return clip.num_keys >= 1; });
    if (moving.empty() && pose != rig_.clips.end()) {
      find(Finding::Severity::Warning, "clip-is-a-pose", pose->name,
           "no clip moves; this one holds a pose, in which the flesh settles",
           "export the character together with an animation if it should move");
    } else if (moving.empty()) {
      find(Finding::Severity::Error, "no-clip", "",
           rig_.clips.empty() ? "the file holds no animation" : "no clip keys a joint",
           "export the character together with an animation");
    } else if (moving.size() > 1) {
      find(Finding::Severity::Info, "several-clips", "",
           std::to_string(moving.size()) + " clips; " + moving.front() +
               " is taken unless `clip` names another");
    }
    if (num_flesh > 0) judge_joints();
  }

  /// Points, lines and empty meshes, for a file that holds nothing else.
  std::string what_was_left_out() const {
    std::string list;
    for (const Finding& finding : rig_.findings) {
      if (finding.code != "points-ignored" && finding.code != "lines-ignored") continue;
      list += (list.empty() ? ": " : ", ") + finding.message;
    }
    return list;
  }

  void judge_joints() {
    int without_weight = 0;
    for (std::size_t i = 0; i < scene_.nodes.size(); ++i) {
      if (in_skin_[i] && rest_.weight_of_node[i] <= 0.0) ++without_weight;
    }
    if (without_weight > 0) {
      find(Finding::Severity::Info, "joints-without-weight", "",
           std::to_string(without_weight) +
               " joints of the skin carry no weight; they steer, but flesh does not hang "
               "on them");
    }
  }

  ImportedScene scene_;
  const LoadOptions& options_;
  Rig rig_;
  RestPose rest_;
  std::vector<bool> keep_;     ///< per node: becomes a joint.
  std::vector<bool> in_skin_;  ///< per node: named by a skin that a mesh uses.
  std::vector<int> joint_of_node_;
  Eigen::Matrix3d turn_ = Eigen::Matrix3d::Identity();  ///< Q
  Names clip_names_;
  std::set<std::string> quaternions_reported_;
};

}  // namespace

Rig build_rig(const std::string& file, ImportedScene scene, const LoadOptions& options) {
  return RigBuilder(file, std::move(scene), options).run();
}

}  // namespace sinew::assets::detail
