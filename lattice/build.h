#pragma once

#include <string>
#include <vector>

#include "lattice/control_lattice.h"
#include "lattice/surface.h"

namespace sinew::lattice {

/// Controls of the lattice builder.
struct BuildOptions {
  /// Wanted number of cells [-]; >= 20. The secant search on h lands within about 10 %.
  int cells = 1000;
  /// Retries after a failed gate; 0 = one attempt only.
  int max_retries = 6;
  /// Gate thresholds.
  double min_dihedral_degrees = 8.0;
  double min_scaled_jacobian = 0.08;

  /// Throws std::invalid_argument naming the field, its value and the rule it breaks.
  void validate() const;
};

/// What the gate found; empty = passed.
struct GateFailure {
  std::string what;  ///< one sentence with numbers and the first offenders.
  /// True where a simulation can still run (small dihedral, triangle pokes out); false where it cannot
  /// (vertex outside, inexact chain, inverted cell).
  bool tolerable = false;
};

struct BuildResult {
  ControlLattice lattice;  ///< the best attempt: fewest intolerable failures, then fewest failures.
  std::vector<GateFailure> failures;  ///< of that attempt.
};

/// Builds a lattice of tetrahedra round `skin` in which the bones of `joints` are chains of edges.
/// Deterministic. `skin.weights` name joints of the tree. Throws std::invalid_argument where there is no
/// triangle, no joint or no weight at all, or a coordinate is not finite.
BuildResult build(const Surface& skin, const JointTree& joints, const BuildOptions& options = {});

/// Quality of any lattice against a skin, and the gate on it.
LatticeQuality measure_quality(const ControlLattice& lattice, const Surface& skin);
std::vector<GateFailure> check_gate(const ControlLattice& lattice, const Surface& skin,
                                    const BuildOptions& options);

}  // namespace sinew::lattice
