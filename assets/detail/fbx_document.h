#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

/// The few things that an FBX file says and assimp drops.
namespace sinew::assets::detail {

/// FbxTransform::EInheritType: in which order a node takes over rotation R and scale S of its parent.
enum class FbxInherit { RrSs = 0, RSrs = 1, Rrs = 2 };

/// A cluster ties the vertices of one geometry to one joint.
struct FbxCluster {
  std::string geometry;  ///< name of the model that shows the geometry.
  std::string joint;     ///< name of the model that moves it.
  /// joint_from_mesh at the time of binding, the file's "Transform".
  Eigen::Affine3d joint_from_mesh = Eigen::Affine3d::Identity();
  /// Where the joint stood then, "TransformLink"; world_from_joint * joint_from_mesh is where the mesh stood.
  Eigen::Affine3d world_from_joint = Eigen::Affine3d::Identity();
};

struct FbxFacts {
  std::map<std::string, FbxInherit> inherit;  ///< by model name, every model.
  std::vector<FbxCluster> clusters;
};

/// Reads binary (7.x) and text FBX. Throws std::runtime_error where the bytes are not what they say.
FbxFacts read_fbx_facts(std::string_view bytes);

}  // namespace sinew::assets::detail
