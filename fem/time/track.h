#pragma once

#include <optional>
#include <vector>

#include "fem/models/state.h"

namespace sinew::fem {

/// Where flesh has been: what a step of another length than the last one asks for.
class Track {
 public:
  struct Passed {
    double time = 0.0;        ///< [s].
    lattice::Points x, v, a;  ///< num_vertices x 3 [m], [m/s], [m/s^2]; a empty where it is not known.
  };

  void clear() { passed_.clear(); }
  std::size_t size() const { return passed_.size(); }

  /// The flesh goes on from `state`, later than all before. What lies more than `reach` [s] back is
  /// forgotten, and of what is old ever more between, so that a handful is kept.
  void pass(const State& state, double reach);

  /// `now` with x_past and v_past of `span` [s] earlier: of a state that was passed, or on the cubics between
  /// two that have their velocities and accelerations. Nothing where the track does not reach back that far.
  std::optional<State> looking_back(const State& now, double span) const;

  /// Latest first.
  const std::vector<Passed>& passed() const { return passed_; }
  std::vector<Passed>& passed() { return passed_; }

 private:
  std::vector<Passed> passed_;
};

}  // namespace sinew::fem
