#pragma once

#include <optional>
#include <vector>

#include "fem/body/frames.h"
#include "fem/linear/factor.h"
#include "lattice/points.h"

/// What all models of the flesh share: the moving state, the poses round a stage, what they are asked to use
/// and what they count.
namespace sinew::fem {

/// What moves: positions and velocities of the leaf vertices, now and one step earlier.
struct State {
  double time = 0.0;               ///< [s].
  lattice::Points x, v;            ///< num_vertices x 3 [m], [m/s].
  lattice::Points x_past, v_past;  ///< one step earlier; empty where there is no usable history.
  lattice::Points a;               ///< with which the last step ended [m/s^2]; empty before there is one.
  bool has_past() const { return x_past.rows() > 0; }
};

/// Poses round one stage. `before` may be null at the start: then the flesh's velocity relative to its frames
/// is zero.
struct StagePoses {
  const PosedFrames* before = nullptr;  ///< one step earlier.
  const PosedFrames* now = nullptr;     ///< at the step's begin.
  const PosedFrames* stage = nullptr;   ///< at the stage's time.
};

/// Which functions a region's system is written in; both span the same space. The nodal one, which has fewer
/// couplings (a step takes a sixth less), is taken only where every leaf vertex is active.
enum class Basis { Hierarchical, Nodal };

struct SolverOptions {
  /// Of factors that last over many steps; left out: double in `blended`, whose solutions they are, and float
  /// where they precondition. Models that factor in every iteration do so in double.
  std::optional<Precision> precision;
  Basis basis = Basis::Nodal;
  /// Rings of leaf cells round a region whose results are computed and discarded [-]; >= 0. Without a ring
  /// five and more regions blow up at 1/24 s.
  int rings = 1;
};

/// Counts that reproduce, for reports and benchmarks.
struct SolverCounts {
  int regions = 0;
  int functions = 0;                ///< active.
  std::vector<int> unknowns;        ///< functions solved for, per region.
  std::size_t factor_nonzeros = 0;  ///< over all regions, of one step size.
};

}  // namespace sinew::fem
