#include <cmath>
#include <set>
#include <string>
#include <utility>

#include "assets/detail/imported_scene.h"
#include "assets/detail/text.h"
#include "assets/error.h"

namespace sinew::assets::detail {

namespace {

constexpr std::array<char, 3> kAxis{'x', 'y', 'z'};

std::string quoted(const std::string& kind, const std::string& name, std::size_t index) {
  if (name.empty()) return kind + " " + std::to_string(index);
  return std::string(kind).append(" '").append(printable(name)).append("'");
}

bool in_range(int index, std::size_t size) { return index >= 0 && static_cast<std::size_t>(index) < size; }

/// One file under examination: gathers what every message needs.
class Checker {
 public:
  Checker(const std::string& file, ImportedScene& scene) : file_(file), scene_(scene) {}

  void run() {
    for (std::size_t n = 0; n < scene_.nodes.size(); ++n) check_node(n);
    for (std::size_t s = 0; s < scene_.skins.size(); ++s) check_skin(s);
    for (std::size_t m = 0; m < scene_.meshes.size(); ++m) check_mesh(m);
    for (const ImportedInstance& instance : scene_.instances) check_instance(instance);
    set_faulty_clips_aside();
  }

 private:
  [[noreturn]] void refuse(const std::string& message) const { throw InputError(file_, message); }

  void check_node(std::size_t n) const {
    const ImportedNode& node = scene_.nodes[n];
    const std::string thing = quoted("node", node.name, n);
    if (node.parent < -1 || node.parent >= static_cast<int>(n)) {
      refuse(thing + ": parent out of order, got " + std::to_string(node.parent));
    }
    if (!node.parent_from_node.matrix().allFinite() || !node.local.translation.allFinite() ||
        !node.local.rotation.coeffs().allFinite() || !node.local.scale.allFinite()) {
      refuse(thing +
             ": transform is not a number, got nan or inf, expected finite numbers; hint: remove the node's "
             "broken transform and export again");
    }
  }

  void check_skin(std::size_t s) const {
    const ImportedSkin& skin = scene_.skins[s];
    const std::string thing = "skin " + std::to_string(s);
    if (skin.joints.empty() || skin.joints.size() != skin.joint_from_mesh.size()) {
      refuse(thing + ": needs one inverse bind matrix per joint, got " +
             std::to_string(skin.joint_from_mesh.size()) + ", expected " +
             std::to_string(skin.joints.size()));
    }
    if (skin.world_from_mesh && !skin.world_from_mesh->matrix().allFinite()) {
      refuse(thing + ": bind pose of the mesh is not a number, got nan or inf, expected finite numbers");
    }
    for (std::size_t j = 0; j < skin.joints.size(); ++j) {
      if (!in_range(skin.joints[j], scene_.nodes.size())) {
        refuse(thing + ": joint " + std::to_string(j) + " is not a node, got " +
               std::to_string(skin.joints[j]) + ", expected 0 to " + std::to_string(scene_.nodes.size() - 1));
      }
      const Eigen::Affine3d& bind = skin.joint_from_mesh[j];
      const std::string joint = "joint '" + printable(name_of(scene_, skin.joints[j])) + "'";
      if (!bind.matrix().allFinite()) {
        refuse(joint +
               ": inverse bind matrix is not a number, got nan or inf, expected finite numbers; hint: bind "
               "the skin again");
      }
      const Eigen::Matrix3d a = bind.linear();
      const double lengths = a.col(0).norm() * a.col(1).norm() * a.col(2).norm();
      // The same bound as Skeleton's own.
      if (!(std::abs(a.determinant()) > 1e-12 * lengths) || !(lengths > 0.0)) {
        refuse(joint + ": inverse bind matrix is singular, got determinant " + number(a.determinant()) +
               ", expected not 0; hint: bind the skin again while the joint has a size");
      }
    }
  }

