#include "tools/ladder/ladder.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <tuple>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "assets/atomic_output.h"
#include "assets/error.h"
#include "assets/result.h"
#include "fem/models/model.h"
#include "tools/ladder/ladder_cost.h"
#include "tools/scene/scene_fields.h"
#include "tools/session/run_report.h"
#include "tools/session/simulate.h"
#include "tools/support/errors.h"
#include "tools/support/text.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;

std::string read_file(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream bytes;
  if (stream) bytes << stream.rdbuf();
  if (!stream) throw assets::IoError(file + ": cannot be read");
  return bytes.str();
}

class Hash {
 public:
  void add(const std::string& bytes) {
    for (const char byte : bytes) {
      value_ = (value_ ^ static_cast<unsigned char>(byte)) * 1099511628211ull;  // FNV-1a, 64 bits
    }
    value_ = (value_ ^ 0xff) * 1099511628211ull;  // an end, so that "ab", "c" is not "a", "bc"
  }
  std::string text() const { return fmt::format("{:016x}", value_); }

 private:
  std::uint64_t value_ = 14695981039346656037ull;
};

std::string step_text(double step) {
  Scene scratch;
  scratch.step = step;
  return flag_text(scratch, *find_scene_field("step"));
}

int rank(const std::string& rung) { return static_cast<int>(fem::find_model(rung) - fem::models().data()); }

std::string failure_file(const LadderRun& run) { return (fs::path(run.folder) / "failure.txt").string(); }

/// Reads what the run's own report says of its cost.
void read_costs(LadderRun& run) {
  const std::string file = (fs::path(run.folder) / "report.json").string();
  const auto json = nlohmann::ordered_json::parse(read_file(file), nullptr, false);
  try {
    run.setup = run.per_frame = 0.0;
    run.steps = 0;
    for (const auto& frame : json.at("frames")) run.steps += frame.at("steps").get<int>();
    const auto frames = static_cast<double>(json.at("frames").size());
    for (const auto& [phase, seconds] : json.at("seconds").items()) {
      run.phases.emplace_back(phase, seconds.get<double>());
      if (phase == "simulate and write frames") {
        run.per_frame = seconds.get<double>() / frames;
      } else if (phase != "preview" && phase != kJudging) {
        run.setup += seconds.get<double>();
      }
    }
    if (const auto skin = json.find("skin"); skin != json.end()) {  // a plain scene has none
      run.verdict = skin->at("verdict").get<std::string>();
      run.fault = skin->at("line").get<std::string>();
    }
  } catch (const nlohmann::json::exception& e) {
    throw assets::InputError(
        file, fmt::format("no report of a run ({}); hint: remove the folder {}", e.what(), run.folder));
  }
}

/// A run of the grid, as far as its folder holds it.
LadderRun planned_run(const Scene& scene, const std::string& folder) {
  LadderRun run;
  run.rung = scene.model;
  run.level = scene.levels;
  run.step = scene.step;
  std::string step = step_text(scene.step);
  std::replace(step.begin(), step.end(), '/', '_');
  run.folder =
      (fs::path(folder) / fmt::format("{}-l{}-s{}-{}", scene.model, scene.levels, step, settings_hash(scene)))
          .string();
  run.reused = fs::exists(fs::path(run.folder) / "report.json") || fs::exists(failure_file(run));
  return run;
}

void do_run(const Scene& scene, LadderRun& run, const Caller& caller) {
  if (run.reused && fs::exists(failure_file(run))) run.failure = read_file(failure_file(run));
  if (!run.reused) {
    Scene with_output = scene;
    with_output.output = run.folder;
    try {
      Caller quiet = caller;
      quiet.talk = {};
      simulate(with_output, quiet);
    } catch (const NumericalError& error) {
      // The same settings fail again: so the ladder keeps this answer as it keeps others.
      run.failure = error.what();
      fs::create_directories(run.folder);
      assets::write_file(failure_file(run), run.failure, assets::Overwrite::Replace);
    }
  }
  if (run.ok()) read_costs(run);
}

/// "blended, level 1, 1/120 s: 12 ms per frame".
std::string outcome(const LadderRun& run) {
  return fmt::format(
      "{}: {}{}", run.name(),
      run.ok() ? fmt::format("{:.3g} ms per frame", 1e3 * run.per_frame) : "failed: " + run.failure,
      run.reused ? " (was there)" : "");
}

void do_runs(const Scene& scene, std::vector<LadderRun>& runs, const Caller& caller) {
  const Talk talk = caller.words();
  const auto missing =
      std::count_if(runs.begin(), runs.end(), [](const LadderRun& run) { return !run.reused; });
  LadderClock clock({});
  if (missing > 0) {
    LadderEstimate estimate = estimate_ladder(scene, runs, caller);
    clock = std::move(estimate.clock);
    talk(estimate_line(clock, static_cast<std::size_t>(missing), estimate.all_timed));
  }
  for (std::size_t k = 0; k < runs.size(); ++k) {
    LadderRun& run = runs[k];
    caller.stop_if_asked(fmt::format("after {} runs of the ladder; the same command goes on", k));
    const auto start = std::chrono::steady_clock::now();
    do_run(scene_of_run(scene, run.rung, run.level, run.step), run, caller);
    std::string line = fmt::format("[{}/{}] {}", k + 1, runs.size(), outcome(run));
    if (!run.reused) {
      clock.finish(k, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
      if (clock.left() > 0.0) line += fmt::format("; {} left", duration_text(clock.left()));
    }
    talk(line);
  }
}

int find_reference(const std::vector<LadderRun>& runs) {
  int best = -1;
  const auto finer = [](const LadderRun& a, const LadderRun& b) {
    return std::tuple(rank(a.rung), a.level, -a.step) > std::tuple(rank(b.rung), b.level, -b.step);
  };
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (runs[i].ok() && (best < 0 || finer(runs[i], runs[static_cast<std::size_t>(best)])))
      best = static_cast<int>(i);
  }
  return best;
}

