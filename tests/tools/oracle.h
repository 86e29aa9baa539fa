#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "fem/time/equilibrium.h"
#include "tools/session/character.h"
#include "tools/session/run_settings.h"

/// The skin of bundled samples on any rung of the ladder, held in a pose or moving.
namespace sinew::tests {

/// Skins of one run, one per frame; empty where there is no answer.
using Frames = std::vector<lattice::Points>;

struct OracleSample {
  tools::Character character;
  fem::Body body;

  explicit OracleSample(const tools::Scene& scene)
      : character(tools::make_character(scene, {})), body(tools::make_body(character)) {}
};

inline tools::Scene sample_scene(const char* sample, const char* clip, int cells) {
  tools::Scene scene;
  scene.rig = std::string(SINEW_SOURCE_DIR "/assets/samples/") + sample + ".glb";
  scene.clip = clip;
  scene.cells = cells;
  scene.cache = tools::Switch::Off;
  return scene;
}

/// Largest turn of a joint against its parent at a time [degrees].
inline double largest_turn(const tools::Character& c, double time) {
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
inline double time_of(const tools::Character& c, double degrees) {
  double low = c.the_clip().start, high = c.the_clip().start + 1.0;
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (largest_turn(c, middle) < degrees ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// At rest in the pose, without gravity.
inline Frames held(const OracleSample& sample, const std::string& rung, double degrees) {
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

inline Frames moving(const OracleSample& sample, const std::string& rung, int frames) {
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

/// rms over all skin vertices and frames in % of a length [m].
inline double rms_percent(const Frames& a, const Frames& b, double length) {
  double sum = 0.0;
  Eigen::Index count = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    sum += (a[k] - b[k]).squaredNorm();
    count += a[k].rows();
  }
  return 100.0 * std::sqrt(sum / static_cast<double>(count)) / length;
}

}  // namespace sinew::tests