  void check_mesh(std::size_t m) const {
    const ImportedMesh& mesh = scene_.meshes[m];
    const std::string thing = quoted("mesh", mesh.name, m);
    for (Eigen::Index v = 0; v < mesh.points.rows(); ++v) {
      for (int c = 0; c < 3; ++c) {
        if (std::isfinite(mesh.points(v, c))) continue;
        refuse(thing + ": vertex " + std::to_string(v) + ": " + kAxis[static_cast<std::size_t>(c)] +
               " coordinate, got " + number(mesh.points(v, c)) +
               ", expected a finite number; hint: delete the broken vertices and export again");
      }
    }
    for (Eigen::Index t = 0; t < mesh.triangles.rows(); ++t) {
      for (int c = 0; c < 3; ++c) {
        if (in_range(mesh.triangles(t, c), static_cast<std::size_t>(mesh.points.rows()))) continue;
        refuse(thing + ": triangle " + std::to_string(t) + ": vertex index, got " +
               std::to_string(mesh.triangles(t, c)) + ", expected 0 to " +
               std::to_string(mesh.points.rows() - 1));
      }
    }
    if (!mesh.weights.empty() && mesh.weights.size() != static_cast<std::size_t>(mesh.points.rows())) {
      refuse(thing + ": weights for " + std::to_string(mesh.weights.size()) + " vertices, expected " +
             std::to_string(mesh.points.rows()));
    }
  }

  void check_instance(const ImportedInstance& instance) const {
    if (!in_range(instance.node, scene_.nodes.size()) || !in_range(instance.mesh, scene_.meshes.size()) ||
        (instance.skin != -1 && !in_range(instance.skin, scene_.skins.size()))) {
      refuse("instance of mesh " + std::to_string(instance.mesh) + " at node " +
             std::to_string(instance.node) + " with skin " + std::to_string(instance.skin) +
             ": out of range");
    }
    if (instance.skin < 0) return;
    const auto mesh_index = static_cast<std::size_t>(instance.mesh);
    const ImportedMesh& mesh = scene_.meshes[mesh_index];
    const std::size_t num_joints = scene_.skins[static_cast<std::size_t>(instance.skin)].joints.size();
    for (std::size_t v = 0; v < mesh.weights.size(); ++v) {
      for (const lattice::Influence& influence : mesh.weights[v]) {
        const std::string thing = quoted("mesh", mesh.name, mesh_index) + ": vertex " + std::to_string(v);
        if (!in_range(influence.frame, num_joints)) {
          refuse(thing + ": joint index, got " + std::to_string(influence.frame) + ", expected 0 to " +
                 std::to_string(num_joints - 1) + "; hint: bind the skin again");
        }
        // What is no number counts as no weight: normalise_weights().
        if (std::isfinite(influence.weight) && influence.weight < 0.0) {
          const auto& joints = scene_.skins[static_cast<std::size_t>(instance.skin)].joints;
          refuse(thing + ": weight of joint '" +
                 printable(name_of(scene_, joints[static_cast<std::size_t>(influence.frame)])) + "', got " +
                 number(influence.weight) +
                 ", expected a number >= 0; hint: normalise the weights and export again");
        }
      }
    }
  }

  void check_times(const std::string& thing, const std::vector<double>& times) const {
    if (times.empty()) refuse(thing + ": has no keys, expected at least one; hint: remove the empty channel");
    for (std::size_t k = 0; k < times.size(); ++k) {
      if (!std::isfinite(times[k])) {
        refuse(thing + ": key " + std::to_string(k) + ": time, got " + number(times[k]) +
               ", expected a finite number");
      }
      if (k > 0 && !(times[k] > times[k - 1])) {
        refuse(thing + ": key " + std::to_string(k) + ": times do not increase, got " + number(times[k]) +
               " s after " + number(times[k - 1]) + " s; hint: bake the animation and export again");
      }
    }
  }

