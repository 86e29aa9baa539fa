#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "assets/rig.h"
#include "lattice/points.h"
#include "lattice/surface.h"
#include "skeleton/clip.h"
#include "skeleton/skeleton.h"

/// What a file says, before anything is decided about it: every reader produces this, build_rig() turns it
/// into a Rig. Units, axes and names are the file's own.
namespace sinew::assets::detail {

struct ImportedNode {
  std::string name;  ///< as in the file: may be empty or used twice.
  int parent = -1;   ///< smaller than the node's own index; -1 for a root.
  Eigen::Affine3d parent_from_node = Eigen::Affine3d::Identity();
  /// The same in parts (its closest parts where the file stores a shear).
  skeleton::LocalTransform local;
  /// Put in by a reader above one child to hold part of that child's transform: at rest it stands where the
  /// child stands.
  bool helper = false;
};

/// Joints with their inverse bind matrices.
struct ImportedSkin {
  std::vector<int> joints;                       ///< nodes.
  std::vector<Eigen::Affine3d> joint_from_mesh;  ///< one per joint.
  /// Where the mesh stood when it was bound, in world coordinates, where the file tells.
  std::optional<Eigen::Affine3d> world_from_mesh;
};

struct ImportedMesh {
  std::string name;
  lattice::Points points;        ///< num_vertices x 3, in the mesh's own space.
  lattice::Triangles triangles;  ///< num_triangles x 3.
  /// Per vertex, `frame` counts within the joints of the skin; not necessarily normalised, nor even numbers.
  /// Empty: unskinned.
  std::vector<std::vector<lattice::Influence>> weights;
};

/// A mesh placed in the scene.
struct ImportedInstance {
  int node = -1;
  int mesh = -1;
  int skin = -1;  ///< -1: the mesh follows its node.
};

struct ImportedScene {
  std::string format;             ///< "glTF 2.0", "FBX", ...
  double metres_per_unit = 0.0;   ///< as the file declares it; 0 where it does not.
  bool unit_by_standard = false;  ///< the format itself fixes that unit.
  UpAxis up_axis = UpAxis::Y;
  bool file_vertex_order = false;
  std::vector<ImportedNode> nodes;  ///< parents before children.
  std::vector<ImportedSkin> skins;
  std::vector<ImportedMesh> meshes;
  std::vector<ImportedInstance> instances;
  std::vector<skeleton::Clip> clips;  ///< `Channel::joint` is a node; start, end and num_keys are not used.
  std::vector<FaultyClip> faulty_clips;  ///< of the file's clips those that are not among `clips`.
  std::vector<Finding> findings;
};

/// Checks every index, count and number of a scene as if an enemy had written it. Throws InputError (with
/// `file`) naming the mesh and vertex, joint, node or clip and key at fault: NaN or infinite numbers (weights
/// apart), indices out of range, negative weights, singular bind matrices, key times that do not increase,
/// zero quaternions. Clips that fail are moved to `faulty_clips`; only where no other is left, the first of
/// them is thrown.
void check_scene(const std::string& file, ImportedScene& scene);

/// Name of a node for messages: its own, or "node 12" where it has none.
std::string name_of(const ImportedScene& scene, int node);

}  // namespace sinew::assets::detail
