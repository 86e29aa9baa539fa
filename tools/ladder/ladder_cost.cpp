#include "tools/ladder/ladder_cost.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "assets/lattice_cache.h"
#include "fem/models/model.h"
#include "tools/session/run_settings.h"
#include "tools/support/text.h"

namespace sinew::tools {
namespace {

constexpr double kLongestTrial = 5.0;      ///< of one rung on one level, and of settling it [s].
constexpr double kLongestAssembly = 30.0;  ///< of a level to try rungs on [s].
constexpr int kStepsOfTrial = 3;
constexpr double kLongLadder = 600.0;  ///< from which on there is a hint [s].

class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

/// A level of the lattice to try rungs on, and what of its setup all of them share.
struct Level {
  Character character;
  fem::Body body;
  double seconds = 0.0;  ///< to load and assemble it, without building the lattice [s].
};

std::unique_ptr<Level> make_level(const Scene& scene, const Caller& caller) {
  Caller quiet = caller;
  quiet.talk = {};
  Character character = make_character(scene, quiet);
  // The runs take it from there.
  if (!character.new_lattice_key.empty())
    assets::keep_lattice(assets::cache_folder(scene.output), character.new_lattice_key, character.lattice,
                         character.input.joints);
  double seconds = 0.0;
  for (const auto& [phase, taken] : character.times)
    if (phase == "load") seconds += taken;
  const Stopwatch watch;
  fem::Body body = make_body(character);
  auto level = std::make_unique<Level>(Level{std::move(character), std::move(body), 0.0});
  level->seconds = seconds + watch.seconds();
  return level;
}

/// What of a scene a trial and its estimate need to know.
struct Times {
  double first = 0.0, middle = 0.0;  ///< of the clip's part [s].
  double span = 0.0;                 ///< [s].
  int frames = 0;
};

Times times_of(const Scene& scene, const Character& character) {
  const FrameRange range = frame_range(scene, character, [](const std::string&) {});
  Times times;
  times.first = character.the_clip().start + range.first / scene.fps;
  times.span = (range.last - range.first) / scene.fps;
  times.middle = times.first + 0.5 * times.span;
  times.frames = range.last - range.first + 1;
  return times;
}

fem::Motion motion_of(const Character& character) {
  return [&character](double time) { return character.pose(time); };
}

/// How long flesh takes to settle [s]: by the cheapest model of elements, as all of them take the same; the
/// scene's limit where that would take long to say.
double settling_time(const Scene& scene, const Level& level, double first, const Caller& caller) {
  fem::SimulationOptions options = simulation_options(scene, level.character, level.body);
  options.model = fem::kDefaultModel;
  options.integrator = fem::Integrator::Bdf2;
  const Stopwatch watch;
  fem::Simulation simulation(level.body, motion_of(level.character), first, options,
                             [&] { return caller.wants_to_stop() || watch.seconds() > kLongestTrial; });
  const fem::SimulationReport report = simulation.settle();
  return report.status == fem::SimulationStatus::Ok ? report.steps * options.step : options.settle_limit;
}

/// A few steps in the middle of the motion.
RungCost try_rung(const Scene& scene, const Level& level, double time) {
  fem::SimulationOptions options = simulation_options(scene, level.character, level.body);
  options.settle_limit = std::min(options.settle_limit, options.step);
  RungCost cost;
  cost.vertices = level.body.mesh.num_vertices();
  const Stopwatch setup;
  fem::Simulation simulation(level.body, motion_of(level.character), time, options);
  const bool settled = simulation.settle().status == fem::SimulationStatus::Ok;
  cost.setup = level.seconds + setup.seconds();
  const Stopwatch stepping;
  int steps = 0;
  while (settled && steps < kStepsOfTrial && (steps == 0 || stepping.seconds() < kLongestTrial)) {
    ++steps;
    if (simulation.advance_to(time + (steps - 0.5) * options.step).status != fem::SimulationStatus::Ok) break;
  }
  cost.per_step = stepping.seconds() / std::max(1, steps);
  const Stopwatch frame;
  const lattice::Points skin = simulation.skin_of(simulation.positions_at(simulation.flesh().time));
  assets::skin(level.character.rig, level.character.pose(time));
  if (skin.rows() > 0) simulation.measures_at(simulation.flesh().time);
  cost.per_frame = frame.seconds();
  return cost;
}

/// Every rung on every level that has runs to come, from coarse to fine.
class Trials {
 public:
  Trials(const Scene& scene, const std::vector<LadderRun>& runs, const Caller& caller) : caller_(caller) {
    for (const LadderRun& run : runs) {
      if (run.reused) continue;
      Scene first = scene_of_run(scene, run.rung, run.level, run.step);
      first.output = run.folder;
      levels_[run.level].emplace(run.rung, first);
    }
  }

