#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "fem/models/model.h"
#include "fem/time/energy_cap.h"
#include "fem/time/track.h"
#include "lattice/basis.h"

/// All that moves in a run, as one value: with it a run goes on bit for bit, in this process or another one.
namespace sinew::fem {

/// Where TR-BDF2 broke its last step.
struct StepEnd {
  lattice::Points x_middle;  ///< num_vertices x 3 [m].
  PosedFrames middle;
  double h = 0.0;  ///< [s].
};

/// The steps of a run: time is start + whole * step, never a running sum.
struct StepCounter {
  double start = 0.0;    ///< when steps of this length began [s].
  double step = 0.0;     ///< of the scene [s].
  double longest = 0.0;  ///< so far [s].
  long whole = 0;        ///< taken since.
  int part = 0;          ///< sub-steps taken of the step under way: a frame may be sampled between two.
  int halvings = 0;      ///< of the step.
  int since_change = 0;  ///< sub-steps since there were more or fewer halvings.
};

struct MovingState {
  State flesh, before;              ///< now and one step earlier, for sampling.
  PosedFrames now, past;            ///< their poses.
  bool has_before = false;          ///< `past` is one real step earlier.
  double last_h = 0.0;              ///< of the last step [s].
  Track track;                      ///< of BDF2.
  std::optional<StepEnd> step_end;  ///< of TR-BDF2; empty before the first step.
  /// During a cut: the flesh's velocity relative to its frames [m/s].
  std::optional<lattice::Points> relative_velocity;
  StepCounter counter;
  EnergyCap::Memory energy;
  ModelMemory model;
};

/// The state as bytes, for files and hashes: little-endian, with a version. The order of its parts is that of
/// one description (moving_state.cpp), which every function here goes by.
std::string to_bytes(const MovingState& state);
/// The inverse. Throws std::invalid_argument naming the part where the bytes end or have a count that cannot
/// be, and for another version.
MovingState moving_state_from_bytes(std::string_view bytes);

/// 64 bits of all parts (FNV-1a); equal states have equal hashes.
std::uint64_t hash(const MovingState& state);

/// The name of the first part whose bits differ, as "track[1].v"; empty where there is none.
std::string first_difference(const MovingState& a, const MovingState& b);

/// The state on another leaf mesh of the hierarchy: shared vertices keep their values; a vertex that is new
/// has the mean of its parents', so that its function has neither coefficient nor velocity. What the model
/// and the energy cap remember of single cells is forgotten: the model factors anew.
MovingState carried_over(const MovingState& state, const lattice::Hierarchy& hierarchy,
                         const lattice::LeafMesh& from, const lattice::LeafMesh& to);

}  // namespace sinew::fem
