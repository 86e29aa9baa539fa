// What a step of every model costs, in processor time on one thread, side by side, and how far it is from
// neo-Hookean flesh: a clamped bar of 1 x 0.2 x 0.2 m, E = 1e7 Pa, nu = 0.45, swung to and fro by 60 degrees
// at 1 Hz with steps of 1/120 s. Usage: models_bench [frames of 1/60 s].

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include <tbb/global_control.h>

#include "fem/simulation.h"
#include "tests/fem/bar.h"

namespace sinew {
namespace {

/// Processor time [ms]: on one thread it is what a step costs, whatever else runs on the machine.
double milliseconds() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

std::vector<Eigen::Affine3d> swinging(double time) {
  const double angle = M_PI / 3.0 * std::sin(2.0 * M_PI * time) * std::min(1.0, 4.0 * time);
  return {Eigen::Affine3d(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()))};
}

struct Run {
  double median_ms = 0.0, worst_ms = 0.0;  ///< per step.
  std::vector<Eigen::RowVector3d> tip;     ///< per frame.
  std::string failure;
};

Run run(const fem::Body& body, const std::string& model, int frames) {
  fem::SimulationOptions options;
  options.model = model;
  options.gravity.setZero();
  fem::Simulation simulation(body, swinging, 0.0, options);
  const int tip = tests::vertex_at(body, {1.0, 0.0, 0.0});
  Run result;
  std::vector<double> times;
  for (int step = 1; step <= 2 * frames && result.failure.empty(); ++step) {
    const double start = milliseconds();
    const fem::SimulationReport report = simulation.advance_to(step / 120.0);
    times.push_back(milliseconds() - start);
    if (report.status != fem::SimulationStatus::Ok) result.failure = report.message;
    if (step % 2 == 0) result.tip.emplace_back(simulation.state().x.row(tip));
  }
  std::sort(times.begin(), times.end());
  result.median_ms = times[times.size() / 2];
  result.worst_ms = times.back();
  return result;
}

double rms_distance(const Run& a, const Run& b) {
  double sum = 0.0;
  const std::size_t n = std::min(a.tip.size(), b.tip.size());
  for (std::size_t k = 0; k < n; ++k) sum += (a.tip[k] - b.tip[k]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(n));
}

void compare(int levels, int frames) {
  tests::BarOptions options;
  options.levels = levels;
  options.material = {1e7, 0.45, 1000.0};
  options.damping = {0.03, 4.0};
  const fem::Body body = tests::bar_body(options);
  std::printf("%d nodes, %zu leaf cells, %d frames\n", body.mesh.num_vertices(), body.mesh.cells.size(),
              frames);
  std::printf("%-18s %10s %10s %10s %22s\n", "model", "ms/step", "worst", "ratio", "tip from neo-hookean");
  const Run exact = run(body, "neo-hookean", frames);
  const Run base = run(body, std::string(fem::kDefaultModel), frames);
  for (const fem::ModelInfo& info : fem::models()) {
    const Run r = info.name == "neo-hookean" ? exact : run(body, std::string(info.name), frames);
    std::printf("%-18s %10.3f %10.3f %9.2fx %20.3f %%%s\n", std::string(info.name).c_str(), r.median_ms,
                r.worst_ms, r.median_ms / base.median_ms, 100.0 * rms_distance(r, exact),
                (" " + r.failure).c_str());
  }
}

}  // namespace
}  // namespace sinew

/// One core: the figures are per core.
int main(int argc, char** argv) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const int frames = argc > 1 ? std::atoi(argv[1]) : 30;
  sinew::compare(2, frames);
  sinew::compare(3, std::max(1, frames / 3));
  return 0;
}
