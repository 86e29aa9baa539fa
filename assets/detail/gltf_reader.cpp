#include "assets/detail/gltf_reader.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#include <tiny_gltf.h>

#include "assets/detail/file_bytes.h"
#include "assets/detail/gltf_accessor.h"
#include "assets/detail/gltf_container.h"
#include "assets/detail/gltf_model.h"
#include "assets/detail/text.h"
#include "assets/detail/transforms.h"
#include "assets/error.h"

namespace sinew::assets::detail {

namespace {

class GltfReader {
 public:
  GltfReader(const std::string& file, const tinygltf::Model& model)
      : file_(file), model_(model), accessors_(file, model) {}

  ImportedScene run() {
    scene_.format = "glTF 2.0";
    scene_.metres_per_unit = 1.0;
    scene_.unit_by_standard = true;
    scene_.file_vertex_order = true;
    accessors_.check_all();
    order_nodes();
    read_nodes();
    for (std::size_t s = 0; s < model_.skins.size(); ++s) read_skin(s);
    for (std::size_t m = 0; m < model_.meshes.size(); ++m) read_mesh(m);
    place_instances();
    for (std::size_t a = 0; a < model_.animations.size(); ++a) try_animation(a);
    report_what_was_left_out();
    return std::move(scene_);
  }

 private:
  [[noreturn]] void refuse(const std::string& message) const { throw InputError(file_, message); }

  std::string node_label(std::size_t n) const {
    const std::string& name = model_.nodes[n].name;
    return "/nodes/" + std::to_string(n) + (name.empty() ? "" : " '" + printable(name) + "'");
  }

  template <typename T>
  void check_index(const std::string& user, int index, const std::vector<T>& among) const {
    if (index >= 0 && static_cast<std::size_t>(index) < among.size()) return;
    refuse(user + ": index, got " + std::to_string(index) + ", expected 0 to " +
           std::to_string(static_cast<long>(among.size()) - 1) + "; hint: export the file again");
  }

  // ---- nodes

  /// Parents before children, children in the file's order.
  void order_nodes() {
    const std::size_t n = model_.nodes.size();
    parent_.assign(n, -1);
    for (std::size_t i = 0; i < n; ++i) {
      for (const int child : model_.nodes[i].children) {
        check_index(node_label(i) + "/children", child, model_.nodes);
        int& parent = parent_[static_cast<std::size_t>(child)];
        if (parent >= 0) {
          refuse(node_label(static_cast<std::size_t>(child)) + ": has two parents, got " +
                 node_label(static_cast<std::size_t>(parent)) + " and " + node_label(i) +
                 ", expected one; hint: export the file again");
        }
        parent = static_cast<int>(i);
      }
    }
    new_index_.assign(n, -1);
    std::vector<int> stack;
    for (std::size_t i = n; i-- > 0;) {
      if (parent_[i] < 0) stack.push_back(static_cast<int>(i));
    }
    while (!stack.empty()) {
      const auto node = static_cast<std::size_t>(stack.back());
      stack.pop_back();
      new_index_[node] = static_cast<int>(order_.size());
      order_.push_back(node);
      const std::vector<int>& children = model_.nodes[node].children;
      stack.insert(stack.end(), children.rbegin(), children.rend());
    }
    if (order_.size() != n) refuse_cycle();
  }

  /// Every node that no root reaches has a cycle above it (each has one parent).
  [[noreturn]] void refuse_cycle() const {
    std::size_t at = 0;
    while (new_index_[at] >= 0) ++at;
    for (std::size_t i = 0; i < model_.nodes.size(); ++i) at = static_cast<std::size_t>(parent_[at]);
    std::string cycle = node_label(at);
    for (auto i = static_cast<std::size_t>(parent_[at]); i != at; i = static_cast<std::size_t>(parent_[i])) {
      cycle = node_label(i) + " -> " + cycle;
    }
    refuse("nodes: a node is its own ancestor, got " + node_label(at) + " -> " + cycle +
           ", expected a tree; hint: export the file again");
  }

