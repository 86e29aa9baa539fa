// What a frame and a step cost, as two Markdown tables.
// First: `corotational` on the bar of swinging_bar.h by several integrators and steps, in processor time on
// one thread, with the error in time beside it. Second: steps on larger lattices, of one region and of
// several, factors in double, in float and in sixteen bits, on one thread and on two, in wall-clock time;
// that the bits do not depend on the threads is checked on the way. Usage: speed_bench [largest number of
// vertices].

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "fem/time/simulation.h"
#include "tests/bench/swinging_bar.h"
#include "tests/fem/arm.h"

namespace sinew {
namespace {

using fem::Integrator;
using lattice::Points;

constexpr int kFrames = 60;  ///< of 1/60 s: one whole swing.
constexpr int kRuns =
    3;  ///< of which the fastest counts: neighbours in the caches cost up to half as much again.

/// [ms]
double processor_time() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }
double wall_time() {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

void demand(const fem::SimulationReport& report) {
  if (report.status != fem::SimulationStatus::Ok) throw std::runtime_error(report.message);
}

struct Swing {
  double mean_ms = 0.0, worst_ms = 0.0;  ///< per frame.
  std::vector<Eigen::RowVector3d> tip;
};

Swing swing_once(const fem::Body& bar, Integrator integrator, int steps_per_frame) {
  fem::SimulationOptions options;
  options.model = "corotational";
  options.gravity.setZero();
  options.integrator = integrator;
  options.step = 1.0 / (60.0 * steps_per_frame);
  fem::Simulation simulation(bar, tests::swinging, 0.0, options);
  const int tip = tests::tip_of(bar);
  Swing result;
  for (int frame = 1; frame <= kFrames; ++frame) {
    const double start = processor_time();
    for (int k = steps_per_frame - 1; k >= 0; --k)
      demand(simulation.advance_to(frame / 60.0 - (k + 0.5) * options.step));
    const double ms = processor_time() - start;
    result.mean_ms += ms / kFrames;
    result.worst_ms = std::max(result.worst_ms, ms);
    result.tip.emplace_back(simulation.flesh().x.row(tip));
  }
  return result;
}

Swing swing(const fem::Body& bar, Integrator integrator, int steps_per_frame) {
  Swing best = swing_once(bar, integrator, steps_per_frame);
  for (int run = 1; run < kRuns; ++run) {
    const Swing again = swing_once(bar, integrator, steps_per_frame);
    if (again.mean_ms < best.mean_ms) best = again;
  }
  return best;
}

void print_frames() {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  struct Choice {
    const char* name;
    Integrator integrator;
    int steps;
  };
  const std::vector<Choice> choices{{"backward-euler", Integrator::BackwardEuler, 1},
                                    {"backward-euler", Integrator::BackwardEuler, 2},
                                    {"bdf2", Integrator::Bdf2, 1},
                                    {"bdf2", Integrator::Bdf2, 2},
                                    {"tr-bdf2", Integrator::TrBdf2, 1},
                                    {"tr-bdf2", Integrator::TrBdf2, 2}};
  std::string head = "| `corotational` by | step |", rule = "|---|---|";
  std::vector<std::string> rows;
  for (const Choice& choice : choices)
    rows.push_back(fmt::format("| `{}` | 1/{} s |", choice.name, 60 * choice.steps));
  for (int levels : {2, 3}) {
    const fem::Body bar = tests::swinging_bar(5, 1, levels);
    head += fmt::format(" {} vertices, ms per frame | slowest | tip |", bar.mesh.num_vertices());
    rule += "---|---|---|";
    fmt::print(stderr, "{} vertices: converging in time\n", bar.mesh.num_vertices());
    const Swing exact = swing_once(bar, Integrator::TrBdf2, 8);
    for (std::size_t k = 0; k < choices.size(); ++k) {
      fmt::print(stderr, "{} vertices: {} {}\n", bar.mesh.num_vertices(), choices[k].name, choices[k].steps);
      const Swing s = swing(bar, choices[k].integrator, choices[k].steps);
      rows[k] += fmt::format(" {} | {:.0f} | {:.2g} % |", tests::short_number(s.mean_ms), s.worst_ms,
                             100.0 * tests::rms_distance(s.tip, exact.tip));
    }
  }
  fmt::print("{}\n{}\n", head, rule);
  for (const std::string& row : rows) fmt::print("{}\n", row);
}

/// What takes the steps.
struct Stepper {
  std::string model;
  std::optional<fem::Precision> precision = {};  ///< left out: the model's own.
  Integrator integrator = Integrator::Bdf2;
};

struct Steps {
  double median_ms = 0.0;    ///< of the fastest run.
  std::vector<Points> skin;  ///< after every step.
  Points x;
  fem::SolverCounts counts;
};

/// `count` steps of 1/120 s; the first three, which factor and start, are not timed.
Steps take_steps_once(const fem::Body& body, const fem::Motion& motion, const Stepper& by, int threads,
                      int count) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  fem::SimulationOptions options;
  options.model = by.model;
  options.solver.precision = by.precision;
  options.integrator = by.integrator;
  fem::Simulation simulation(body, motion, 0.0, options);
  Steps result;
  std::vector<double> times;
  for (int step = 0; step < count; ++step) {
    const double start = wall_time();
    demand(simulation.advance_to((step + 0.5) / 120.0));
    if (step >= 3) times.push_back(wall_time() - start);
    result.skin.push_back(simulation.skin_of(simulation.flesh().x));
  }
  std::sort(times.begin(), times.end());
  result.median_ms = times[times.size() / 2];
  result.x = simulation.flesh().x;
  result.counts = simulation.counts();
  return result;
}

Steps take_steps(const fem::Body& body, const fem::Motion& motion, const Stepper& by, int threads,
                 int count) {
  fmt::print(stderr, "{} vertices: {}, {} threads\n", body.mesh.num_vertices(), by.model, threads);
  Steps best = take_steps_once(body, motion, by, threads, count);
  for (int run = 1; run < kRuns; ++run)
    best.median_ms = std::min(best.median_ms, take_steps_once(body, motion, by, threads, count).median_ms);
  return best;
}

/// What a column of the second table says, from the top.
std::vector<std::string> step_column(const fem::Body& body, const fem::Motion& motion, int count) {
  using fem::Precision;
  const auto timed = [&](const Stepper& by, std::string& both) {
    const Steps one = take_steps(body, motion, by, 1, count), two = take_steps(body, motion, by, 2, count);
    if (one.x != two.x) throw std::runtime_error(by.model + ": the bits depend on the number of threads");
    both = tests::short_number(one.median_ms) + " / " + tests::short_number(two.median_ms);
    return one;
  };
  std::string in_double, in_float, in_short, by_bdf2, by_tr_bdf2;
  const Steps exact = timed({"blended", Precision::Double}, in_double),
              in_24 = timed({"blended", Precision::Float}, in_float),
              in_16 = timed({"blended", Precision::Short}, in_short),
              turned = timed({"corotational"}, by_bdf2),
              twice = timed({"corotational", {}, Integrator::TrBdf2}, by_tr_bdf2);
  const auto off = [&](const Steps& rounded) {
    double largest = 0.0;
    for (std::size_t k = 0; k < exact.skin.size(); ++k)
      largest = std::max(largest, (exact.skin[k] - rounded.skin[k]).rowwise().norm().maxCoeff());
    return fmt::format("{:.0e}", largest);
  };
  const auto shares_of = [&](const Steps& dearer) {
    std::string shares;
    for (const Steps* steps : {&exact, &in_24, &in_16})
      shares += (shares.empty() ? "" : " / ") + fmt::format("{:.2f}", steps->median_ms / dearer.median_ms);
    return shares;
  };
  const std::vector<int>& unknowns = exact.counts.unknowns;
  return {fmt::format("{}", exact.counts.regions),
          fmt::format("{}", 3 * std::accumulate(unknowns.begin(), unknowns.end(), 0)),
          fmt::format("{:.1f} million", 1e-6 * static_cast<double>(exact.counts.factor_nonzeros)),
          in_double,
          in_float,
          in_short,
          off(in_24) + " / " + off(in_16),
          by_bdf2,
          shares_of(turned),
          by_tr_bdf2,
          shares_of(twice)};
}

void print_steps(int largest) {
  std::vector<std::vector<std::string>> columns{
      {"regions", "unknowns of all regions", "entries of their factors", "`blended`, double",
       "`blended`, float", "`blended`, short", "float / short from double, of the length", "`corotational`",
       "`blended` over it, double / float / short, 1 thread", "`corotational` by `tr-bdf2`",
       "`blended` by `bdf2` over it, double / float / short, 1 thread"}};
  std::string head = "| ms per step of 1/120 s, 1 / 2 threads |", rule = "|---|";
  const auto add = [&](const char* name, const fem::Body& body, const fem::Motion& motion, int count) {
    if (body.mesh.num_vertices() > largest) return;
    head += fmt::format(" {}, {} vertices |", name, body.mesh.num_vertices());
    rule += "---|";
    columns.push_back(step_column(body, motion, count));
  };
  add("bar", tests::swinging_bar(5, 1, 3), tests::swinging, 24);
  add("bar", tests::swinging_bar(15, 3, 2), tests::swinging, 18);
  fem::BodyOptions options;
  options.damping = {0.1, 3.0};
  add(
      "arm",
      tests::arm_body(tests::make_arm(lattice::CellType::Hexahedron, 0, 14, 6), 60.0 * tests::kDegree,
                      options),
      [](double time) { return tests::arm_pose(tests::swing(time, 60.0)); }, 18);
  add("bar", tests::swinging_bar(45, 9, 1), tests::swinging, 8);
  fmt::print("{}\n{}\n", head, rule);
  for (std::size_t row = 0; row < columns[0].size(); ++row) {
    fmt::print("|");
    for (const auto& column : columns) fmt::print(" {} |", column[row]);
    fmt::print("\n");
  }
}

}  // namespace
}  // namespace sinew

int main(int argc, char** argv) {
  try {
    sinew::print_frames();
    fmt::print("\n");
    sinew::print_steps(argc > 1 ? std::atoi(argv[1]) : 40000);
  } catch (const std::exception& error) {
    fmt::print(stderr, "speed_bench: {}\n", error.what());
    return 1;
  }
  return 0;
}
