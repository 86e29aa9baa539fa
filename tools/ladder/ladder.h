#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tools/ladder/comparison.h"
#include "tools/scene/scene.h"
#include "tools/session/character.h"

/// One scene on every rung: what each costs, and how far it is from the scene's own converged answer.
namespace sinew::tools {

/// The grid of runs; every combination is one.
struct LadderGrid {
  std::vector<std::string> rungs;  ///< names of the registry of models; at least one.
  std::vector<int> levels;         ///< as Scene::levels; at least one.
  std::vector<double> steps;       ///< as Scene::step [s]; at least one.
};

/// One run and what it showed.
struct LadderRun {
  std::string rung;
  int level = 0;
  double step = 0.0;                                   ///< [s].
  std::string folder;                                  ///< of its results.
  bool reused = false;                                 ///< was there already.
  std::string failure;                                 ///< why it has no results; empty where it has.
  std::string verdict;                                 ///< on its skin, as report.json has it; may be empty.
  std::string fault;                                   ///< the line about it; empty where the skin is fine.
  double setup = 0.0;                                  ///< from the file to the first frame [s].
  double per_frame = 0.0;                              ///< stepping and writing [s].
  std::vector<std::pair<std::string, double>> phases;  ///< as report.json has them [s].
  int steps = 0;                                       ///< taken for all frames.
  Comparison error;                                    ///< against the reference; empty where the run failed.
  bool on_front = false;                               ///< no other run is cheaper and at least as exact.

  bool ok() const { return failure.empty(); }
  /// "neo-hookean, level 2, 1/240 s".
  std::string name() const;
};

/// A run next to the reference in the grid, and how far the two are apart.
struct LadderNeighbour {
  std::string what;  ///< "one level less", "the next longer step".
  int run = -1;
  double rms = 0.0;  ///< [m].
};

struct Ladder {
  std::vector<LadderRun> runs;
  int reference = -1;   ///< the finest run that worked: highest rung, then level, then shortest step.
  double height = 0.0;  ///< of the character [m].
  std::vector<LadderNeighbour> neighbours;  ///< of the reference.
  double limit = 0.0;                       ///< part of the height that neighbours may be apart (rms) [-].

  /// True where the grid holds a run with one level less and one with a longer step, and both are within the
  /// limit.
  bool converged() const;
  /// The cheapest run whose largest error is at most `metres`; -1 where only the reference itself is left.
  int cheapest_within(double metres) const;
};

/// The scene of one run of the grid, without an output.
Scene scene_of_run(const Scene& scene, const std::string& rung, int level, double step);

/// 16 hexadecimal digits from everything that a run's frames depend on: settings, version, content of its
/// input files. Throws assets::IoError where one cannot be read.
std::string settings_hash(const Scene& scene);

/// Runs what `folder`/runs does not hold yet, after it has said how long that will take, and measures all of
/// it. A run that fails numerically is part of the answer; other failures are thrown. Throws NumericalError
/// where no run worked.
Ladder run_ladder(const Scene& scene, const LadderGrid& grid, double limit, const std::string& folder,
                  const Caller& caller);

}  // namespace sinew::tools