  void read_nodes() {
    for (const std::size_t n : order_) {
      const tinygltf::Node& node = model_.nodes[n];
      ImportedNode out;
      out.name = node.name;
      out.parent = parent_[n] < 0 ? -1 : new_index_[static_cast<std::size_t>(parent_[n])];
      if (!node.matrix.empty()) {
        check_length(n, "matrix", node.matrix, 16);
        Eigen::Matrix4d m = Eigen::Map<const Eigen::Matrix4d>(node.matrix.data());
        if (m.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
          refuse(node_label(n) + "/matrix: last row is not 0 0 0 1, expected an affine map");
        }
        out.parent_from_node.matrix() = m;
        if (m.allFinite()) out.local = decompose(out.parent_from_node);
      } else {
        out.local = read_parts(n, node);
        out.parent_from_node = out.local.matrix();
      }
      scene_.nodes.push_back(std::move(out));
    }
  }

  void check_length(std::size_t n, const char* what, const std::vector<double>& values,
                    std::size_t expected) const {
    if (values.size() == expected) return;
    refuse(node_label(n) + "/" + what + ": number of values, got " + std::to_string(values.size()) +
           ", expected " + std::to_string(expected) + "; hint: export the file again");
  }

  skeleton::LocalTransform read_parts(std::size_t n, const tinygltf::Node& node) const {
    skeleton::LocalTransform local;
    if (!node.translation.empty()) {
      check_length(n, "translation", node.translation, 3);
      local.translation = Eigen::Map<const Eigen::Vector3d>(node.translation.data());
    }
    if (!node.scale.empty()) {
      check_length(n, "scale", node.scale, 3);
      local.scale = Eigen::Map<const Eigen::Vector3d>(node.scale.data());
    }
    if (!node.rotation.empty()) {
      check_length(n, "rotation", node.rotation, 4);
      Eigen::Quaterniond q;
      q.coeffs() = Eigen::Map<const Eigen::Vector4d>(node.rotation.data());  // both store x, y, z, w
      if (!(q.norm() > 1e-6)) {
        refuse(node_label(n) + "/rotation: quaternion of length " + number(q.norm()) + ", expected length 1");
      }
      local.rotation = q.normalized();
    }
    return local;
  }

  // ---- skins and meshes

