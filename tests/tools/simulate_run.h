#pragma once

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <unistd.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "assets/obj.h"
#include "assets/pc2.h"
#include "tests/tools/run_command.h"

/// `sinew simulate` run as a user runs it, and what holds for every run.
namespace sinew::tests {

namespace fs = std::filesystem;

/// With what it says on stderr.
inline Outcome run(const std::string& line) { return run_line(line + " 2>&1"); }

inline std::string quoted(const fs::path& path) {
  std::string text = "'";
  text += path.string();
  return text += "'";
}

inline std::string command_line(const std::string& arguments, const std::string& environment = {}) {
  return environment + " " + quoted(SINEW_COMMAND) + " " + arguments;
}

inline std::string read(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

/// A folder of its own for every test, gone afterwards.
class Simulate : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(SINEW_BINARY_DIR) / "simulate_test" /
              (std::string(info->name()) + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path out(const std::string& name) const { return folder_ / name; }
  /// A run of a sample on a small lattice; must succeed.
  nlohmann::json simulate(const std::string& sample, const std::string& name, const std::string& flags,
                          const std::string& environment = {}) const {
    const fs::path rig = fs::path(SINEW_SOURCE_DIR) / "assets/samples" / (sample + ".glb");
    const Outcome outcome =
        run(command_line("simulate " + quoted(rig) + " -o " + quoted(out(name)) + " " + flags, environment));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
    return nlohmann::json::parse(read(out(name) / "report.json"), nullptr, false);
  }
  int num_entries() const {
    return static_cast<int>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  fs::path folder_;
};

inline void expect_sound(const nlohmann::json& report, const fs::path& out, int frames) {
  ASSERT_TRUE(report.is_object());
  EXPECT_EQ(report["frames"].size(), static_cast<std::size_t>(frames));
  // Bone vertices are set, not solved for: only the rounding of one interpolation is left.
  EXPECT_LT(report["worst"]["bone_residual_m"].get<double>(), 1e-12 * report["height_m"].get<double>());
  const assets::Pc2Reader cache((out / "skin.pc2").string());
  EXPECT_EQ(cache.num_samples(), frames);
  const assets::NamedMesh rest = assets::read_surface((out / "skin.obj").string());
  EXPECT_EQ(cache.num_points(), rest.points.rows());
  for (const char* name : {"skin.json", "lattice.vtu", "preview.png"})
    EXPECT_GT(fs::file_size(out / name), 100u) << name;
  const nlohmann::json sidecar = nlohmann::json::parse(read(out / "skin.json"), nullptr, false);
  EXPECT_TRUE(sidecar.is_object());
}

/// Flesh stays near plain skinning: its distance from the posed bones' own height. A spike or a collapse of
/// the size of the character would show.
inline void expect_no_spikes(const fs::path& out) {
  const assets::Pc2Reader cache((out / "skin.pc2").string());
  const assets::FloatPoints first = cache.read(0);
  const float size = (first.colwise().maxCoeff() - first.colwise().minCoeff()).norm();
  for (int k = 0; k < cache.num_samples(); ++k) {
    const assets::FloatPoints p = cache.read(k);
    ASSERT_TRUE(p.allFinite());
    const float now = (p.colwise().maxCoeff() - p.colwise().minCoeff()).norm();
    // A character bends, crouches and reaches, but neither doubles nor halves the diagonal of its box.
    EXPECT_GT(now, 0.5F * size) << "frame " << k;
    EXPECT_LT(now, 2.0F * size) << "frame " << k;
  }
}

}  // namespace sinew::tests
