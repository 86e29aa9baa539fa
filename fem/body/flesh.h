#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "fem/body/frame_weights.h"
#include "fem/body/ghost_penalty.h"
#include "fem/body/regions.h"
#include "fem/body/ties.h"
#include "lattice/embedding.h"
#include "lattice/fill.h"

/// The flesh: what a rig, a lattice and materials make, whatever functions are active. What one active set
/// makes of it is a body (fem/body/body.h). Everything that takes long is done here, once: the skin is looked
/// at on the finest level only, and coarser cells get what their children have.
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
  /// Finest level that a function may be active on; 0 .. 3. make_body(BodyInput, BodyOptions) takes all up to
  /// it. Level 1 is the least that bends well: level-0 tetrahedra alone are 48 % too stiff at nu = 0.3.
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

/// A plane of the rest shape on which every leaf vertex is held: a clamped end.
struct HeldPlane {
  int joint = -1;                   ///< joint of the skeleton that it moves with; it becomes a frame.
  Eigen::Vector3d point{0, 0, 0};   ///< on the plane [m].
  Eigen::Vector3d normal{1, 0, 0};  ///< unit.
};

/// Everything that make_flesh is given besides the options. `poses`: poses of the clip (pose_from_rest of
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

/// One value per hexahedron of every level: of_level[j - 1][hex] on level j.
template <class Value>
struct PerCell {
  std::vector<std::vector<Value>> of_level;

  const Value& at(int level, int hex) const {
    return of_level[static_cast<std::size_t>(level) - 1][static_cast<std::size_t>(hex)];
  }
  Value& at(int level, int hex) {
    return of_level[static_cast<std::size_t>(level) - 1][static_cast<std::size_t>(hex)];
  }
};

/// Built once by make_flesh; does not change after it.
///
/// Invariants: a cell of any level holds as much flesh, and as much mass, as its children together; all
/// vertices of a leaf mesh over the kept cells are among those of `finest`.
struct Flesh {
  lattice::ControlLattice lattice;
  lattice::Hierarchy hierarchy;          ///< to the finest level that an active set may reach.
  std::vector<std::uint8_t> kept;        ///< per cell of level 0: it holds flesh, or a bone needs it.
  lattice::LeafMesh finest;              ///< the kept cells with every function active.
  PerCell<lattice::FillFractions> fill;  ///< zero in cells that are not kept.
  PerCell<Material> materials;
  FrameTree tree;
  // Of the vertices of `finest`; those of a body are picked from them.
  FrameWeights weights;  ///< s_f.
  BoneConstraints bones;
  FrameWeights bone_extension;  ///< empty where nothing grows.
  std::vector<Region> regions;
  std::vector<TieLaw> ties;
  lattice::LimbCopies copies;
  lattice::Surface surface;  ///< the skin, without its weights.
  lattice::Embedding skin;   ///< of surface.points in `finest`.
  GhostPenalty ghost;
  double phong = 0.0;  ///< as in BodyOptions.
  Damping damping;
  /// Some pose of the clip scales a joint: judged once, so that nothing jumps where a scale passes through 1.
  bool grows = false;
};

/// Throws std::invalid_argument where a cell is inverted, no cell holds flesh, the skin has no weights, it or
/// the options name a joint that is not there, or an option is out of range.
Flesh make_flesh(const BodyInput& input, const BodyOptions& options = {});

/// Flesh round which nothing is to be found out: no skin, no bones and one frame, that of joint 0; fill and
/// held vertices are functions of the place.
struct PlainFlesh {
  lattice::CellComplex cells;
  double edge_length = 1.0;  ///< of the cells [m].
  int levels = 1;            ///< as in BodyOptions.
  Frame frame;
  Material material;
  Damping damping;
  GhostPenalty ghost;
  std::function<double(const Eigen::Vector3d&)> fill;  ///< round a Gauss point, in [0, 1]; empty: full.
  std::function<bool(const Eigen::Vector3d&)> held;    ///< of vertices; empty: none.
};
/// Points of the skin are the vertices of the finest level.
Flesh make_flesh(const PlainFlesh& plain);

/// Every function up to `level`, 0 .. the flesh's finest, but those of bones (lattice::uniform_active_set).
lattice::ActiveSet uniform_set(const Flesh& flesh, int level);

}  // namespace sinew::fem
