#pragma once

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "fem/models/model.h"
#include "fem/simulation.h"
#include "tests/fem/arm.h"
#include "tests/fem/bar.h"

/// Settings far from ordinary, on every rung that moves. Whatever they are, a run ends well or with a failure
/// that has a name, and no number that it gives is infinite or none. Every row writes what became of it to
/// extremes/<row>.md in the build folder.
namespace sinew::tests {

/// True in the program that runs at night: as long and as many runs as are wanted, not as fit.
#ifdef SINEW_NIGHTLY
inline constexpr bool kNightly = true;
#else
inline constexpr bool kNightly = false;
#endif

inline std::vector<std::string> dynamic_rungs() {
  std::vector<std::string> names;
  for (const fem::ModelInfo& model : fem::models()) {
    if (model.dynamic) names.emplace_back(model.name);
  }
  return names;
}

/// The finite-element rungs: at small strain all of them are the same linear body.
inline std::vector<std::string> element_rungs() {
  std::vector<std::string> names = dynamic_rungs();
  std::erase(names, "springs");
  return names;
}

/// What became of one run.
struct Extreme {
  bool ok = false;       ///< it ran to its end.
  std::string failure;   ///< else its name.
  lattice::Points x, v;  ///< at the end, or the last good ones.
  double energy = 0.0;   ///< at the end: kinetic, elastic and potential [J].
  double most = 0.0;     ///< largest energy of all steps [J].
  double late = 0.0;     ///< largest kinetic energy in the last quarter of the steps [J].
  double early = 0.0;    ///< and in the first quarter [J].
  double seconds = 0.0;  ///< processor time.
};

/// Runs `steps` steps and asks at each of them what holds for every run.
inline Extreme run_extreme(fem::Simulation& simulation, double step, int steps) {
  Extreme result;
  const std::clock_t start = std::clock();
  for (int k = 1; k <= steps; ++k) {
    const fem::SimulationReport report =
        simulation.advance_to(simulation.state().time + 0.5 * step);  // one step; halves are no matter
    result.x = simulation.state().x;
    result.v = simulation.state().v;
    if (report.status != fem::SimulationStatus::Ok) {
      result.failure = report.message.empty() ? "(no name)" : report.message;
      EXPECT_FALSE(report.message.empty());
      break;
    }
    if (!result.x.allFinite() || !result.v.allFinite()) {
      ADD_FAILURE() << "a number that is none, and no failure, in step " << k;
      return result;
    }
    const fem::Measures m = simulation.measures_at(simulation.state().time);
    const double extent = 1.0 + result.x.rowwise().norm().maxCoeff();
    EXPECT_LE(m.bone_residual, 1e-9 * extent) << "step " << k;
    result.energy = m.kinetic + m.elastic + m.potential;
    result.most = std::max(result.most, result.energy);
    if (4 * k <= steps) result.early = std::max(result.early, m.kinetic);
    if (4 * k > 3 * steps) result.late = std::max(result.late, m.kinetic);
  }
  result.ok = result.failure.empty();
  result.seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  return result;
}

inline std::vector<Eigen::Affine3d> still_base(double) { return {Eigen::Affine3d::Identity()}; }

/// A short bar, 4 x 2 x 2 leaf cells, clamped at x = 0.
inline fem::Body short_bar(const fem::Material& material, const fem::Damping& damping, double size = 1.0) {
  BarOptions options;
  options.box.min = Eigen::Vector3d(0.0, -0.2, -0.2) * size;
  options.box.max = Eigen::Vector3d(1.0, 0.2, 0.2) * size;
  options.box.blocks = {2, 1, 1};
  options.material = material;
  options.damping = damping;
  return bar_body(options);
}

inline fem::SimulationOptions extreme_options(const std::string& model, double step,
                                              const Eigen::Vector3d& gravity,
                                              fem::Integrator integrator = fem::Integrator::Bdf2) {
  fem::SimulationOptions options;
  options.model = model;
  options.step = step;
  options.gravity = gravity;
  options.integrator = integrator;
  return options;
}

/// A small arm: two bones of two cells each.
inline Arm small_arm() { return make_arm(lattice::CellType::Hexahedron, 0, 2); }

inline fem::Body small_arm_body(const Arm& arm, double largest_bend) {
  fem::BodyOptions options;
  options.levels = 0;
  return arm_body(arm, largest_bend, options);
}

/// The rows of one test as a table in the build folder.
class ExtremesTable {
 public:
  explicit ExtremesTable(const std::string& row) : row_(row) {}
  ~ExtremesTable() {
    const std::filesystem::path folder = std::filesystem::path(SINEW_BINARY_DIR) / "extremes";
    std::filesystem::create_directories(folder);
    std::ofstream file(folder / (row_ + ".md"));
    file << "| row | setting | rung | outcome | s |\n|---|---|---|---|---|\n" << lines_;
  }
  void add(const std::string& setting, const std::string& rung, const Extreme& run) {
    lines_ += fmt::format("| {} | {} | {} | {} | {:.2g} |\n", row_, setting, rung,
                          run.ok ? "passed" : run.failure, run.seconds);
  }

 private:
  std::string row_, lines_;
};

/// Largest distance of two placements over `size`.
inline double distance(const lattice::Points& a, const lattice::Points& b, double size = 1.0) {
  return (a - b).rowwise().norm().maxCoeff() / size;
}

}  // namespace sinew::tests
