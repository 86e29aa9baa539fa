// Every phase of a run on one character, and a step beside a plain prefactored linear step on the same
// lattice. The character: SINEW_BENCH_RIG from the environment, else the bundled hopper.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include "fem/models/detail/blended_solver.h"
#include "tools/session/character.h"
#include "tools/session/run_settings.h"

namespace sinew {
namespace {

tools::Scene scene() {
  tools::Scene s;
  const char* rig = std::getenv("SINEW_BENCH_RIG");
  s.rig = rig != nullptr ? rig : SINEW_SOURCE_DIR "/assets/samples/hopper.glb";
  return s;
}

/// Loaded, built and assembled once; counts printed first.
struct Setup {
  tools::Character character = tools::make_character(scene(), {});
  fem::Body body = tools::make_body(character);

  Setup() {
    fem::Simulation probe = simulation(body, fem::Precision::Double);
    static_cast<void>(probe.advance_to(start() + 1e-3));
    const fem::SolverCounts counts = probe.counts();
    long unknowns = 0;
    for (int u : counts.unknowns) unknowns += u;
    std::printf(
        "%s: %zu cells, %zu leaf cells, %d functions, %d regions, %ld unknowns over all regions, %zu entries "
        "of "
        "factors\n",
        character.rig.file.c_str(), body.lattice.complex.cells.size(), body.mesh.cells.size(),
        counts.functions, counts.regions, 3 * unknowns, counts.factor_nonzeros);
  }
  double start() const { return character.the_clip().start; }
  fem::Simulation simulation(const fem::Body& of, fem::Precision precision) const {
    fem::SimulationOptions options = tools::simulation_options(scene());
    options.solver.precision = precision;
    const tools::Character* c = &character;
    // There and back, again and again: bones that stand still at the clip's end are another case.
    const double begin = start(), length = c->the_clip().end - begin;
    const auto pose = [c, begin, length](double time) {
      const double there = std::fmod(std::abs(time - begin), 2.0 * length);
      return c->pose(begin + std::min(there, 2.0 * length - there));
    };
    return {of, pose, begin, options};
  }
};

const Setup& setup() {
  static const Setup the_setup;
  return the_setup;
}

void BuildLattice(benchmark::State& state) {
  lattice::BuildOptions options;
  options.cells = static_cast<int>(state.range(0));
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        lattice::build(setup().character.input.skin.surface, setup().character.input.joints, options));
  }
}

void Assemble(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(tools::make_body(setup().character).volume);
}

void Factorise(benchmark::State& state) {
  for (auto _ : state) {
    fem::BlendedSolver solver(setup().body);
    benchmark::DoNotOptimize(solver.prepare(1.0 / 120.0, fem::Integrator::Bdf2).ok);
  }
}

void Embed(benchmark::State& state) {
  const auto simulation = setup().simulation(setup().body, fem::Precision::Double);
  for (auto _ : state) benchmark::DoNotOptimize(simulation.skin_of(simulation.flesh().x).sum());
}

/// Steps of 1/120 s through the clip, there and back; real_time_ratio below 1 is faster than the clip plays.
void step(benchmark::State& state, const fem::Body& body, fem::Precision precision) {
  const double h = 1.0 / 120.0;
  auto simulation = std::make_unique<fem::Simulation>(setup().simulation(body, precision));
  double time = setup().start() - 0.5 * h;  // between two steps: one per call, whatever the rounding
  static_cast<void>(simulation->advance_to(time += h));  // factors
  for (auto _ : state) {
    if (simulation->advance_to(time += h).status != fem::SimulationStatus::Ok)
      state.SkipWithError("the step failed");
  }
  state.counters["real_time_ratio"] = benchmark::Counter(
      h * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
void StepBlended(benchmark::State& state) { step(state, setup().body, fem::Precision::Double); }
void StepBlendedFloat(benchmark::State& state) { step(state, setup().body, fem::Precision::Float); }
/// The same lattice as one linear region: what a plain prefactored linear step costs.
void StepPlainLinear(benchmark::State& state) {
  static const fem::Body one_region = [] {
    tools::Character plain = setup().character;
    plain.body_options.regions.merge_angle = 10.0;  // radians: every frame shares its root's region
    return tools::make_body(plain);
  }();
  step(state, one_region, fem::Precision::Double);
}

void WholeClip(benchmark::State& state) {
  for (auto _ : state) {
    const tools::Character character = tools::make_character(scene(), {});
    const fem::Body body = tools::make_body(character);
    fem::Simulation simulation = setup().simulation(body, fem::Precision::Double);
    if (simulation.settle().status != fem::SimulationStatus::Ok) state.SkipWithError("settling failed");
    for (double t = character.the_clip().start; t <= character.the_clip().end; t += 1.0 / 30.0) {
      if (simulation.advance_to(t).status != fem::SimulationStatus::Ok) state.SkipWithError("a step failed");
      benchmark::DoNotOptimize(simulation.skin_of(simulation.positions_at(t)).sum());
    }
  }
}

BENCHMARK(BuildLattice)->Arg(200)->Arg(1000)->Arg(5000)->Unit(benchmark::kMillisecond);
BENCHMARK(Assemble)->Unit(benchmark::kMillisecond);
BENCHMARK(Factorise)->Unit(benchmark::kMillisecond);
BENCHMARK(Embed)->Unit(benchmark::kMillisecond);
BENCHMARK(StepPlainLinear)->Unit(benchmark::kMillisecond);
BENCHMARK(StepBlended)->Unit(benchmark::kMillisecond);
BENCHMARK(StepBlendedFloat)->Unit(benchmark::kMillisecond);
BENCHMARK(WholeClip)->Unit(benchmark::kMillisecond)->Iterations(1);

}  // namespace
}  // namespace sinew

/// One core: the figures are per core.
int main(int argc, char** argv) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  sinew::setup();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
