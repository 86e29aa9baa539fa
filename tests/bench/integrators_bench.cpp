// What every integrator does to a swing, a whip and a spin, and what it costs: a bar of 1 x 0.2 x 0.2 m in 10
// x 2 x 2 cells, rho = 1000 kg/m^3, nu = 0.3, whose lowest frequency is 4 Hz, as neo-Hookean flesh. Prints
// the table of tests/measured/time.md.

#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <tbb/global_control.h>

#include "fem/time/simulation.h"
#include "tests/fem/bar.h"

namespace sinew {
namespace {

using fem::Integrator;
using lattice::Points;

constexpr double kFrequency = 4.0;  ///< Hz.

/// Clamped at x = 0 or free, with Young's modulus such that the clamped one's lowest frequency is
/// `frequency`.
fem::Body bar(double damping, bool clamped, double frequency) {
  tests::BarOptions options;
  const double soft = tests::natural_frequencies(tests::bar_body(options), 1)[0];
  options.material.young *= std::pow(frequency / soft, 2);
  options.damping = {damping, frequency};
  options.clamped = clamped;
  return tests::bar_body(options);
}

fem::SimulationOptions options_of(Integrator integrator, double step) {
  fem::SimulationOptions options;
  options.model = "neo-hookean";
  options.integrator = integrator;
  options.step = step;
  options.gravity.setZero();
  return options;
}

std::vector<Eigen::Affine3d> still(double) { return {Eigen::Affine3d::Identity()}; }

/// To and fro by 60 degrees once a second, from rest.
std::vector<Eigen::Affine3d> swinging(double time) {
  const double angle = M_PI / 3.0 * std::pow(std::sin(M_PI * time), 2);
  return {Eigen::Affine3d(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()))};
}

/// Tip at 60 times a second for one second.
std::vector<Eigen::RowVector3d> swing(Integrator integrator, double step) {
  const fem::Body body = bar(0.03, true, kFrequency);
  const int tip = tests::vertex_at(body, {1.0, 0.0, 0.0});
  fem::Simulation simulation(body, swinging, 0.0, options_of(integrator, step));
  std::vector<Eigen::RowVector3d> path;
  for (int frame = 1; frame <= 60; ++frame) {
    if (simulation.advance_to(frame / 60.0).status != fem::SimulationStatus::Ok) return {};
    path.emplace_back(simulation.positions_at(frame / 60.0).row(tip));
  }
  return path;
}

/// rms distance in % of the bar's length, 1 m.
double error(const std::vector<Eigen::RowVector3d>& path, const std::vector<Eigen::RowVector3d>& exact) {
  if (path.size() != exact.size()) return std::nan("");
  double sum = 0.0;
  for (std::size_t k = 0; k < path.size(); ++k) sum += (path[k] - exact[k]).squaredNorm();
  return 100.0 * std::sqrt(sum / static_cast<double>(path.size()));
}

/// Share of the amplitude left after five swings without damping, released from a small bend, at 1/120 s.
double whip(Integrator integrator) {
  const fem::Body body = bar(0.0, true, kFrequency);
  const fem::SimulationOptions options = options_of(integrator, 1.0 / 120.0);
  fem::Simulation simulation(body, still, 0.0, options);
  // Velocity in the shape of the static sag: almost the first mode alone.
  const Points sag = tests::static_displacement(body, tests::gravity_force(body, {0.0, 0.0, -0.1}));
  simulation.set_velocity(sag);
  const int tip = tests::vertex_at(body, {1.0, 0.0, 0.0});
  double first = 0.0, last = 0.0;
  for (int step = 1; step <= 180; ++step) {
    if (simulation.advance_to(step / 120.0).status != fem::SimulationStatus::Ok) return std::nan("");
    const double bend = std::abs(simulation.flesh().x(tip, 2));
    if (step <= 30) first = std::max(first, bend);
    if (step > 150) last = std::max(last, bend);
  }
  return last / first;
}

/// Share of the spin that such a bar, free, has left of one turn per second after one second at 1/60
/// s.
double spin(Integrator integrator) {
  const fem::Body body = bar(0.0, false, kFrequency);
  fem::Simulation simulation(body, still, 0.0, options_of(integrator, 1.0 / 60.0));
  const Eigen::RowVector3d centre(0.5, 0.0, 0.0), axis(0.0, 2.0 * M_PI, 0.0);
  Points v(body.mesh.num_vertices(), 3);
  for (Eigen::Index a = 0; a < v.rows(); ++a)
    v.row(a) = axis.cross(Eigen::RowVector3d(body.mesh.points.row(a) - centre));
  simulation.set_velocity(v);
  const auto momentum = [&](const Points& x, const Points& velocity) {
    const Points p = fem::apply_mass(body.matrices, velocity);
    double sum = 0.0;
    for (Eigen::Index a = 0; a < x.rows(); ++a)
      sum += Eigen::RowVector3d(x.row(a) - centre).cross(Eigen::RowVector3d(p.row(a)))[1];
    return sum;
  };
  const double before = momentum(body.mesh.points, v);
  if (simulation.advance_to(1.0).status != fem::SimulationStatus::Ok) return std::nan("");
  return momentum(simulation.flesh().x, simulation.flesh().v) / before;
}

/// Processor time of a step at 1/120 s [ms].
double cost(Integrator integrator) {
  const fem::Body body = bar(0.03, true, kFrequency);
  fem::Simulation simulation(body, swinging, 0.0, options_of(integrator, 1.0 / 120.0));
  if (simulation.advance_to(0.25).status != fem::SimulationStatus::Ok) return std::nan("");
  const std::clock_t start = std::clock();
  const fem::SimulationReport report = simulation.advance_to(1.25);
  return 1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / report.steps;
}

void print_table() {
  const std::vector<std::pair<std::string, Integrator>> integrators{
      {"backward-euler", Integrator::BackwardEuler},
      {"bdf2", Integrator::Bdf2},
      {"tr-bdf2", Integrator::TrBdf2},
      {"implicit-midpoint", Integrator::ImplicitMidpoint}};
  const std::vector<Eigen::RowVector3d> exact = swing(Integrator::TrBdf2, 1.0 / 3840.0);
  std::printf(
      "| integrator | ms per step | swing, tip rms in %% of the length at 1/60, 1/120, 1/240 s | "
      "whip: amplitude left | spin left |\n|---|---|---|---|---|\n");
  for (const auto& [name, integrator] : integrators) {
    std::printf("| `%s` | %.2f | %.2g, %.2g, %.2g | %.2f | %.3f |\n", name.c_str(), cost(integrator),
                error(swing(integrator, 1.0 / 60.0), exact), error(swing(integrator, 1.0 / 120.0), exact),
                error(swing(integrator, 1.0 / 240.0), exact), whip(integrator), spin(integrator));
  }
}

}  // namespace
}  // namespace sinew

int main() {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  sinew::print_table();
}
