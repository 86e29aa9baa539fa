// What a step of every model costs, in processor time on one thread, and how far it is from neo-Hookean
// flesh, as a Markdown table: the bar of swinging_bar.h with steps of 1/120 s by BDF2.
// Usage: models_bench [frames of 1/60 s].

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "fem/time/simulation.h"
#include "tests/bench/swinging_bar.h"

namespace sinew {
namespace {

/// Processor time [ms]: on one thread it is what a step costs, whatever else runs on the machine.
double milliseconds() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

struct Run {
  double median_ms = 0.0;               ///< per step.
  std::vector<Eigen::RowVector3d> tip;  ///< per frame.
  std::string failure;
};

Run run(const fem::Body& body, const std::string& model, int frames) {
  fmt::print(stderr, "{} vertices, {}\n", body.mesh.num_vertices(), model);
  fem::SimulationOptions options;
  options.model = model;
  options.gravity.setZero();
  fem::Simulation simulation(body, tests::swinging, 0.0, options);
  const int tip = tests::tip_of(body);
  Run result;
  std::vector<double> times;
  for (int step = 1; step <= 2 * frames && result.failure.empty(); ++step) {
    const double start = milliseconds();
    const fem::SimulationReport report = simulation.advance_to(step / 120.0);
    times.push_back(milliseconds() - start);
    if (report.status != fem::SimulationStatus::Ok) result.failure = report.message;
    if (step % 2 == 0) result.tip.emplace_back(simulation.flesh().x.row(tip));
  }
  std::sort(times.begin(), times.end());
  result.median_ms = times[times.size() / 2];
  return result;
}

/// One cell per column of the table: ms, over those of the default model, distance of the tip.
std::map<std::string, std::string> columns(const fem::Body& body, int frames) {
  std::map<std::string, Run> runs;
  for (const fem::ModelInfo& info : fem::models())
    runs[std::string(info.name)] = run(body, std::string(info.name), frames);
  const Run &exact = runs.at("neo-hookean"), &base = runs.at(std::string(fem::kDefaultModel));
  std::map<std::string, std::string> cells;
  for (const auto& [model, r] : runs) {
    const double share = 100.0 * tests::rms_distance(r.tip, exact.tip);
    cells[model] = fmt::format("{} | {} | {}", tests::short_number(r.median_ms),
                               tests::short_number(r.median_ms / base.median_ms),
                               r.failure.empty() ? tests::short_number(share) + " %" : r.failure);
  }
  return cells;
}

}  // namespace
}  // namespace sinew

int main(int argc, char** argv) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const int frames = argc > 1 ? std::atoi(argv[1]) : 45;
  const sinew::fem::Body coarse = sinew::tests::swinging_bar(5, 1, 2),
                         fine = sinew::tests::swinging_bar(5, 1, 3);
  const auto left = sinew::columns(coarse, frames), right = sinew::columns(fine, std::max(1, frames / 3));
  fmt::print("| model |");
  for (const sinew::fem::Body* body : {&coarse, &fine})
    fmt::print(" {} vertices, ms per step | times `{}` | tip |", body->mesh.num_vertices(),
               sinew::fem::kDefaultModel);
  fmt::print("\n|---|---|---|---|---|---|---|\n");
  for (const sinew::fem::ModelInfo& info : sinew::fem::models()) {
    const std::string name(info.name);
    fmt::print("| `{}` | {} | {} |\n", name, left.at(name), right.at(name));
  }
  return 0;
}
