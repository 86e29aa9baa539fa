#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fem/body/leaf_matrices.h"
#include "fem/body/regions.h"
#include "fem/body/ties.h"
#include "lattice/embedding.h"
#include "lattice/fill.h"

/// The flesh: everything about a character that does not change while it moves.
namespace sinew::fem {

/// Material of the flesh whose dominant frame is that of `joint`.
struct JointMaterial {
  int joint = -1;  ///< joint of the skeleton.
  Material material;
};

/// Flesh of the cells that the user's lattice puts in one region: what is given overrides the frame's.
struct RegionMaterial {
  int region = 0;                                                ///< as in ControlLattice::regions.
  std::optional<double> young = {}, poisson = {}, density = {};  ///< as in Material.

  Material applied_to(Material material) const;
};

struct BodyOptions {
  /// Finest level with active functions; 0 .. 3. Level 1 is the least that bends well: level-0 tetrahedra
  /// alone are 48 % too stiff at nu = 0.3.
  int levels = 1;
  Material material;                                  ///< where nothing else is said.
  std::vector<JointMaterial> materials;               ///< overrides.
  std::vector<RegionMaterial> region_materials = {};  ///< win over both; later ones over earlier ones.
  Damping damping;
  TieOptions ties;
  RegionOptions regions;
  GhostPenalty ghost;
  /// Share s of the skin's smooth embedding (fem/body/phong_skin.h) [-]; 0 = trilinear.
  double phong = 0.5;
  /// Open sheets have no inside: flesh reaches this share of the edge length from the skin [-].
  double shell = 0.03;

  /// Throws std::invalid_argument naming the field, its value and the rule it breaks.
  void validate() const;
};

/// Built once by make_body; read by the solvers.
struct Body {
  lattice::ControlLattice lattice;
  lattice::Hierarchy hierarchy;
  lattice::LeafMesh mesh;
  lattice::Embedding skin;                   ///< of surface.points, trilinear.
  std::vector<lattice::FillFractions> fill;  ///< per leaf cell.
  std::vector<Material> materials;           ///< per leaf cell.
  LeafMatrices matrices;
  FrameTree tree;
  FrameWeights weights;  ///< s_f of leaf vertices.
  BoneConstraints bones;
  std::vector<Tie> ties;
  std::vector<Region> regions;
  Damping damping;
  /// Some pose of the clip scales a joint: judged once, so that nothing jumps where a scale passes through 1.
  bool grows = false;
  FrameWeights bone_extension;      ///< of leaf vertices; empty where nothing grows.
  std::vector<double> vertex_mass;  ///< row sums of M [kg].
  double volume = 0.0;              ///< of the flesh [m^3].
  double size = 0.0;                ///< diagonal of the lattice's box [m].
  /// How leaf values move the skin, num_points x num_vertices (fem/body/phong_skin.h).
  Eigen::SparseMatrix<double, Eigen::RowMajor> skin_rows = {};
};

/// A plane of the rest shape on which every leaf vertex is held: a clamped end.
struct HeldPlane {
  int joint = -1;                   ///< joint of the skeleton that it moves with; it becomes a frame.
  Eigen::Vector3d point{0, 0, 0};   ///< on the plane [m].
  Eigen::Vector3d normal{1, 0, 0};  ///< unit.
};

/// Everything that make_body is given besides the options. `poses`: poses of the clip (pose_from_rest of
/// every joint), for judging how far joints bend; at least one.
struct BodyInput {
  const lattice::ControlLattice& lattice;
  const lattice::Surface& skin;
  const skeleton::Skeleton& skeleton;
  const std::vector<std::vector<Eigen::Affine3d>>& poses;
  /// Planes held besides the bones.
  std::vector<HeldPlane> held = {};
  /// Joints that are frames though nothing of theirs is in the lattice: what is linearised in one needs
  /// neither bone nor tie.
  std::vector<int> bare_frames = {};
};

/// Throws std::invalid_argument where a cell is inverted, no cell holds flesh, the skin has no weights, it or
/// the options name a joint that is not there, or an option is out of range.
Body make_body(const BodyInput& input, const BodyOptions& options = {});

/// The same without what it takes to move: no matrices, no ties, no masses. For looking at fill, materials
/// and regions; takes a fraction of the memory.
Body paint_body(const BodyInput& input, const BodyOptions& options = {});

}  // namespace sinew::fem
