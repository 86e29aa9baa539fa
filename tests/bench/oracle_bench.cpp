// How far every rung of the ladder is from the rung above it and from neo-Hookean flesh, on the samples and
// the same lattice: the arm held bent by 60 and 120 degrees and twisted by 90, and the hop of the hopper.
// Prints the table that the README shows. Usage: oracle_bench [cells of the arm [frames of the hop]].

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "fem/equilibrium.h"
#include "tools/character.h"

namespace sinew {
namespace {

using lattice::Points;

/// Skins of one run, one per frame; empty where there is no answer.
using Frames = std::vector<Points>;

struct Sample {
  tools::Character character;
  fem::Body body;

  explicit Sample(const tools::Scene& scene)
      : character(tools::make_character(scene, [](const std::string&) {})),
        body(tools::make_body(character)) {}
};

tools::Scene scene_of(const char* sample, const char* clip, int cells) {
  tools::Scene scene;
  scene.rig = std::string(SINEW_SOURCE_DIR "/assets/samples/") + sample + ".glb";
  scene.clip = clip;
  scene.cells = cells;
  scene.cache = tools::Switch::Off;
  return scene;
}

/// Largest turn of a joint against its parent at a time [degrees].
double turn_at(const tools::Character& c, double time) {
  const auto pose = c.pose(time);
  double largest = 0.0;
  for (int j = 0; j < c.rig.skeleton.num_joints(); ++j) {
    const int parent = c.rig.skeleton.joint(j).parent;
    if (parent < 0) continue;
    const Eigen::Matrix3d turn = pose[static_cast<std::size_t>(parent)].linear().transpose() *
                                 pose[static_cast<std::size_t>(j)].linear();
    largest = std::max(largest, Eigen::AngleAxisd(turn).angle() * 180.0 / M_PI);
  }
  return largest;
}

/// The time of a clip that only turns further at which it has turned so far.
double time_of(const tools::Character& c, double degrees) {
  double low = c.the_clip().start, high = c.the_clip().start + 1.0;
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (turn_at(c, middle) < degrees ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// At rest in the pose, without gravity.
Frames held(const Sample& sample, const std::string& rung, double degrees) {
  fem::EquilibriumOptions options;
  options.model = rung;
  options.gravity.setZero();
  options.steps = 6;
  const fem::Equilibrium rest = fem::find_equilibrium(
      sample.body,
      [&](double factor) {
        return sample.character.pose(time_of(sample.character, std::max(1e-3, factor * degrees)));
      },
      options);
  if (!rest.report.ok()) return {};
  return {sample.body.skin.weights * rest.x};
}

Frames moving(const Sample& sample, const std::string& rung, int frames) {
  fem::SimulationOptions options = tools::simulation_options(tools::Scene{});
  options.model = rung;
  const double start = sample.character.the_clip().start;
  fem::Simulation simulation(
      sample.body, [&](double time) { return sample.character.pose(time); }, start, options);
  if (simulation.settle().status != fem::SimulationStatus::Ok) return {};
  Frames result;
  for (int k = 0; k < frames; ++k) {
    const double time = start + k / 30.0;
    if (simulation.advance_to(time).status != fem::SimulationStatus::Ok) return {};
    result.push_back(simulation.skin_of(simulation.positions_at(time)));
  }
  return result;
}

/// rms over all skin vertices and frames in % of the height.
std::string distance(const Frames& a, const Frames& b, double height) {
  if (a.empty() || b.empty()) return "no rest";
  double sum = 0.0;
  Eigen::Index count = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    sum += (a[k] - b[k]).squaredNorm();
    count += a[k].rows();
  }
  return fmt::format("{:.2f}", 100.0 * std::sqrt(sum / static_cast<double>(count)) / height);
}

template <class Run>
void print_rows(const std::string& what, double height, const Run& run) {
  std::map<std::string, Frames> results;
  for (const fem::ModelInfo& model : fem::models())
    results[std::string(model.name)] = run(std::string(model.name));
  std::string below = fmt::format("| {}, from `neo-hookean` |", what), above = "| from the rung above |";
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
  const Sample bend(scene_of("arm", "elbow", cells)), twist(scene_of("arm", "twist", cells));
  const double height = bend.character.rig.height;
  print_rows("elbow held at 60 degrees", height, [&](const std::string& r) { return held(bend, r, 60.0); });
  print_rows("elbow held at 120 degrees", height, [&](const std::string& r) { return held(bend, r, 120.0); });
  print_rows("forearm held twisted by 90 degrees", height,
             [&](const std::string& r) { return held(twist, r, 90.0); });
  const Sample hop(scene_of("hopper", "", 200));
  print_rows(fmt::format("hop, {} frames", frames), hop.character.rig.height,
             [&](const std::string& r) { return moving(hop, r, frames); });
}

}  // namespace
}  // namespace sinew

int main(int argc, char** argv) {
  sinew::print_table(argc > 1 ? std::atoi(argv[1]) : 300, argc > 2 ? std::atoi(argv[2]) : 45);
}
