// The reference problems as scenes of tests/scenes, against answers of other codes.

#include <cmath>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "tests/tools/simulate_run.h"

namespace sinew::tools {
namespace {

std::vector<std::vector<double>> reference_table(const std::string& name) {
  std::ifstream stream(std::string(SINEW_SHARED_DIR) + "/reference/" + name);
  EXPECT_TRUE(stream.good()) << name;
  std::vector<std::vector<double>> rows;
  std::string line;
  std::getline(stream, line);
  while (std::getline(stream, line)) {
    std::stringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(std::stod(cell));
  }
  return rows;
}

class ReferenceScenes : public tests::Simulate {
 protected:
  /// Displacement of the skin vertex at `rest` in every frame of a scene of tests/scenes.
  std::vector<Eigen::Vector3f> path_of(const std::string& scene, const Eigen::RowVector3f& rest,
                                       const std::string& flags = {}) const {
    const std::string file = std::string(SINEW_SOURCE_DIR) + "/tests/scenes/" + scene + ".toml";
    const tests::Outcome run = tests::run(tests::command_line("simulate " + tests::quoted(file) + " -o " +
                                                              tests::quoted(out(scene)) + " " + flags));
    EXPECT_EQ(run.exit_code, 0) << run.text;
    std::vector<Eigen::Vector3f> path;
    if (run.exit_code != 0) return path;
    const assets::Pc2Reader cache((out(scene) / "skin.pc2").string());
    const lattice::Points points = assets::read_surface((out(scene) / "skin.obj").string()).points;
    Eigen::Index vertex = 0;
    EXPECT_LT((points.rowwise() - rest.cast<double>()).rowwise().norm().minCoeff(&vertex), 1e-6);
    for (int k = 0; k < cache.num_samples(); ++k) path.emplace_back(cache.read(k).row(vertex) - rest);
    return path;
  }
};

/// rms of the difference over the largest deflection, in per cent.
double transient_error(const std::vector<Eigen::Vector3f>& path, double fps, std::size_t column) {
  const auto table = reference_table("linear_transient_tip.csv");
  double squares = 0.0, largest = 0.0;
  std::size_t count = 0;
  for (const auto& row : table) {
    const double frame = row[0] * fps;
    largest = std::max(largest, std::abs(row[column]));
    if (std::abs(frame - std::round(frame)) > 1e-9 || std::lround(frame) >= static_cast<long>(path.size()))
      continue;
    squares += std::pow(
        static_cast<double>(path[static_cast<std::size_t>(std::lround(frame))].z()) - row[column], 2);
    ++count;
  }
  EXPECT_GT(count, 100u);
  return 100.0 * std::sqrt(squares / static_cast<double>(count)) / largest;
}

// Measured 0.68 % without damping and 0.59 % with it, on 20 x 4 x 4 active cells.
TEST_F(ReferenceScenes, TheReleasedBarFollowsTheModalSolutionWithinOnePerCentOfItsAmplitude) {
  const Eigen::RowVector3f tip(1.0F, 0.0F, 0.0F);
  EXPECT_LT(transient_error(path_of("bar_release", tip), 100.0, 1), 1.0);
  EXPECT_LT(transient_error(path_of("bar_release_damped", tip), 100.0, 2), 1.0);
}

}  // namespace
}  // namespace sinew::tools
