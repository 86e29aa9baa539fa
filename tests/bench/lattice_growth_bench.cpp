// How the time and memory of building a lattice grow with the number of cells, 1e3 to 1e5, on two legs of
// flesh. Prints the fitted exponent of the time, and the peak of the memory beside the estimate.

#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <string>

#include <benchmark/benchmark.h>

#include "lattice/build.h"
#include "tests/lattice/limbs.h"

namespace sinew {
namespace {

struct Sample {
  double cells = 0.0;
  double seconds = 1e300;  ///< best of the repetitions.
};
std::map<int, Sample> samples;

/// Largest resident memory of this process so far [bytes].
double peak_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.rfind("VmHWM:", 0) == 0) return 1024.0 * std::stod(line.substr(6));
  return 0.0;
}

void BuildLattice(benchmark::State& state) {
  const tests::Character legs = tests::two_legs();
  lattice::BuildOptions options;
  options.cells = static_cast<int>(state.range(0));
  options.max_retries = 0;
  options.construction = lattice::Construction::Tetrahedra;
  for (auto _ : state) {
    const auto start = std::chrono::steady_clock::now();
    const lattice::BuildResult result = lattice::build(legs.skin, legs.joints, options);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    state.SetIterationTime(elapsed.count());
    Sample& sample = samples[options.cells];
    sample.cells = static_cast<double>(result.lattice.complex.cells.size());
    sample.seconds = std::min(sample.seconds, elapsed.count());
    if (result.lattice.quality.skin_vertices_outside > 0) state.SkipWithError("skin outside the lattice");
  }
  state.counters["cells"] = samples[options.cells].cells;
  std::printf("%7.0f cells: peak so far %6.0f MB, estimate %6.0f MB\n", samples[options.cells].cells,
              1e-6 * peak_bytes(), 1e-6 * static_cast<double>(lattice::estimated_build_bytes(options.cells)));
}

/// Least squares of log seconds over log cells.
double exponent() {
  double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
  for (const auto& [wanted, sample] : samples) {
    const double a = std::log(sample.cells), b = std::log(sample.seconds);
    n += 1.0, x += a, y += b, xx += a * a, xy += a * b;
  }
  return (n * xy - x * y) / (n * xx - x * x);
}

BENCHMARK(BuildLattice)
    ->Arg(1'000)
    ->Arg(3'000)
    ->Arg(10'000)
    ->Arg(30'000)
    ->Arg(100'000)
    ->UseManualTime()
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace sinew

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  if (sinew::samples.size() < 2) return 0;  // a filter chose one size
  std::printf("time grows like cells^%.2f\n", sinew::exponent());
  return 0;
}
