// What a change of the active set costs, over a step of `blended-stiffness` on the same body, in processor
// time on one thread: flesh to level 2, a body of level 1, and of it one that is refined in every eighth
// cell. The character: SINEW_BENCH_RIG from the environment, else the bundled hopper. Factors are made anew
// after a change and are not counted.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <vector>

#include <tbb/global_control.h>

#include "tools/session/character.h"
#include "tools/session/run_settings.h"

namespace sinew {
namespace {

constexpr double kStep = 1.0 / 120.0;  ///< [s].

/// Processor time [ms].
double milliseconds() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

template <class Action>
double median_ms(int repetitions, const Action& action) {
  std::vector<double> times;
  for (int i = 0; i < repetitions; ++i) {
    const double start = milliseconds();
    action();
    times.push_back(milliseconds() - start);
  }
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

/// The uniform set of level 1 and, in every eighth cell of level 0, the functions of level 2.
lattice::ActiveSet refined_here_and_there(const fem::Flesh& flesh) {
  lattice::ActiveSet active = fem::uniform_set(flesh, 1);
  const lattice::ActiveSet all = fem::uniform_set(flesh, 2);
  const lattice::Hierarchy& hierarchy = flesh.hierarchy;
  for (std::size_t hex = 0; hex < hierarchy.hexes(2).size(); ++hex) {
    if (hierarchy.coarse_cell(static_cast<int>(hex) / 8) % 8 != 0) continue;
    for (const int v : hierarchy.hexes(2)[hex])
      active[static_cast<std::size_t>(v)] |= all[static_cast<std::size_t>(v)];
  }
  return active;
}

double step_ms(const tools::Scene& scene, const tools::Character& character, const fem::Body& body) {
  fem::SimulationOptions options = tools::simulation_options(scene);
  options.model = "blended-stiffness";
  double time = character.the_clip().start;
  fem::Simulation simulation(
      body, [&](double t) { return character.pose(t); }, time, options);
  time -= 0.5 * kStep;  // between two steps: one per call, whatever the rounding
  static_cast<void>(simulation.advance_to(time += kStep));  // factors
  return median_ms(41, [&] {
    if (simulation.advance_to(time += kStep).status != fem::SimulationStatus::Ok) std::abort();
  });
}

void run() {
  tools::Scene scene;
  const char* rig = std::getenv("SINEW_BENCH_RIG");
  scene.rig = rig != nullptr ? rig : SINEW_SOURCE_DIR "/assets/samples/hopper.glb";
  scene.levels = 2;
  const tools::Character character = tools::make_character(scene, {});
  double start = milliseconds();
  const fem::Body finest = tools::make_body(character);
  const double whole = milliseconds() - start;
  const std::shared_ptr<const fem::Flesh> flesh = finest.flesh;
  const lattice::ActiveSet one = fem::uniform_set(*flesh, 1), here_and_there = refined_here_and_there(*flesh);
  const fem::Body coarse = fem::make_body(flesh, one);
  std::printf("%s: %zu cells; flesh to level 2 and its body %.0f ms\n", character.rig.file.c_str(),
              flesh->lattice.complex.cells.size(), whole);
  for (const auto& [name, set] : {std::pair("level 1", &one), {"levels 1 and 2", &here_and_there}}) {
    fem::Body body = coarse;
    const double change = median_ms(9, [&] { body = fem::changed(body, *set); });
    const double step = step_ms(scene, character, body);
    std::printf("to %s: %zu leaf cells, %d functions; change %.1f ms, step %.2f ms, ratio %.1f\n", name,
                body.mesh.cells.size(), body.mesh.num_functions(), change, step, change / step);
  }
}

}  // namespace
}  // namespace sinew

int main() {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  sinew::run();
  return 0;
}
