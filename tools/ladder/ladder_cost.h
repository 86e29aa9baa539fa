#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tools/ladder/ladder.h"
#include "tools/session/character.h"

/// What a ladder will take, said before it runs, and put right by every run that is over.
namespace sinew::tools {

/// What a rung costs on one level.
struct RungCost {
  double setup = 0.0;      ///< before the first step: load, assemble, first factor [s].
  double per_step = 0.0;   ///< of flesh under way [s].
  double per_frame = 0.0;  ///< of what a frame is measured and written in [s].
  double vertices = 0.0;   ///< leaf vertices.
  bool timed = true;       ///< else scaled from a coarser level.

  /// On a level of so many leaf vertices: steps with their power 4/3, as entries of sparse factors in space
  /// grow, the rest in proportion.
  RungCost scaled_to(double num_vertices) const;
  /// Of a run: steps while settling and along the frames, and the frames.
  double of_run(double steps, double frames) const { return setup + per_step * steps + per_frame * frames; }
};

/// A run of the grid and how long it is expected to take.
struct ExpectedRun {
  std::string rung;
  int level = 0;
  double seconds = 0.0;  ///< 0: it is there already.
};

/// The time that runs have left.
class LadderClock {
 public:
  explicit LadderClock(std::vector<ExpectedRun> runs);

  /// A run is over after `seconds`. Those of the same rung are expected to be off by as much; those of rungs
  /// without one by as much as the whole ladder is if the rest takes what was expected.
  void finish(std::size_t run, double seconds);

  /// Of the runs that are not over [s].
  double left() const;
  /// "neo-hookean, level 2": which rung and level take most of what is left; empty where nothing is left.
  std::string dearest() const;

 private:
  double expected(const ExpectedRun& run) const;

  std::vector<ExpectedRun> runs_;
  std::vector<double> taken_;  ///< of every run; negative: not over.
};

/// "about 12 min 5 s for 24 runs, ...": the line before the first run, and how to make a long ladder shorter.
std::string estimate_line(const LadderClock& clock, std::size_t num_runs, bool all_timed);

struct LadderEstimate {
  LadderClock clock;
  bool all_timed = true;  ///< false: some costs are scaled from coarser levels.
};

/// Times a few steps of every rung on every level of the runs that are not there yet, in the middle of the
/// motion; what would take long is scaled from a coarser level. Keeps the lattice in the runs' cache. Throws
/// what make_character throws.
LadderEstimate estimate_ladder(const Scene& scene, const std::vector<LadderRun>& runs, const Caller& caller);

}  // namespace sinew::tools
