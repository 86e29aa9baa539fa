#include "fem/body/bone_constraints.h"

#include <algorithm>
#include <map>
#include <utility>

namespace sinew::fem {
namespace {

/// Bone vertices of level 0 by hierarchy vertex.
std::map<int, BoneVertex> coarse_bone_vertices(const lattice::ControlLattice& lattice,
                                               const FrameTree& tree) {
  std::map<int, BoneVertex> vertices;
  for (const auto& bone : lattice.bones) {
    if (bone.soft || bone.chain.empty()) continue;
    const Eigen::Vector3d span = bone.rest_end - bone.rest_start;
    const int frame = tree.frame_of_joint[static_cast<std::size_t>(bone.frame)];
    for (std::size_t k = 0; k < bone.chain.size(); ++k) {
      BoneVertex v;
      v.frame = frame;
      const bool first = k == 0, last = k + 1 == bone.chain.size();
      const Eigen::Vector3d p = lattice.complex.points.row(bone.chain[k]).transpose();
      v.s = first ? 0.0 : last ? 1.0 : (p - bone.rest_start).dot(span) / span.squaredNorm();
      v.joint_a = bone.start.joint_a;
      v.x_a = bone.start.x_a;
      v.joint_b = bone.end.joint_b;
      v.x_b = bone.end.x_b;
      const auto [found, is_new] = vertices.emplace(bone.chain[k], v);
      if (!is_new && found->second.frame != frame && found->second.second_frame < 0)
        found->second.second_frame = frame;
    }
  }
  return vertices;
}

}  // namespace

BoneConstraints bone_constraints(const lattice::ControlLattice& lattice, const FrameTree& tree,
                                 const lattice::Hierarchy& hierarchy, const lattice::LeafMesh& mesh) {
  std::map<int, BoneVertex> by_vertex = coarse_bone_vertices(lattice, tree);
  // The midpoint of a piece moves as the mean of its ends, so it is a bone vertex with s in the middle: keep
  // the rule of the bone by interpolating s along it.
  const auto s_on_bone = [&](int vertex, const lattice::LatticeBone& bone) {
    const Eigen::Vector3d span = bone.rest_end - bone.rest_start;
    return (hierarchy.points().row(vertex).transpose() - bone.rest_start).dot(span) / span.squaredNorm();
  };
  std::map<std::pair<int, int>, const lattice::LatticeBone*> bone_of_piece;
  for (const auto& bone : lattice.bones) {
    for (std::size_t k = 1; k < bone.chain.size(); ++k)
      bone_of_piece[std::minmax(bone.chain[k - 1], bone.chain[k])] = &bone;
  }
  for (int v = hierarchy.num_vertices(0); v < hierarchy.num_vertices(); ++v) {
    const auto parents = hierarchy.parents(v);
    if (parents.size() != 2) continue;
    const auto found = bone_of_piece.find(std::minmax(parents[0], parents[1]));
    if (found == bone_of_piece.end()) continue;
    const lattice::LatticeBone& bone = *found->second;
    BoneVertex middle;
    middle.frame = tree.frame_of_joint[static_cast<std::size_t>(bone.frame)];
    middle.joint_a = bone.start.joint_a;
    middle.x_a = bone.start.x_a;
    middle.joint_b = bone.end.joint_b;
    middle.x_b = bone.end.x_b;
    middle.s = s_on_bone(v, bone);
    by_vertex.emplace(v, middle);
    bone_of_piece[std::minmax(parents[0], v)] = &bone;
    bone_of_piece[std::minmax(v, parents[1])] = &bone;
  }

  BoneConstraints constraints;
  constraints.is_bone.assign(static_cast<std::size_t>(mesh.num_vertices()), 0);
  for (auto& [vertex, bone] : by_vertex) {
    const int leaf = mesh.leaf_of_vertex[static_cast<std::size_t>(vertex)];
    if (leaf < 0) continue;
    bone.vertex = leaf;
    constraints.is_bone[static_cast<std::size_t>(leaf)] = 1;
    constraints.vertices.push_back(bone);
  }
  for (const auto& bone : lattice.bones) {
    if (bone.chain.empty()) continue;
    std::vector<int> chain;
    for (int v : bone.chain) chain.push_back(mesh.leaf_of_vertex[static_cast<std::size_t>(v)]);
    constraints.chains.push_back(std::move(chain));
  }
  return constraints;
}

Eigen::Vector3d bone_position(const BoneVertex& vertex, const std::vector<Eigen::Affine3d>& pose_from_rest) {
  const Eigen::Vector3d start = pose_from_rest[static_cast<std::size_t>(vertex.joint_a)] * vertex.x_a;
  const Eigen::Vector3d end = pose_from_rest[static_cast<std::size_t>(vertex.joint_b)] * vertex.x_b;
  return (1.0 - vertex.s) * start + vertex.s * end;
}

}  // namespace sinew::fem