  void run() {
    int total = 0;
    for (const auto& [number, rungs] : levels_) total += static_cast<int>(rungs.size());
    for (const auto& [number, rungs] : levels_) {
      // The next level has eight times the cells.
      const bool may_try = last_ == nullptr || 8.0 * last_->seconds < kLongestAssembly;
      if (may_try) {
        last_.reset();
        last_ = make_level(rungs.begin()->second, caller_);
      }
      vertices_ = last_->body.mesh.num_vertices() * std::pow(8.0, may_try ? 0 : number - last_level_);
      if (may_try) last_level_ = number;
      if (!settling_) {
        times_ = times_of(rungs.begin()->second, last_->character);
        settling_ = settling_time(rungs.begin()->second, *last_, times_.first, caller_);
      }
      for (const auto& [rung, run] : rungs) {
        try_or_scale(number, rung, run, may_try);
        caller_.report("estimating", static_cast<int>(costs_.size()), total);
      }
    }
  }

  double seconds_of(const LadderRun& run) const {
    return seconds_of(costs_.at({run.level, run.rung}), run.rung, run.step);
  }
  bool all_timed() const {
    return std::all_of(costs_.begin(), costs_.end(), [](const auto& entry) { return entry.second.timed; });
  }

 private:
  void try_or_scale(int level, const std::string& rung, const Scene& run, bool may_try) {
    caller_.stop_if_asked("while the ladder was estimated");
    RungCost& cost = costs_[{level, rung}];
    const auto coarser = coarser_.find(rung);
    if (coarser != coarser_.end()) cost = coarser->second.scaled_to(vertices_);
    if (coarser == coarser_.end() || (may_try && cost.of_run(1.0 + kStepsOfTrial, 1.0) < kLongestTrial)) {
      cost = try_rung(run, *last_, times_.middle);
      if (cost.vertices != vertices_) cost = cost.scaled_to(vertices_);
    }
    coarser_[rung] = cost;
  }

  double seconds_of(const RungCost& cost, const std::string& rung, double step) const {
    const double settling = fem::find_model(rung)->dynamic ? settling_.value_or(0.0) : 0.0;
    return cost.of_run((settling + times_.span) / step, times_.frames);
  }

  const Caller& caller_;
  std::map<int, std::map<std::string, Scene>> levels_;  ///< the first run of every rung.
  std::map<std::pair<int, std::string>, RungCost> costs_;
  std::map<std::string, RungCost> coarser_;
  std::unique_ptr<Level> last_;
  int last_level_ = 0;
  double vertices_ = 0.0;  ///< of the level under way.
  std::optional<double> settling_;
  Times times_;
};

}  // namespace

RungCost RungCost::scaled_to(double num_vertices) const {
  const double growth = num_vertices / vertices;
  return {growth * setup, std::pow(growth, 4.0 / 3.0) * per_step, growth * per_frame, num_vertices, false};
}

LadderClock::LadderClock(std::vector<ExpectedRun> runs)
    : runs_(std::move(runs)), taken_(runs_.size(), -1.0) {}

void LadderClock::finish(std::size_t run, double seconds) { taken_[run] = seconds; }

double LadderClock::expected(const ExpectedRun& run) const {
  double of_rung = 0.0, expected_of_rung = 0.0, of_all = 0.0, expected_of_all = 0.0;
  for (std::size_t k = 0; k < runs_.size(); ++k) {
    const bool over = taken_[k] >= 0.0;
    expected_of_all += runs_[k].seconds;
    of_all += over ? taken_[k] : runs_[k].seconds;
    if (!over || runs_[k].rung != run.rung) continue;
    expected_of_rung += runs_[k].seconds;
    of_rung += taken_[k];
  }
  if (expected_of_rung > 0.0) return run.seconds * of_rung / expected_of_rung;
  return expected_of_all > 0.0 ? run.seconds * of_all / expected_of_all : 0.0;
}

double LadderClock::left() const {
  double sum = 0.0;
  for (std::size_t k = 0; k < runs_.size(); ++k)
    if (taken_[k] < 0.0) sum += expected(runs_[k]);
  return sum;
}

std::string LadderClock::dearest() const {
  std::map<std::pair<std::string, int>, double> sums;
  for (std::size_t k = 0; k < runs_.size(); ++k)
    if (taken_[k] < 0.0) sums[{runs_[k].rung, runs_[k].level}] += expected(runs_[k]);
  const auto most = std::max_element(sums.begin(), sums.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == sums.end() || !(most->second > 0.0)
             ? ""
             : fmt::format("{}, level {}", most->first.first, most->first.second);
}

std::string estimate_line(const LadderClock& clock, std::size_t num_runs, bool all_timed) {
  std::string line = fmt::format("about {} for {} run{}{}, most of it {}", duration_text(clock.left()),
                                 num_runs, num_runs == 1 ? "" : "s",
                                 all_timed ? "" : " (fine levels scaled from coarser ones)", clock.dearest());
  if (clock.left() > kLongLadder)
    line += "; hint: fewer --frames, --cells, --rungs or --levels, or longer --steps";
  return line;
}

LadderEstimate estimate_ladder(const Scene& scene, const std::vector<LadderRun>& runs, const Caller& caller) {
  std::unique_ptr<tbb::global_control> threads;
  if (scene.threads > 0)
    threads = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                    static_cast<std::size_t>(scene.threads));
  Trials trials(scene, runs, caller);
  trials.run();
  std::vector<ExpectedRun> expected;
  for (const LadderRun& run : runs)
    expected.push_back({run.rung, run.level, run.reused ? 0.0 : trials.seconds_of(run)});
  return {LadderClock(std::move(expected)), trials.all_timed()};
}

}  // namespace sinew::tools
