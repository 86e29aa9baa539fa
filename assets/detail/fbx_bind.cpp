#include "assets/detail/fbx_bind.h"

#include <algorithm>
#include <optional>

#include "assets/detail/text.h"
#include "assets/error.h"

namespace sinew::assets::detail {

namespace {

/// Matrices went through several programs; Blender's differ by 1e-4 of a scale of 100.
constexpr double kSamePlace = 1e-4;

Eigen::Affine3d world_from_node(const ImportedScene& scene, int node) {
  Eigen::Affine3d world = Eigen::Affine3d::Identity();
  for (; node >= 0; node = scene.nodes[static_cast<std::size_t>(node)].parent) {
    world = scene.nodes[static_cast<std::size_t>(node)].parent_from_node * world;
  }
  return world;
}

template <typename Track>
bool varies(const std::optional<Track>& track) {
  return track && std::any_of(track->values.begin(), track->values.end(), [&](const auto& value) {
           return !value.isApprox(track->values.front(), kSamePlace);
         });
}

/// Name of a clip in which the node itself moves; empty where there is none.
const std::string* clip_that_moves(const ImportedScene& scene, int node) {
  for (const skeleton::Clip& clip : scene.clips) {
    for (const skeleton::Channel& channel : clip.channels) {
      if (channel.joint != node) continue;
      if (varies(channel.translation) || varies(channel.rotation) || varies(channel.scale)) return &clip.name;
    }
  }
  return nullptr;
}

/// Some programs move the skinned mesh by its node on top of its skin, others do not; and an instance of a
/// skinned mesh has no bind matrices of its own. Whatever we took, one of them would show something else.
void refuse_moved_meshes(const std::string& file, const ImportedScene& scene) {
  std::vector<int> shown_by(scene.meshes.size(), -1);
  for (const ImportedInstance& instance : scene.instances) {
    if (instance.skin < 0) continue;
    const std::string mesh = "mesh '" + printable(name_of(scene, instance.node)) + "': ";
    if (const std::string* clip = clip_that_moves(scene, instance.node)) {
      throw InputError(
          file, mesh + "is skinned and yet moved by keys of its own in clip '" + printable(*clip) +
                    "', expected only its joints to move; hint: delete the keys of the mesh, or bake it "
                    "and export as .glb");
    }
    int& first = shown_by[static_cast<std::size_t>(instance.mesh)];
    if (first >= 0) {
      throw InputError(file,
                       mesh + "is an instance of the skinned mesh '" + printable(name_of(scene, first)) +
                           "', expected one node per skinned mesh; hint: make the instances real copies");
    }
    first = instance.node;
  }
}

}  // namespace

void take_fbx_bind_matrices(const std::string& file, const std::vector<FbxCluster>& clusters,
                            ImportedScene& scene) {
  const bool skinned = std::any_of(scene.instances.begin(), scene.instances.end(),
                                   [](const ImportedInstance& instance) { return instance.skin >= 0; });
  if (!skinned && !clusters.empty() && !scene.instances.empty()) {
    throw InputError(file,
                     "skin: the file binds meshes to " + std::to_string(clusters.size()) +
                         " joints, but the importer lost the skin; hint: open the file in Blender and export "
                         "it as .glb");
  }
  refuse_moved_meshes(file, scene);
  for (const ImportedInstance& instance : scene.instances) {
    if (instance.skin < 0) continue;
    ImportedSkin& skin = scene.skins[static_cast<std::size_t>(instance.skin)];
    const std::string& geometry = scene.nodes[static_cast<std::size_t>(instance.node)].name;
    bool moved = false;
    for (std::size_t j = 0; j < skin.joints.size(); ++j) {
      const std::string& joint = scene.nodes[static_cast<std::size_t>(skin.joints[j])].name;
      const auto cluster = std::find_if(clusters.begin(), clusters.end(), [&](const FbxCluster& c) {
        return c.geometry == geometry && c.joint == joint;
      });
      if (cluster == clusters.end()) continue;
      skin.joint_from_mesh[j] = cluster->joint_from_mesh;
      const Eigen::Affine3d bound = cluster->world_from_joint * cluster->joint_from_mesh;
      skin.world_from_mesh = bound;
      moved = moved || !bound.isApprox(world_from_node(scene, instance.node), kSamePlace);
    }
    if (moved) {
      scene.findings.push_back(
          {Finding::Severity::Warning, "mesh-moved-after-binding", geometry,
           "the mesh stands elsewhere than where it was bound; its skin alone decides where it is",
           "move the mesh back to where it was bound, or bind it again"});
    }
  }
}

}  // namespace sinew::assets::detail