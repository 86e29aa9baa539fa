#pragma once

#include <optional>
#include <vector>

#include "fem/body/growth.h"
#include "fem/models/cell_energy.h"
#include "fem/models/model.h"

/// The balance of forces that models which solve the flesh as one system bring about, in a stage or at rest:
///   inertia M (target - d) + (ties and ghost penalty) + load - f(origin + d) = 0  at every unknown.
/// The unknown is the move d from an origin and not the position: a step of 1e-7 s moves flesh by less than
/// the last digit of where it is, and its inertia would be that digit's.
namespace sinew::fem {

/// Everything but the elastic force f; bones stay where `guess` moves them.
struct Balance {
  double inertia = 0.0;    ///< mass matrix per squared step, with mass damping [1/s^2]; 0 at rest.
  lattice::Points origin;  ///< what moves are counted from [m]: of a stage its predictor x_h.
  lattice::Points target;  ///< move that inertia alone would bring [m]; empty at rest.
  /// Of ties and ghost penalty at the origin [N]: sum_b P_b (T_b X) - P origin - S [(1 + damping) origin -
  /// damping past], the past carried along with its frames.
  lattice::Points pull;
  lattice::Points load;               ///< gravity and loads [N].
  double damping = 0.0;               ///< stiffness damping, beta / (kappa h) [-]; 0 at rest.
  std::vector<PastPlace> past;        ///< what the strain's rate is measured against.
  const PosedFrames* pose = nullptr;  ///< at the solution.
  std::optional<Growth> growth;       ///< there; only where flesh grows with its joints.
  lattice::Points guess;              ///< first guess of the move, in the space of the unknowns [m].
};

/// Whether flesh grows with joints that a clip scales (fem/body/growth.h) or keeps its own size.
enum class Grows { No, WithItsJoints };

/// Of a stage. The guess moves the flesh with its frames and lets it keep its velocity relative to them.
Balance stage_balance(const Body& body, const StageProblem& problem, Grows grows = Grows::No);

/// At rest; `guess` as it comes, with bone vertices put on the pose.
Balance rest_balance(const Body& body, const PoseProblem& problem, const lattice::Points& guess,
                     Grows grows = Grows::No);

/// inertia M (target - move) + ties + load.
struct OuterForces {
  lattice::Points sum;  ///< num_vertices x 3 [N].
  double scale = 0.0;   ///< sum of the norms of the three: what residuals are compared with [N].
};
OuterForces outer_forces(const Body& body, const Balance& balance, const lattice::Points& move);

/// Sums of cell vectors at the leaf vertices, in the order of the cells.
class CellSum {
 public:
  explicit CellSum(const Body& body);
  lattice::Points operator()(const std::vector<CellVector>& cells) const;

 private:
  std::vector<int> row_start_, corner_;  ///< 8 * cell + corner.
};

/// "leaf cell 17 of 'upper'": the frame is the one that its first corner follows most.
std::string place_of(const Body& body, int cell);

/// Least principal stretch at the Gauss points of octants that are at least half flesh, negative where one is
/// turned inside out, and its leaf cell.
struct LeastStretch {
  double stretch = 1.0;
  int cell = -1;
};
LeastStretch least_stretch(const Body& body, const lattice::Points& x);

/// "cell 17 round 'upper' (det F -0.31)": the most inverted cell where one is, else the cell with the largest
/// residual. Sets report.cell and adds the place to report.message.
void name_worst_cell(const Body& body, const lattice::Points& x, const lattice::Points& residual,
                     SolveReport& report);

}  // namespace sinew::fem
