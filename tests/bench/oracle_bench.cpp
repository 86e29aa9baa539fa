// How far every rung of the ladder is from the rung above it and from neo-Hookean flesh, on the samples and
// the same lattice: the arm held bent by 60 and 120 degrees and twisted by 90, and the hop of the hopper.
// Prints a table of tests/measured/accuracy.md. Usage: oracle_bench [cells of the arm [frames of the hop]].

#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

#include <fmt/format.h>

#include "tests/fem/arm.h"
#include "tests/tools/oracle.h"

namespace sinew {
namespace {

using tests::Frames;

/// A box of flesh round two bones, five times as long as thick on each side of its elbow: 1 m long.
Frames held_box(const std::string& rung, double degrees) {
  static const tests::Arm arm = tests::make_arm();
  const fem::Body body = tests::arm_body(arm, degrees * tests::kDegree);
  fem::EquilibriumOptions options;
  options.model = rung;
  options.gravity.setZero();
  options.steps = 6;
  const fem::Equilibrium rest = fem::find_equilibrium(
      body, [&](double factor) { return tests::arm_pose(factor * degrees * tests::kDegree); }, options);
  if (!rest.report.ok()) return {};
  return {body.skin.weights * rest.x};
}

std::string distance(const Frames& a, const Frames& b, double length) {
  return a.empty() || b.empty() ? "none" : fmt::format("{:.2f}", tests::rms_percent(a, b, length));
}

template <class Run>
void print_rows(const std::string& what, double height, const Run& run) {
  std::map<std::string, Frames> results;
  for (const fem::ModelInfo& model : fem::models())
    results[std::string(model.name)] = run(std::string(model.name));
  std::string below = fmt::format("| {}, from `neo-hookean` |", what),
              above = "| the same, from the rung above |";
  for (std::size_t k = 0; k + 1 < fem::models().size(); ++k) {
    const Frames& result = results[std::string(fem::models()[k].name)];
    below += " " + distance(result, results["neo-hookean"], height) + " |";
    above += " " + distance(result, results[std::string(fem::models()[k + 1].name)], height) + " |";
  }
  fmt::print("{}\n{}\n", below, above);
  std::fflush(stdout);
}

void print_table(int cells, int frames) {
  fmt::print("| rms, % of the height |");
  for (std::size_t k = 0; k + 1 < fem::models().size(); ++k) fmt::print(" `{}` |", fem::models()[k].name);
  fmt::print("\n|---|---|---|---|---|---|---|\n");
  for (const double degrees : {60.0, 120.0})
    print_rows(fmt::format("elbow of a box at {:g} degrees", degrees), 1.0,
               [&](const std::string& rung) { return held_box(rung, degrees); });
  const tests::OracleSample bend(tests::sample_scene("arm", "elbow", cells)),
      twist(tests::sample_scene("arm", "twist", cells));
  const double height = bend.character.rig.height;
  for (const double degrees : {60.0, 120.0})
    print_rows(fmt::format("elbow at {:g} degrees", degrees), height,
               [&](const std::string& rung) { return tests::held(bend, rung, degrees); });
  print_rows("forearm twisted by 90 degrees", height,
             [&](const std::string& rung) { return tests::held(twist, rung, 90.0); });
  const tests::OracleSample hop(tests::sample_scene("hopper", "", 200));
  print_rows(fmt::format("hop, {} frames", frames), hop.character.rig.height,
             [&](const std::string& rung) { return tests::moving(hop, rung, frames); });
}

}  // namespace
}  // namespace sinew

int main(int argc, char** argv) {
  sinew::print_table(argc > 1 ? std::atoi(argv[1]) : 200, argc > 2 ? std::atoi(argv[2]) : 24);
}