  template <typename Track>
  void check_sizes(const std::string& thing, const Track& track) const {
    check_times(thing, track.times);
    const bool cubic = track.interpolation == skeleton::Interpolation::CubicSpline;
    const std::size_t tangents = cubic ? track.times.size() : 0;
    if (track.values.size() != track.times.size() || track.in_tangents.size() != tangents ||
        track.out_tangents.size() != tangents) {
      refuse(thing + ": " + std::to_string(track.values.size()) + " values for " +
             std::to_string(track.times.size()) + " keys");
    }
    for (std::size_t k = 0; k < tangents; ++k) {
      if (!track.in_tangents[k].allFinite() || !track.out_tangents[k].allFinite()) {
        refuse(thing + ": key " + std::to_string(k) + " at " + number(track.times[k]) +
               " s: tangent, got nan or inf, expected finite numbers");
      }
    }
  }

  void check_vectors(const std::string& thing, const skeleton::VectorTrack& track) const {
    check_sizes(thing, track);
    for (std::size_t k = 0; k < track.values.size(); ++k) {
      for (int c = 0; c < 3; ++c) {
        if (std::isfinite(track.values[k][c])) continue;
        refuse(thing + ": key " + std::to_string(k) + " at " + number(track.times[k]) +
               " s: " + kAxis[static_cast<std::size_t>(c)] + " value, got " + number(track.values[k][c]) +
               ", expected a finite number; hint: bake the animation and export again");
      }
    }
  }

  void check_rotations(const std::string& thing, const skeleton::RotationTrack& track) const {
    check_sizes(thing, track);
    for (std::size_t k = 0; k < track.values.size(); ++k) {
      const double norm = track.values[k].norm();
      // Below 1e-6 a quaternion in single precision has lost its direction; real exporters are within 1e-2
      // of 1.
      if (std::isfinite(norm) && norm > 1e-6) continue;
      refuse(thing + ": key " + std::to_string(k) + " at " + number(track.times[k]) +
             " s: quaternion of length " + number(norm) +
             ", expected length 1; hint: bake the animation and export again");
    }
  }

  void set_faulty_clips_aside() {
    std::set<int> known;
    for (const FaultyClip& faulty : scene_.faulty_clips) known.insert(faulty.index);
    std::vector<skeleton::Clip> good;
    int index = -1;
    for (skeleton::Clip& clip : scene_.clips) {
      while (known.contains(++index)) continue;
      try {
        check_clip(clip, index);
        good.push_back(std::move(clip));
      } catch (const InputError& e) {
        scene_.faulty_clips.push_back({clip.name, without_file(file_, e.what()), index});
      }
    }
    scene_.clips = std::move(good);
    if (scene_.clips.empty() && !scene_.faulty_clips.empty()) refuse(scene_.faulty_clips.front().reason);
  }

  void check_clip(const skeleton::Clip& clip, int index) const {
    const std::string thing = quoted("clip", clip.name, static_cast<std::size_t>(index));
    std::vector<bool> seen(scene_.nodes.size(), false);
    for (const skeleton::Channel& channel : clip.channels) {
      if (!in_range(channel.joint, scene_.nodes.size())) {
        refuse(thing + ": channel for node " + std::to_string(channel.joint) + ", expected 0 to " +
               std::to_string(scene_.nodes.size()));
      }
      const std::string node = thing + ": node '" + printable(name_of(scene_, channel.joint)) + "': ";
      if (seen[static_cast<std::size_t>(channel.joint)])
        refuse(node + "animated by two channels, expected one");
      seen[static_cast<std::size_t>(channel.joint)] = true;
      if (channel.translation) check_vectors(node + "translation", *channel.translation);
      if (channel.rotation) check_rotations(node + "rotation", *channel.rotation);
      if (channel.scale) check_vectors(node + "scale", *channel.scale);
    }
  }

  const std::string& file_;
  ImportedScene& scene_;
};

}  // namespace

std::string name_of(const ImportedScene& scene, int node) {
  const std::string& name = scene.nodes[static_cast<std::size_t>(node)].name;
  return name.empty() ? "node " + std::to_string(node) : name;
}

void check_scene(const std::string& file, ImportedScene& scene) { Checker(file, scene).run(); }

}  // namespace sinew::assets::detail