  void read_skin(std::size_t s) {
    const tinygltf::Skin& skin = model_.skins[s];
    const std::string path = "/skins/" + std::to_string(s);
    ImportedSkin out;
    for (const int joint : skin.joints) {
      check_index(path + "/joints", joint, model_.nodes);
      out.joints.push_back(new_index_[static_cast<std::size_t>(joint)]);
    }
    if (out.joints.empty()) refuse(path + "/joints: got none, expected at least one");
    out.joint_from_mesh.assign(out.joints.size(), Eigen::Affine3d::Identity());
    if (skin.inverseBindMatrices >= 0) {
      const std::string user = path + "/inverseBindMatrices";
      const std::size_t count = accessors_.count(skin.inverseBindMatrices, user);
      if (count < out.joints.size()) {
        refuse(user + ": number of matrices, got " + std::to_string(count) + ", expected " +
               std::to_string(out.joints.size()) + ", one per joint; hint: bind the skin again");
      }
      const std::vector<double> values = accessors_.read(skin.inverseBindMatrices, "MAT4", user);
      for (std::size_t j = 0; j < out.joints.size(); ++j) {
        out.joint_from_mesh[j].matrix() = Eigen::Map<const Eigen::Matrix4d>(values.data() + 16 * j);
        // Exporters leave rounding in the last row; nothing else may stand there.
        const Eigen::RowVector4d last = out.joint_from_mesh[j].matrix().row(3);
        if (!((last - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() < 1e-3) && last.allFinite()) {
          refuse(user + ": matrix " + std::to_string(j) + " is not affine, expected last row 0 0 0 1");
        }
        out.joint_from_mesh[j].makeAffine();
      }
    }
    scene_.skins.push_back(std::move(out));
  }

  void read_mesh(std::size_t m) {
    const tinygltf::Mesh& mesh = model_.meshes[m];
    for (std::size_t p = 0; p < mesh.primitives.size(); ++p) {
      const tinygltf::Primitive& primitive = mesh.primitives[p];
      const std::string path = "/meshes/" + std::to_string(m) + "/primitives/" + std::to_string(p);
      num_morph_targets_ += primitive.targets.size();
      const int mode = primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
      if (mode < TINYGLTF_MODE_TRIANGLES) {
        ++(mode == TINYGLTF_MODE_POINTS ? num_point_sets_ : num_line_sets_);
        continue;
      }
      if (mode > TINYGLTF_MODE_TRIANGLE_FAN) {
        refuse(path + "/mode: got " + std::to_string(mode) + ", expected 0 to 6");
      }
      ImportedMesh out;
      out.name =
          mesh.name.empty() || mesh.primitives.size() == 1 ? mesh.name : mesh.name + "." + std::to_string(p);
      read_points(primitive, path, out);
      read_triangles(primitive, mode, path, out);
      read_weights(primitive, path, out);
      meshes_of_[m].push_back(static_cast<int>(scene_.meshes.size()));
      scene_.meshes.push_back(std::move(out));
    }
  }

  void read_points(const tinygltf::Primitive& primitive, const std::string& path, ImportedMesh& out) const {
    const auto position = primitive.attributes.find("POSITION");
    if (position == primitive.attributes.end()) {
      refuse(path + "/attributes: POSITION is missing; hint: export the file again");
    }
    const std::vector<double> values =
        accessors_.read(position->second, "VEC3", path + "/attributes/POSITION");
    out.points =
        Eigen::Map<const lattice::Points>(values.data(), static_cast<Eigen::Index>(values.size() / 3), 3);
  }

  void read_triangles(const tinygltf::Primitive& primitive, int mode, const std::string& path,
                      ImportedMesh& out) const {
    const auto num_vertices = static_cast<std::size_t>(out.points.rows());
    std::vector<std::uint32_t> corners;
    if (primitive.indices >= 0) {
      corners = accessors_.read_indices(primitive.indices, num_vertices, path + "/indices");
    } else {
      corners.resize(num_vertices);
      for (std::size_t i = 0; i < num_vertices; ++i) corners[i] = static_cast<std::uint32_t>(i);
    }
    const bool list = mode == TINYGLTF_MODE_TRIANGLES;
    const std::size_t count = list ? corners.size() / 3 : corners.size() < 3 ? 0 : corners.size() - 2;
    out.triangles.resize(static_cast<Eigen::Index>(count), 3);
    for (std::size_t t = 0; t < count; ++t) {
      // glTF 2.0, section 3.7.2.1: p_i = {v_i, v_(i + 1 + i mod 2), v_(i + 2 - i mod 2)} in a strip,
      // {v_(i+1), v_(i+2), v_0} in a fan.
      const std::size_t odd = t % 2;
      const std::array<std::size_t, 3> at = list ? std::array<std::size_t, 3>{3 * t, 3 * t + 1, 3 * t + 2}
                                            : mode == TINYGLTF_MODE_TRIANGLE_STRIP
                                                ? std::array<std::size_t, 3>{t, t + 1 + odd, t + 2 - odd}
                                                : std::array<std::size_t, 3>{t + 1, t + 2, 0};
      for (std::size_t c = 0; c < 3; ++c) {
        out.triangles(static_cast<Eigen::Index>(t), static_cast<Eigen::Index>(c)) =
            static_cast<int>(corners[at[c]]);
      }
    }
  }

  void read_weights(const tinygltf::Primitive& primitive, const std::string& path, ImportedMesh& out) const {
    const auto num_vertices = static_cast<std::size_t>(out.points.rows());
    for (int set = 0;; ++set) {
      const auto joints = primitive.attributes.find("JOINTS_" + std::to_string(set));
      const auto weights = primitive.attributes.find("WEIGHTS_" + std::to_string(set));
      const bool have_joints = joints != primitive.attributes.end();
      const bool have_weights = weights != primitive.attributes.end();
      if (!have_joints && !have_weights) return;
      if (have_joints != have_weights) {
        refuse(path + "/attributes: JOINTS_" + std::to_string(set) + " and WEIGHTS_" + std::to_string(set) +
               " belong together, got one of them");
      }
      const std::vector<double> j = read_attribute(joints->second, path, joints->first, num_vertices);
      const std::vector<double> w = read_attribute(weights->second, path, weights->first, num_vertices);
      out.weights.resize(num_vertices);
      for (std::size_t i = 0; i < j.size(); ++i) {
        if (w[i] != 0.0) out.weights[i / 4].push_back({static_cast<int>(j[i]), w[i]});
      }
    }
  }

  std::vector<double> read_attribute(int accessor, const std::string& path, const std::string& name,
                                     std::size_t num_vertices) const {
    const std::string user = path + "/attributes/" + name;
    const std::size_t count = accessors_.count(accessor, user);
    if (count != num_vertices) {
      refuse(user + ": number of elements, got " + std::to_string(count) + ", expected " +
             std::to_string(num_vertices) + " as in POSITION");
    }
    return accessors_.read(accessor, "VEC4", user);
  }

  // ---- scene

  /// Per node whether a scene of the file shows it.
  std::vector<bool> shown_in(int scene) const {
    std::vector<bool> shown(model_.nodes.size(), false);
    const std::string path = "/scenes/" + std::to_string(scene) + "/nodes";
    for (const int root : model_.scenes[static_cast<std::size_t>(scene)].nodes) {
      check_index(path, root, model_.nodes);
      shown[static_cast<std::size_t>(root)] = true;
    }
    for (const std::size_t n : order_) {
      if (parent_[n] >= 0 && shown[static_cast<std::size_t>(parent_[n])]) shown[n] = true;
    }
    return shown;
  }

  bool has_character(const std::vector<bool>& shown) const {
    for (std::size_t n = 0; n < shown.size(); ++n) {
      if (shown[n] && model_.nodes[n].mesh >= 0 && model_.nodes[n].skin >= 0) return true;
    }
    return false;
  }

  /// The file's default scene, or the first other one where only that shows a skinned mesh.
  std::vector<bool> shown_nodes() {
    if (model_.scenes.empty()) return std::vector<bool>(model_.nodes.size(), true);
    const int wanted = model_.defaultScene < 0 ? 0 : model_.defaultScene;
    check_index("/scene", wanted, model_.scenes);
    std::vector<bool> shown = shown_in(wanted);
    if (has_character(shown)) return shown;
    for (int scene = 0; scene < static_cast<int>(model_.scenes.size()); ++scene) {
      std::vector<bool> other = shown_in(scene);
      if (!has_character(other)) continue;
      const std::string& name = model_.scenes[static_cast<std::size_t>(scene)].name;
      scene_.findings.push_back({Finding::Severity::Warning, "other-scene-taken", printable(name),
                                 "the default scene " + std::to_string(wanted) +
                                     " shows no skinned mesh; scene " + std::to_string(scene) +
                                     " does and is taken",
                                 "make it the default scene"});
      return other;
    }
    return shown;
  }

  void place_instances() {
    for (std::size_t n = 0; n < model_.nodes.size(); ++n) {
      const tinygltf::Node& node = model_.nodes[n];
      if (node.mesh < 0) continue;
      check_index(node_label(n) + "/mesh", node.mesh, model_.meshes);
      if (node.skin >= 0) check_index(node_label(n) + "/skin", node.skin, model_.skins);
    }
    const std::vector<bool> shown = shown_nodes();
    for (const std::size_t n : order_) {
      const tinygltf::Node& node = model_.nodes[n];
      if (node.mesh < 0 || !shown[n]) continue;
      const auto meshes = meshes_of_.find(static_cast<std::size_t>(node.mesh));
      if (meshes == meshes_of_.end()) continue;
      for (const int mesh : meshes->second) {
        const bool weighted = !scene_.meshes[static_cast<std::size_t>(mesh)].weights.empty();
        scene_.instances.push_back({new_index_[n], mesh, weighted ? node.skin : -1});
      }
    }
  }

  // ---- animations

  /// One faulty clip of several is no reason to do without the others.
  void try_animation(std::size_t a) {
    const std::string& name = model_.animations[a].name;
    try {
      scene_.clips.push_back(read_animation(a));
    } catch (const InputError& e) {
      const std::string clip = name.empty() ? "clip " + std::to_string(a) : "clip '" + printable(name) + "'";
      scene_.faulty_clips.push_back({name, clip + ": " + without_file(file_, e.what()), static_cast<int>(a)});
    }
  }

  skeleton::Clip read_animation(std::size_t a) {
    const tinygltf::Animation& animation = model_.animations[a];
    const std::string path = "/animations/" + std::to_string(a);
    skeleton::Clip clip;
    clip.name = animation.name;
    std::vector<std::string> foreign;
    std::map<int, skeleton::Channel> channels;
    for (std::size_t c = 0; c < animation.channels.size(); ++c) {
      const tinygltf::AnimationChannel& channel = animation.channels[c];
      const std::string user = path + "/channels/" + std::to_string(c);
      if (channel.target_path == "weights") {
        ++num_morph_channels_;
        continue;
      }
      // Without a node the target belongs to an extension.
      if (channel.target_node < 0) {
        foreign.push_back(foreign_target(channel, c));
        continue;
      }
      check_index(user + "/sampler", channel.sampler, animation.samplers);
      check_index(user + "/target/node", channel.target_node, model_.nodes);
      const int node = new_index_[static_cast<std::size_t>(channel.target_node)];
      skeleton::Channel& out = channels[node];
      out.joint = node;
      read_channel(animation.samplers[static_cast<std::size_t>(channel.sampler)],
                   path + "/samplers/" + std::to_string(channel.sampler), channel.target_path, user, out);
    }
    for (auto& [node, channel] : channels) clip.channels.push_back(std::move(channel));
    report_foreign(clip.name, foreign);
    return clip;
  }

  /// "channel 2 (KHR_animation_pointer '/materials/0/emissiveFactor')".
  static std::string foreign_target(const tinygltf::AnimationChannel& channel, std::size_t c) {
    std::string what = "channel " + std::to_string(c);
    if (channel.target_extensions.empty()) return what;
    const auto& [name, value] = *channel.target_extensions.begin();
    what += " (" + printable(name);
    if (value.Has("pointer") && value.Get("pointer").IsString())
      what += " '" + printable(value.Get("pointer").Get<std::string>()) + "'";
    return what + ")";
  }

  void report_foreign(const std::string& clip, const std::vector<std::string>& foreign) {
    constexpr std::size_t kNamed = 3;
    if (foreign.empty()) return;
    std::string named;
    for (std::size_t i = 0; i < std::min(foreign.size(), kNamed); ++i)
      named += (i > 0 ? ", " : "") + foreign[i];
    if (foreign.size() > kNamed) named += " and " + std::to_string(foreign.size() - kNamed) + " more";
    scene_.findings.push_back({Finding::Severity::Warning, "channels-ignored", printable(clip),
                               named + ": no node is animated there; left out", ""});
  }

  void read_channel(const tinygltf::AnimationSampler& sampler, const std::string& path,
                    const std::string& target, const std::string& user, skeleton::Channel& out) const {
    const bool twice = (target == "translation" && out.translation) ||
                       (target == "rotation" && out.rotation) || (target == "scale" && out.scale);
    if (twice) refuse(user + "/target: node's " + target + " is animated twice in one clip, expected once");
    skeleton::Interpolation interpolation = skeleton::Interpolation::Linear;
    if (sampler.interpolation == "STEP") {
      interpolation = skeleton::Interpolation::Step;
    } else if (sampler.interpolation == "CUBICSPLINE") {
      interpolation = skeleton::Interpolation::CubicSpline;
    } else if (sampler.interpolation != "LINEAR" && !sampler.interpolation.empty()) {
      refuse(path + "/interpolation: got '" + printable(sampler.interpolation) +
             "', expected LINEAR, STEP or CUBICSPLINE");
    }
    const std::vector<double> times = accessors_.read(sampler.input, "SCALAR", path + "/input");
    const std::size_t per_key = interpolation == skeleton::Interpolation::CubicSpline ? 3 : 1;
    const std::string output = path + "/output";
    const std::size_t count = accessors_.count(sampler.output, output);
    if (count != per_key * times.size()) {
      refuse(output + ": number of values, got " + std::to_string(count) + ", expected " +
             std::to_string(per_key * times.size()) + " for " + std::to_string(times.size()) + " keys");
    }
    if (target == "rotation") {
      out.rotation = read_rotations(interpolation, times, accessors_.read(sampler.output, "VEC4", output));
    } else if (target == "translation" || target == "scale") {
      auto track = read_vectors(interpolation, times, accessors_.read(sampler.output, "VEC3", output));
      (target == "scale" ? out.scale : out.translation) = std::move(track);
    } else {
      refuse(user + "/target/path: got '" + printable(target) +
             "', expected translation, rotation, scale or weights");
    }
  }

  static skeleton::VectorTrack read_vectors(skeleton::Interpolation interpolation,
                                            const std::vector<double>& times,
                                            const std::vector<double>& values) {
    skeleton::VectorTrack track;
    track.interpolation = interpolation;
    track.times = times;
    const auto at = [&](std::size_t i) {
      return Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(&values[3 * i]));
    };
    for (std::size_t k = 0; k < times.size(); ++k) {
      if (interpolation == skeleton::Interpolation::CubicSpline) {
        track.in_tangents.push_back(at(3 * k));
        track.values.push_back(at(3 * k + 1));
        track.out_tangents.push_back(at(3 * k + 2));
      } else {
        track.values.push_back(at(k));
      }
    }
    return track;
  }

