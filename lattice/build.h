#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "lattice/control_lattice.h"
#include "lattice/mirror_map.h"
#include "lattice/poll.h"
#include "lattice/surface.h"

namespace sinew::lattice {

/// Cells in the flesh of one joint (round its skin and its bones) are this much larger (> 1) or smaller (< 1)
/// than elsewhere.
struct SizeFactor {
  int joint = -1;       ///< index into the joint tree.
  double factor = 1.0;  ///< target edge there over the lattice's target edge [-]; in [0.25, 4].
};

/// Whether leaf joints that carry skin get a bone of their own.
enum class TipBones { On, Off };

/// Whether the builder looks for a plane of symmetry and mirrors one half.
enum class Symmetry { Auto, Off };

/// What the builder makes.
enum class Construction {
  Auto,        ///< tetrahedra; a grid of cubes where the gate refuses all of them.
  Tetrahedra,  ///< with the bones as edges.
  Grid         ///< of cubes, with soft bones.
};

/// Whether cells are larger where the skin moves as one stiff piece.
enum class CoarsenRigid { Off, On };

/// Whether cells are smaller where limbs are thin.
enum class Grade { Off, On };

/// Controls of the lattice builder.
struct BuildOptions {
  /// Wanted number of cells [-]; >= 20. The secant search on h lands within about 10 %.
  int cells = 1000;
  /// Target edge h [m]; > 0. Where it is given, `cells` is not used and nothing is searched.
  std::optional<double> cell_size = std::nullopt;
  /// Finer and coarser places. A joint may be named once. Away from a finer place the target edge grows by
  /// 0.35 per length, so that neighbouring cells differ little. Of no effect at joints that carry no skin and
  /// where only a grid of cubes passes the gate: BuildResult::idle_sizes.
  std::vector<SizeFactor> size_factors = {};
  /// With On, skin that follows one frame alone, and the flesh under it, gets cells twice as large as
  /// `size_factors` say, the farther from joints and blended weights the nearer to that. Off, as such skin
  /// does not bend with its bones but still swings on them, and a coarse lattice is stiffer.
  CoarsenRigid coarsen_rigid = CoarsenRigid::Off;
  /// With On, the flesh of a joint whose limb is thinner than half the target edge gets an edge of twice its
  /// thickness (0.4 h at least), so that limbs side by side are not one sheet: of the wanted number of cells
  /// more lie in the limbs and fewer in the trunk. Where all limbs are that thin, the thickest has the target
  /// edge. `size_factors` win where they name the joint. Fingers, eyes and the like (joints with less than a
  /// hundredth of the skin) are left as they are.
  Grade grade = Grade::On;
  /// Joints that take part: where not empty, all others are treated as excluded.
  std::vector<int> include = {};
  /// Joints that get neither a bone nor a frame: their children hang on the joint above, and so does their
  /// skin (where none is above, on the nearest below). At least one joint must be left.
  std::vector<int> exclude = {};
  /// With Off, the skin of leaf joints is held by soft frames.
  TipBones tip_bones = TipBones::On;
  /// With Auto, a rig that is its own mirror image to 1e-5 of its size gets a lattice that is its own mirror
  /// image.
  Symmetry symmetry = Symmetry::Auto;
  Construction construction = Construction::Auto;
  /// Retries with tetrahedra after a failed gate; 0 = one attempt only. What varies is the place and size of
  /// the grid, then the thresholds that reduce the skeleton; in the end bones at refused cells become soft,
  /// one by one.
  int max_retries = 12;
  /// Gate thresholds.
  double min_dihedral_degrees = 10.0;
  double min_scaled_jacobian = 0.10;
  /// Asked during the build whether to go on; no part of what is built.
  Poll poll = {};

  /// Throws std::invalid_argument naming the field, its value and the rule it breaks.
  void validate() const;
};

/// Per joint whether `options` leave it out. Throws std::invalid_argument where they name a joint that does
/// not exist, or leave none.
std::vector<bool> excluded_joints(const BuildOptions& options, int num_joints);

/// What the gate found; empty = passed.
struct GateFailure {
  std::string what;  ///< one sentence with numbers and the first offenders.
  /// True where a simulation can still run (small dihedral, triangle pokes out); false where it cannot
  /// (vertex outside, inexact chain, inverted cell).
  bool tolerable = false;
};

/// One attempt that the gate refused.
struct RefusedAttempt {
  std::string name;  ///< what it was made with, "h x 0.93".
  std::vector<GateFailure> failures;
};

struct BuildResult {
  /// The attempt that passed, else the best: fewest intolerable failures, then fewest failures, then best
  /// shape.
  ControlLattice lattice;
  std::vector<GateFailure> failures;    ///< of that attempt.
  std::vector<RefusedAttempt> refused;  ///< in order; with a lattice that failed, all attempts.
  std::optional<MirrorPlane> mirror;    ///< in which the lattice is its own mirror image to 1e-9 of its size.
  std::string no_mirror;                ///< why it is not, one phrase; empty where it is.
  std::vector<int> idle_sizes;          ///< joints of `size_factors` that nothing is sized at.
};

/// Builds a lattice of tetrahedra round `skin` in which the bones of `joints` are chains of edges; where the
/// gate refuses every attempt, a plain grid of cubes with soft bones.
/// Deterministic. `skin.weights` name joints of the tree. Throws std::invalid_argument where there is no
/// triangle, no joint or no weight at all, or a coordinate is not finite, and whatever `options.poll` throws.
BuildResult build(const Surface& skin, const JointTree& joints, const BuildOptions& options = {});

/// What a program that builds, checks and writes so many cells takes of memory at its peak [bytes], without
/// the skin. build() alone takes a third of it (measured 70 MB at 99486 cells).
std::size_t estimated_build_bytes(int cells);

/// Quality of any lattice against a skin, and the gate on it.
LatticeQuality measure_quality(const ControlLattice& lattice, const Surface& skin);
std::vector<GateFailure> check_gate(const ControlLattice& lattice, const Surface& skin,
                                    const BuildOptions& options);

}  // namespace sinew::lattice
