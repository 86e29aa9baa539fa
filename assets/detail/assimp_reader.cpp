#include "assets/detail/assimp_reader.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <assimp/Importer.hpp>
#include <assimp/config.h>
#include <assimp/importerdesc.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "assets/detail/fbx_bind.h"
#include "assets/detail/fbx_document.h"
#include "assets/detail/fbx_inheritance.h"
#include "assets/detail/file_bytes.h"
#include "assets/detail/text.h"
#include "assets/detail/transforms.h"
#include "assets/error.h"

namespace sinew::assets::detail {

namespace {

/// Ticks per second where a file leaves them out; assimp's own convention.
constexpr double kDefaultTicksPerSecond = 25.0;

Eigen::Affine3d affine(const aiMatrix4x4& m) {
  Eigen::Affine3d a;
  a.matrix() << m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4, 0, 0, 0, 1;
  return a;
}

Eigen::Vector3d vector(const aiVector3D& v) { return {v.x, v.y, v.z}; }

std::string text(const aiString& s) { return std::string(s.data, s.length); }

std::string lower_extension(const std::string& file) {
  std::string extension = std::filesystem::path(file).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

class AssimpReader {
 public:
  AssimpReader(const std::string& file, const aiScene& source) : file_(file), source_(source) {}

  ImportedScene run() {
    read_nodes();
    read_conventions();
    for (unsigned m = 0; m < source_.mNumMeshes; ++m) read_mesh(*source_.mMeshes[m]);
    place_instances();
    for (unsigned a = 0; a < source_.mNumAnimations; ++a) read_clip(*source_.mAnimations[a]);
    report();
    return std::move(scene_);
  }

 private:
  [[noreturn]] void refuse(const std::string& message) const { throw InputError(file_, message); }

  void warn(const char* code, const std::string& where, const std::string& message,
            const std::string& remedy) {
    scene_.findings.push_back({Finding::Severity::Warning, code, where, message, remedy});
  }

  // ---- nodes, units, axes

  void read_nodes() {
    std::vector<std::pair<const aiNode*, int>> stack{{source_.mRootNode, -1}};
    while (!stack.empty()) {
      const auto [source, parent] = stack.back();
      stack.pop_back();
      const int index = static_cast<int>(scene_.nodes.size());
      ImportedNode node;
      node.name = text(source->mName);
      node.parent = parent;
      node.parent_from_node = affine(source->mTransformation);
      if (node.parent_from_node.matrix().allFinite()) node.local = decompose(node.parent_from_node);
      nodes_by_name_[node.name].push_back(index);
      sources_.push_back(source);
      scene_.nodes.push_back(std::move(node));
      for (unsigned c = source->mNumChildren; c-- > 0;) stack.push_back({source->mChildren[c], index});
    }
  }

  void read_conventions() {
    const std::string extension = lower_extension(file_);
    if (extension == ".fbx") {
      scene_.format = "FBX";
      double centimetres = 0.0;
      int up = 1;
      if (source_.mMetaData != nullptr) {
        float as_float = 0.0F;
        if (source_.mMetaData->Get("UnitScaleFactor", centimetres)) {
        } else if (source_.mMetaData->Get("UnitScaleFactor", as_float)) {
          centimetres = as_float;
        }
        source_.mMetaData->Get("UpAxis", up);
      }
      if (centimetres > 0.0) scene_.metres_per_unit = 0.01 * centimetres;
      scene_.up_axis = up == 0 ? UpAxis::X : up == 2 ? UpAxis::Z : UpAxis::Y;
    } else if (extension == ".dae") {
      scene_.format = "Collada";
      read_collada_conventions();
    } else {
      scene_.format = extension.size() > 1 ? extension.substr(1) : "unknown";
      for (char& c : scene_.format) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
      // Valve's formats stand on Z, and assimp leaves them so.
      if (extension == ".smd" || extension == ".vta") scene_.up_axis = UpAxis::Z;
    }
  }

  /// assimp puts the unit into the root and (told so below) leaves the axes alone.
  void read_collada_conventions() {
    Eigen::Affine3d& root = scene_.nodes[0].parent_from_node;
    const double scale = root.linear()(0, 0);
    if (scale > 0.0 && root.linear().isApprox(scale * Eigen::Matrix3d::Identity(), 1e-6)) {
      scene_.metres_per_unit = scale;
      root.linear().setIdentity();
      scene_.nodes[0].local = decompose(root);
    }
    // The <asset> block stands first.
    const std::string head = read_head(file_, 1u << 16);
    const std::size_t at = head.find("<up_axis>");
    if (at == std::string::npos) return;
    const std::string axis = head.substr(at + 9, 16);
    if (axis.find("Z_UP") != std::string::npos) scene_.up_axis = UpAxis::Z;
    if (axis.find("X_UP") != std::string::npos) scene_.up_axis = UpAxis::X;
  }

  /// The node that a bone or channel means: nodes that carry meshes often share a joint's name, but are not
  /// joints.
  int find_node(const std::string& name) {
    const auto found = nodes_by_name_.find(name);
    if (found == nodes_by_name_.end()) return -1;
    const std::vector<int>& candidates = found->second;
    std::vector<int> plain;
    for (const int n : candidates) {
      if (sources_[static_cast<std::size_t>(n)]->mNumMeshes == 0) plain.push_back(n);
    }
    if (candidates.size() > 1) ambiguous_.insert(name);
    return plain.empty() ? candidates.front() : plain.front();
  }

  // ---- meshes

  void read_mesh(const aiMesh& source) {
    const std::string name = text(source.mName);
    std::vector<std::vector<lattice::Influence>> weights;
    int skin = -1;
    if (source.mNumBones > 0) {
      skin = static_cast<int>(scene_.skins.size());
      scene_.skins.push_back(read_skin(source, name, weights));
    }
    ImportedMesh mesh;
    mesh.name = name;
    const std::vector<int> vertex_of_corner = join(source, weights, mesh);
    std::vector<std::array<int, 3>> triangles;
    for (unsigned f = 0; f < source.mNumFaces; ++f) {
      const aiFace& face = source.mFaces[f];
      if (face.mNumIndices != 3) {
        ++num_other_faces_;
        continue;
      }
      std::array<int, 3> triangle{};
      for (unsigned c = 0; c < 3; ++c) {
        if (face.mIndices[c] >= source.mNumVertices) {
          refuse("mesh '" + printable(name) + "': face " + std::to_string(f) + ": vertex index, got " +
                 std::to_string(face.mIndices[c]) + ", expected 0 to " + std::to_string(source.mNumVertices));
        }
        triangle[c] = vertex_of_corner[face.mIndices[c]];
      }
      triangles.push_back(triangle);
    }
    mesh.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      mesh.triangles.row(static_cast<Eigen::Index>(t)) << triangles[t][0], triangles[t][1], triangles[t][2];
    }
    skin_of_mesh_.push_back(skin);
    scene_.meshes.push_back(std::move(mesh));
  }

  ImportedSkin read_skin(const aiMesh& source, const std::string& mesh_name,
                         std::vector<std::vector<lattice::Influence>>& weights) {
    ImportedSkin skin;
    weights.resize(source.mNumVertices);
    for (unsigned b = 0; b < source.mNumBones; ++b) {
      const aiBone& bone = *source.mBones[b];
      const std::string name = text(bone.mName);
      const int node = find_node(name);
      if (node < 0) {
        refuse("mesh '" + printable(mesh_name) + "': joint '" + printable(name) +
               "' is not in the scene; hint: export mesh and skeleton together");
      }
      skin.joints.push_back(node);
      skin.joint_from_mesh.push_back(affine(bone.mOffsetMatrix));
      for (unsigned w = 0; w < bone.mNumWeights; ++w) {
        const aiVertexWeight& weight = bone.mWeights[w];
        if (weight.mVertexId >= source.mNumVertices) {
          refuse("mesh '" + printable(mesh_name) + "': joint '" + printable(name) + "': weight for vertex " +
                 std::to_string(weight.mVertexId) + ", expected 0 to " + std::to_string(source.mNumVertices));
        }
        if (weight.mWeight != 0.0F) {
          weights[weight.mVertexId].push_back({static_cast<int>(b), static_cast<double>(weight.mWeight)});
        }
      }
    }
    return skin;
  }

  /// Joins corners that agree bit for bit in position and weights; fills points and weights of `mesh`.
  static std::vector<int> join(const aiMesh& source,
                               const std::vector<std::vector<lattice::Influence>>& weights,
                               ImportedMesh& mesh) {
    using Key = std::pair<std::array<float, 3>, std::vector<std::pair<int, double>>>;
    std::map<Key, int> known;
    std::vector<int> vertex_of_corner(source.mNumVertices);
    std::vector<unsigned> first;
    for (unsigned v = 0; v < source.mNumVertices; ++v) {
      const aiVector3D& p = source.mVertices[v];
      Key key{{p.x, p.y, p.z}, {}};
      if (!weights.empty()) {
        for (const lattice::Influence& influence : weights[v])
          key.second.push_back({influence.frame, influence.weight});
      }
      // NaN orders with nothing, so it may not enter the map; check_scene() refuses it later.
      const bool finite = std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
      const auto next = static_cast<int>(first.size());
      const auto [at, is_new] =
          finite ? known.try_emplace(std::move(key), next) : std::pair(known.end(), true);
      vertex_of_corner[v] = is_new ? next : at->second;
      if (is_new) first.push_back(v);
    }
    mesh.points.resize(static_cast<Eigen::Index>(first.size()), 3);
    for (std::size_t i = 0; i < first.size(); ++i) {
      mesh.points.row(static_cast<Eigen::Index>(i)) = vector(source.mVertices[first[i]]).transpose();
      if (!weights.empty()) mesh.weights.push_back(weights[first[i]]);
    }
    return vertex_of_corner;
  }

  void place_instances() {
    for (std::size_t n = 0; n < sources_.size(); ++n) {
      for (unsigned m = 0; m < sources_[n]->mNumMeshes; ++m) {
        const unsigned mesh = sources_[n]->mMeshes[m];
        if (mesh >= source_.mNumMeshes)
          refuse("node '" + printable(scene_.nodes[n].name) + "': no mesh " + std::to_string(mesh));
        scene_.instances.push_back({static_cast<int>(n), static_cast<int>(mesh), skin_of_mesh_[mesh]});
      }
    }
  }

  // ---- clips

  void read_clip(const aiAnimation& source) {
    skeleton::Clip clip;
    clip.name = text(source.mName);
    double ticks = source.mTicksPerSecond;
    if (!(ticks > 0.0)) {
      ticks = kDefaultTicksPerSecond;
      warn("tick-rate-missing", clip.name, "the clip states no ticks per second; 25 are assumed",
           "export again at a stated frame rate if the motion runs too fast or too slow");
    }
    std::set<int> seen;
    for (unsigned c = 0; c < source.mNumChannels; ++c) {
      const aiNodeAnim& channel = *source.mChannels[c];
      const int node = find_node(text(channel.mNodeName));
      if (node < 0 || !seen.insert(node).second) {
        ++num_lost_channels_;
        continue;
      }
      skeleton::Channel out;
      out.joint = node;
      out.translation = read_vectors(channel.mPositionKeys, channel.mNumPositionKeys, ticks, clip.name);
      out.scale = read_vectors(channel.mScalingKeys, channel.mNumScalingKeys, ticks, clip.name);
      out.rotation = read_rotations(channel, ticks);
      if (out.translation || out.scale || out.rotation) clip.channels.push_back(std::move(out));
    }
    if (source.mNumMorphMeshChannels + source.mNumMeshChannels > 0) {
      warn("morph-targets-ignored", clip.name, "channels that deform meshes directly are left out", "");
    }
    scene_.clips.push_back(std::move(clip));
  }

  /// assimp repeats a key now and then: the later of two at one time holds. Other disorder is
  /// check_scene()'s.
  template <typename Track>
  void add_key(Track& track, double time, const typename decltype(Track::values)::value_type& value) {
    if (!track.times.empty() && track.times.back() == time) {
      if (!track.values.back().isApprox(value, 1e-6)) ++num_double_keys_;
      track.values.back() = value;
      return;
    }
    track.times.push_back(time);
    track.values.push_back(value);
  }

  std::optional<skeleton::VectorTrack> read_vectors(const aiVectorKey* keys, unsigned count, double ticks,
                                                    const std::string& /*clip*/) {
    if (count == 0) return std::nullopt;
    skeleton::VectorTrack track;
    for (unsigned k = 0; k < count; ++k) add_key(track, keys[k].mTime / ticks, vector(keys[k].mValue));
    return track;
  }

  std::optional<skeleton::RotationTrack> read_rotations(const aiNodeAnim& channel, double ticks) {
    if (channel.mNumRotationKeys == 0) return std::nullopt;
    skeleton::RotationTrack track;
    for (unsigned k = 0; k < channel.mNumRotationKeys; ++k) {
      const aiQuaternion& q = channel.mRotationKeys[k].mValue;
      add_key(track, channel.mRotationKeys[k].mTime / ticks, Eigen::Quaterniond(q.w, q.x, q.y, q.z));
    }
    return track;
  }

  void report() {
    if (num_other_faces_ > 0) {
      warn("lines-ignored", "",
           std::to_string(num_other_faces_) + " faces are points or lines and are left out", "");
    }
    if (num_lost_channels_ > 0) {
      warn("channels-ignored", "",
           std::to_string(num_lost_channels_) +
               " animation channels name no node, or one that has a channel already, and are "
               "left out",
           "");
    }
    if (num_double_keys_ > 0) {
      warn("keys-doubled", "",
           std::to_string(num_double_keys_) + " keys share their time with another; the later one is taken",
           "bake the animation and export again");
    }
    for (const std::string& name : ambiguous_) {
      warn("node-name-used-twice", name,
           "several nodes have this name; the one without a mesh is taken as the joint",
           "give every node a name of its own");
    }
  }

  const std::string& file_;
  const aiScene& source_;
  ImportedScene scene_;
  std::vector<const aiNode*> sources_;  ///< by our node index.
  std::map<std::string, std::vector<int>> nodes_by_name_;
  std::set<std::string> ambiguous_;
  std::vector<int> skin_of_mesh_;
  int num_other_faces_ = 0, num_lost_channels_ = 0, num_double_keys_ = 0;
};

std::string one_line(std::string message) {
  std::replace(message.begin(), message.end(), '\n', ' ');
  while (!message.empty() && (message.back() == ' ' || message.back() == '.')) message.pop_back();
  return printable(message);
}

/// What assimp drops from FBX files is read from the file itself.
void add_fbx_facts(const std::string& file, ImportedScene& scene) {
  FbxFacts facts;
  try {
    facts = read_fbx_facts(read_whole(file));
  } catch (const std::runtime_error& e) {
    scene.findings.push_back(
        {Finding::Severity::Warning, "fbx-not-scanned", "",
         std::string("scale inheritance and bind matrices could not be checked: ") + e.what(),
         "export the file again"});
    return;
  }
  take_fbx_bind_matrices(file, facts.clusters, scene);
  apply_fbx_inheritance(facts.inherit, scene);
}

}  // namespace

ImportedScene read_with_assimp(const std::string& file) {
  Assimp::Importer importer;
  // With pivots kept, an animated joint turns into a chain whose channel is then applied twice.
  importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_PRESERVE_PIVOTS, false);
  importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_READ_MATERIALS, false);
  importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_READ_TEXTURES, false);
  // Files without a mesh would get a stick figure invented for them.
  importer.SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  const aiScene* source = importer.ReadFile(file, aiProcess_Triangulate);
  if (source == nullptr || source->mRootNode == nullptr) {
    const std::string reason = one_line(importer.GetErrorString());
    if (reason.find("bad_alloc") != std::string::npos) {
      throw LimitError(printable(file) + ": importer: ran out of memory; hint: export a smaller scene");
    }
    throw InputError(file, "importer: cannot be read: " + (reason.empty() ? "no reason given" : reason) +
                               "; hint: open the file in Blender and export it as .glb");
  }
  ImportedScene scene = AssimpReader(file, *source).run();
  if (scene.format == "FBX") add_fbx_facts(file, scene);
  return scene;
}

}  // namespace sinew::assets::detail
