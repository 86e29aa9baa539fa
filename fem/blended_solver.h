#pragma once

#include <map>
#include <memory>
#include <vector>

#include "fem/body.h"
#include "fem/factor.h"
#include "fem/integrator.h"

/// Blended local linearisation: one prefactored linear system per region, blended by the region weights
/// ([Capell02, sec. 5]).
namespace sinew::fem {

/// What moves: positions and velocities of the leaf vertices, now and one step earlier.
struct State {
  double time = 0.0;               ///< [s].
  lattice::Points x, v;            ///< num_vertices x 3 [m], [m/s].
  lattice::Points x_past, v_past;  ///< one step earlier; empty where there is no usable history.
  bool has_past() const { return x_past.rows() > 0; }
};

/// Poses round one stage. `before` may be null at the start: then the flesh's velocity relative to its frames
/// is zero.
struct StagePoses {
  const PosedFrames* before = nullptr;  ///< one step earlier.
  const PosedFrames* now = nullptr;     ///< at the step's begin.
  const PosedFrames* stage = nullptr;   ///< at the stage's time.
};

/// Which functions a region's system is written in; both span the same space on uniform levels.
enum class Basis { Hierarchical, Nodal };

struct SolverOptions {
  Precision precision = Precision::Double;
  Basis basis = Basis::Hierarchical;
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

class BlendedSolver {
 public:
  /// `body` must outlive the solver.
  BlendedSolver(const Body& body, const SolverOptions& options = {});
  ~BlendedSolver();
  BlendedSolver(BlendedSolver&&) noexcept;

  /// Factors all regions' systems for a step h [s] and an integrator; does nothing where they are there
  /// already. The report names the region and vertex where a system is not positive definite.
  [[nodiscard]] Factor::Report prepare(double h, Integrator integrator);

  /// Velocity v+ [m/s] at the stage for all leaf vertices, from stage predictors: x_h, v_h as in
  /// integrator.h. Bone vertices get the velocity that puts them on the clip at the stage. prepare(h,
  /// integrator) must have succeeded. `gravity` [m/s^2]. With `use_past` false the damping history is the
  /// present alone.
  lattice::Points stage_velocity(const State& state, const lattice::Points& x_h, const lattice::Points& v_h,
                                 const StagePoses& poses, double h, Integrator integrator,
                                 const Eigen::Vector3d& gravity, bool use_past);

  SolverCounts counts() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew::fem
