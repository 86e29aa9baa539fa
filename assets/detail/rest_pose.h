#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "assets/detail/imported_scene.h"

namespace sinew::assets::detail {

/// One rest pose for all skins of a file, in file world coordinates: every skin's bind pose is brought to
/// where its character stands in the scene, in world size and orientation, so that the poses of the node tree
/// carry the rest pose without a global scale or a turned axis.
struct RestPose {
  std::vector<Eigen::Affine3d> world_from_node;  ///< pose of the node tree.
  std::vector<Eigen::Affine3d> rest_from_node;   ///< one per node; invertible.
  std::vector<Eigen::Affine3d> rest_from_mesh;   ///< one per skin: where its meshes' points stand at rest.
  /// Total weight that hangs on each node.
  std::vector<double> weight_of_node;
  /// Joints without weight whose bind matrices contradict the nodes and did not count.
  std::vector<int> rehung;
};

/// `scene` has normalised weights. Method: with W_j the node pose and B_kj the inverse bind matrix of joint j
/// in skin k, T_kj = W_j B_kj would be the same map A_k for all j if the file stood in its bind pose. Where
/// it does, A_k is that map. Where the nodes hold another pose (the first frame of a take, say), A_k is the
/// similarity with the median scale of the T_kj and their mean rotation snapped to the nearest turn of axes;
/// or the place of binding, where the file tells it (FBX) and it agrees with that in size and rough
/// direction. Rest joints are R_j = A_k inv(B_kj), so skinning the rest pose reproduces the mesh by
/// construction within one skin; joints on which nothing hangs are placed by hang_loose_joints(). Skins that
/// share joints are aligned through them, and check_rest_pose() sees whether they agree.
RestPose find_rest_pose(const ImportedScene& scene);

/// Throws InputError where one mesh is bound to two skeletons that rest in the same place: two bodies in one.
void check_crowd(const std::string& file, const ImportedScene& scene, const RestPose& rest);

/// Skins every mesh at rest with the file's own bind matrices and compares it with its rest points. Throws
/// InputError naming the worst joints and parts where the distance exceeds 1e-4 of the diagonal of all
/// skinned points.
void check_rest_pose(const std::string& file, const ImportedScene& scene, const RestPose& rest);

}  // namespace sinew::assets::detail
