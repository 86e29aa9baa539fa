#pragma once

#include <optional>
#include <vector>

#include "fem/body/frames.h"
#include "fem/body/leaf_matrices.h"
#include "fem/body/limb_radius.h"
#include "lattice/leaf_limbs.h"

/// Penalties that tie flesh to a frame: the twist penalty of hard bones, soft bones and soft frames
/// ([Capell02, sec. 5.3] for the need; the tube is ours).
namespace sinew::fem {

/// What the ties of one joint's bones and soft frame differ in.
struct JointTie {
  int joint = -1;                        ///< joint of the skeleton.
  std::optional<double> radius = {};     ///< r [m]; > 0.
  std::optional<double> stiffness = {};  ///< c [-]; >= 0, > 0 where the bone is soft.
};

/// sum over bones of kappa/2 int_{tube} |p - T_b r(x)|^2 dV, with kappa = c mu / r^2.
struct TieOptions {
  double stiffness = 10.0;        ///< c of hard bones [-]; >= 0.
  double soft_stiffness = 100.0;  ///< c of soft bones and soft frames [-]; > 0.
  double radius = 0.25;           ///< r as a share of the limb's radius [-]; > 0. How thick the bone feels.
  std::vector<JointTie> joints = {};  ///< overrides; of several for one joint the last counts.
};

/// The least radius of a bone's tube [m]; below, it could slip between the samples of a level-1 cell. A
/// quarter of `edge_length`, or of what the pieces of its chain say where cells are larger there.
double smallest_radius(const lattice::LatticeBone& bone, double edge_length);

/// One tie: what its target T_b X contributes to the force, per leaf vertex it touches.
struct Tie {
  int frame = -1;  ///< frame index whose T it follows.
  int bone = -1;   ///< of the lattice; -1 for a soft frame.
  Eigen::Vector3d centre_rest{0, 0,
                              0};  ///< C_b; moments are taken about it, so that far positions stay accurate.
  std::vector<int> vertices;       ///< leaf vertices, ascending.
  std::vector<double> zeroth;      ///< (P_b 1)_a [N/m].
  std::vector<Eigen::Vector3d> first;  ///< (P_b (X - C_b))_a [N].
};

/// A tie before there are leaf cells: the tube, what it follows and how firmly.
struct TieLaw {
  int frame = -1;                                ///< frame index whose T it follows.
  int joint = -1;                                ///< of the frame, as the lattice names it.
  int bone = -1;                                 ///< of the lattice; -1 for a soft frame.
  Eigen::Vector3d start{0, 0, 0}, end{0, 0, 0};  ///< the tube's axis at rest [m]; a ball where they agree.
  double radius = 0.0;                           ///< r [m].
  double kappa = 0.0;                            ///< [N/m^4].
  /// Leaf cells of the finest mesh that hold the axis itself, ascending.
  std::vector<int> holders;
};

/// The laws of all bones and soft frames. The tube's radius does not depend on the active set: at least
/// smallest_radius, unless an override says it. Of cells that coincide only the one of the tie's own limb
/// (`limbs`, of the leaf mesh `finest`) holds it.
std::vector<TieLaw> tie_laws(const lattice::ControlLattice& lattice, const FrameTree& tree,
                             const LimbRadii& radii, const lattice::LeafMesh& finest,
                             const lattice::LeafLimbs& limbs, const std::vector<double>& mu_of_frame,
                             const TieOptions& options);

/// Where the laws act: a leaf mesh and, of every cell of the finest mesh, the leaf cell that it lies in.
struct TiedCells {
  const lattice::Hierarchy& hierarchy;
  const lattice::LeafMesh& mesh;
  const std::vector<int>& leaf_of_finest;
  const lattice::LimbCopies& copies;
};

/// Adds the ties' matrices to matrices.tie (P = sum_b P_b) and returns their targets. Of cells that coincide
/// only the one of the tie's own limb is held, and of the tube what hangs together with the cells that hold
/// its axis, as it does between cells of the coarsest level of the mesh. A tie that reaches no flesh is left
/// out.
std::vector<Tie> add_ties(const std::vector<TieLaw>& laws, const TiedCells& cells, LeafMatrices& matrices);

}  // namespace sinew::fem
