#pragma once

#include <vector>

#include "fem/body/frames.h"
#include "lattice/basis.h"

/// Lattice vertices on hard bones: known at every instant. The one place where lattice and
/// skeleton meet.
namespace sinew::fem {

/// A leaf vertex on a bone at parameter s: (1-s) T_a X_a + s T_b X_b.
struct BoneVertex {
  int vertex = -1;        ///< leaf vertex.
  int frame = -1;         ///< frame of the bone.
  int second_frame = -1;  ///< at a joint between two frames: the other one; else -1.
  int joint_a = -1, joint_b = -1;
  Eigen::Vector3d x_a{0, 0, 0}, x_b{0, 0, 0};
  double s = 0.0;
};

struct BoneConstraints {
  std::vector<BoneVertex> vertices;   ///< one per constrained leaf vertex, ascending.
  std::vector<std::uint8_t> is_bone;  ///< per leaf vertex.
  /// Straight pieces between neighbouring chain vertices whose midpoints follow as means.
  std::vector<std::vector<int>> chains;  ///< leaf vertices, per hard bone.
};

/// Bone vertices on every level: chain vertices of level 0 and, on finer levels, the midpoints of bone
/// pieces.
BoneConstraints bone_constraints(const lattice::ControlLattice& lattice, const FrameTree& tree,
                                 const lattice::Hierarchy& hierarchy, const lattice::LeafMesh& mesh);

/// Exact position [m] of a bone vertex.
Eigen::Vector3d bone_position(const BoneVertex& vertex, const std::vector<Eigen::Affine3d>& pose_from_rest);

}  // namespace sinew::fem
