#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "lattice/points.h"
#include "lattice/surface.h"
#include "skeleton/clip.h"
#include "skeleton/skeleton.h"

/// A small writer of binary glTF 2.0: enough for a skinned, animated character with rigid parts. The same
/// scene gives the same bytes.
namespace sinew::assets {

struct GlbMaterial {
  std::string name;
  /// Linear RGB, each in [0, 1].
  Eigen::Vector3d base_colour{0.8, 0.8, 0.8};
  /// Roughness [-]; in [0, 1].
  double roughness = 0.8;
  bool double_sided = false;
};

/// Triangles of one material.
struct GlbPrimitive {
  lattice::Points points;   ///< num_vertices x 3 [m].
  lattice::Points normals;  ///< num_vertices x 3, unit.
  lattice::Triangles triangles;
  int material = -1;
  /// Linear RGBA per vertex that multiplies the base colour; empty or num_vertices long.
  std::vector<std::array<std::uint8_t, 4>> colours;
  /// At most 4 influences per vertex, frame = index into GlbScene::joints; empty for a rigid mesh.
  std::vector<std::vector<lattice::Influence>> weights;
};

struct GlbMesh {
  std::string name;
  std::vector<GlbPrimitive> primitives;
};

struct GlbNode {
  std::string name;
  int parent = -1;                      ///< smaller than the node's own index; -1 for a root.
  skeleton::LocalTransform local = {};  ///< parent_from_node.
  int mesh = -1;
  bool skinned = false;  ///< the mesh is deformed by the scene's one skin.
};

struct GlbScene {
  std::vector<GlbMaterial> materials;
  std::vector<GlbMesh> meshes;
  std::vector<GlbNode> nodes;
  std::vector<int> joints;                       ///< nodes of the one skin; empty = no skin.
  std::vector<Eigen::Affine3d> joint_from_rest;  ///< inverse bind matrices, one per joint.
  std::vector<skeleton::Clip> clips;             ///< channels name nodes; Linear or Step tracks only.
};

/// The file as bytes. Weights are stored as 16-bit shares that sum to exactly 65535, indices with 16 bits
/// where they fit. Throws std::invalid_argument naming the mesh, node or clip that is not consistent.
std::string glb_bytes(const GlbScene& scene);

}  // namespace sinew::assets