/// The nearest coarser runs of the reference's rung, by level and by step.
void find_neighbours(Ladder& ladder) {
  const LadderRun& reference = ladder.runs[static_cast<std::size_t>(ladder.reference)];
  int by_level = -1, by_step = -1;
  for (int i = 0; i < static_cast<int>(ladder.runs.size()); ++i) {
    const LadderRun& run = ladder.runs[static_cast<std::size_t>(i)];
    if (!run.ok() || run.rung != reference.rung) continue;
    const auto at = [&](int k) -> const LadderRun& { return ladder.runs[static_cast<std::size_t>(k)]; };
    if (run.step == reference.step && run.level < reference.level &&
        (by_level < 0 || run.level > at(by_level).level))
      by_level = i;
    if (run.level == reference.level && run.step > reference.step &&
        (by_step < 0 || run.step < at(by_step).step))
      by_step = i;
  }
  for (const auto& [what, run] :
       {std::pair{"one level less", by_level}, std::pair{"the next longer step", by_step}}) {
    if (run >= 0)
      ladder.neighbours.push_back({what, run, ladder.runs[static_cast<std::size_t>(run)].error.rms});
  }
}

void mark_front(std::vector<LadderRun>& runs) {
  for (LadderRun& run : runs) {
    run.on_front = run.ok() && std::none_of(runs.begin(), runs.end(), [&](const LadderRun& other) {
                     if (!other.ok() || &other == &run) return false;
                     const bool no_worse =
                         other.per_frame <= run.per_frame && other.error.rms <= run.error.rms;
                     return no_worse && (other.per_frame < run.per_frame || other.error.rms < run.error.rms);
                   });
  }
}

}  // namespace

std::string LadderRun::name() const {
  return fmt::format("{}, level {}, {} s", rung, level, step_text(step));
}

bool Ladder::converged() const {
  return neighbours.size() == 2 &&
         std::all_of(neighbours.begin(), neighbours.end(),
                     [&](const LadderNeighbour& n) { return n.rms <= limit * height; });
}

int Ladder::cheapest_within(double metres) const {
  int best = -1;
  for (int i = 0; i < static_cast<int>(runs.size()); ++i) {
    const LadderRun& run = runs[static_cast<std::size_t>(i)];
    if (i == reference || !run.ok() || run.error.largest > metres) continue;
    if (best < 0 || run.per_frame < runs[static_cast<std::size_t>(best)].per_frame) best = i;
  }
  return best;
}

Scene scene_of_run(const Scene& scene, const std::string& rung, int level, double step) {
  Scene run = scene;
  run.model = rung;
  run.levels = level;
  run.step = step;
  run.output.clear();
  run.overwrite = run.json = false;
  run.preview = Switch::Off;
  return run;
}

std::string settings_hash(const Scene& scene) {
  Scene settings = scene;
  Hash hash;
  hash.add(SINEW_VERSION);
  for (std::string Scene::*file : {&Scene::rig, &Scene::lattice, &Scene::output_mesh}) {
    hash.add((settings.*file).empty() ? std::string() : read_file(settings.*file));
    (settings.*file).clear();  // what it holds counts, not where it lies
  }
  settings.output.clear();
  settings.threads = 0;  // the results do not depend on it
  settings.overwrite = settings.json = false;
  hash.add(print_scene(settings));
  return hash.text();
}

Ladder run_ladder(const Scene& scene, const LadderGrid& grid, double limit, const std::string& folder,
                  const Caller& caller) {
  Ladder ladder;
  ladder.limit = limit;
  settings_hash(scene);  // names a file that cannot be read before anything is written
  const std::string runs = (fs::path(folder) / "runs").string();
  fs::create_directories(runs);
  for (const std::string& rung : grid.rungs) {
    for (const int level : grid.levels) {
      for (const double step : grid.steps)
        ladder.runs.push_back(planned_run(scene_of_run(scene, rung, level, step), runs));
    }
  }
  do_runs(scene, ladder.runs, caller);
  ladder.reference = find_reference(ladder.runs);
  if (ladder.reference < 0)
    throw NumericalError("no run of the ladder worked; the first: " + ladder.runs.front().failure);
  const assets::Result reference(ladder.runs[static_cast<std::size_t>(ladder.reference)].folder);
  ladder.height = reference.height();
  for (LadderRun& run : ladder.runs) {
    if (run.ok()) run.error = compare(reference, assets::Result(run.folder));
  }
  find_neighbours(ladder);
  mark_front(ladder.runs);
  return ladder;
}

}  // namespace sinew::tools