  static skeleton::RotationTrack read_rotations(skeleton::Interpolation interpolation,
                                                const std::vector<double>& times,
                                                const std::vector<double>& values) {
    skeleton::RotationTrack track;
    track.interpolation = interpolation;
    track.times = times;
    const auto at = [&](std::size_t i) {
      return Eigen::Vector4d(Eigen::Map<const Eigen::Vector4d>(&values[4 * i]));
    };
    for (std::size_t k = 0; k < times.size(); ++k) {
      if (interpolation == skeleton::Interpolation::CubicSpline) {
        track.in_tangents.push_back(at(3 * k));
        track.values.emplace_back(at(3 * k + 1));
        track.out_tangents.push_back(at(3 * k + 2));
      } else {
        track.values.emplace_back(at(k));
      }
    }
    return track;
  }

  void report_what_was_left_out() {
    const auto note = [this](const char* code, std::size_t count, const std::string& message) {
      if (count == 0) return;
      scene_.findings.push_back(
          {Finding::Severity::Warning, code, "", std::to_string(count) + " " + message, ""});
    };
    note("points-ignored", num_point_sets_, "primitives of points only are left out");
    note("lines-ignored", num_line_sets_, "primitives of lines only are left out");
    note("morph-targets-ignored", num_morph_targets_ + num_morph_channels_,
         "morph targets and their channels are left out: the mesh is taken without them");
  }

  const std::string& file_;
  const tinygltf::Model& model_;
  GltfAccessors accessors_;
  ImportedScene scene_;
  std::vector<int> parent_;                            ///< by the file's node index.
  std::vector<int> new_index_;                         ///< file's node index to ours.
  std::vector<std::size_t> order_;                     ///< ours to the file's.
  std::map<std::size_t, std::vector<int>> meshes_of_;  ///< glTF mesh to its primitives among scene_.meshes.
  std::size_t num_point_sets_ = 0, num_line_sets_ = 0, num_morph_targets_ = 0, num_morph_channels_ = 0;
};

}  // namespace

ImportedScene read_gltf(const std::string& file) {
  tinygltf::Model model;
  {
    const GltfContainer container = read_gltf_container(file, read_whole(file));
    parse_gltf(file, container, model);
  }
  return GltfReader(file, model).run();
}

}  // namespace sinew::assets::detail
