// `sinew simulate` with no option but the output on every animated, skinned file of the public folder.

#include <cctype>

#include "tests/tools/simulate_run.h"

namespace sinew::tests {
namespace {

/// Every animated, skinned file of the public folder.
class SimulatePublic : public Simulate, public ::testing::WithParamInterface<const char*> {
 protected:
  void SetUp() override {
    folder_ = fs::path(SINEW_BINARY_DIR) / "simulate_test" / fs::path(GetParam()).filename();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
};

TEST_P(SimulatePublic, RunsWithoutAnyOption) {
  const fs::path rig = fs::path(SINEW_SHARED_DIR) / "data/public" / GetParam();
  ASSERT_TRUE(fs::exists(rig)) << rig << " is missing";
  const Outcome outcome =
      run(command_line("simulate " + quoted(rig) + " -o " + quoted(out("run")) + " --frames 0-15"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  const nlohmann::json report = nlohmann::json::parse(read(out("run") / "report.json"), nullptr, false);
  expect_sound(report, out("run"), 16);
  expect_no_spikes(out("run"));
  // Folds strain by up to 3, cells between joints that a clip scales by up to 17 (the lumberjack), and by
  // 2476 if shapes that are inside out counted.
  EXPECT_LE(report["worst"]["largest_strain"].get<double>(), 25.0);
}

INSTANTIATE_TEST_SUITE_P(
    Shared, SimulatePublic,
    ::testing::Values("characters/CesiumMan.dae", "characters/CesiumMan.glb", "characters/RiggedSimple.dae",
                      "characters/RiggedSimple.gltf", "characters/kaykit_Knight.glb",
                      "characters/maya_kenney_character_7700_binary.fbx",
                      "characters/maya_slime_7500_binary.fbx", "characters/quaternius_Male_Casual.fbx",
                      "characters/quaternius_Zombie.fbx", "quadrupeds/Fox.glb",
                      "quadrupeds/quaternius_Dog.fbx", "quadrupeds/quaternius_Horse.fbx",
                      "quadrupeds/quaternius_Wolf.glb", "creatures/daz_lumberjack_geometry.glb"),
    [](const auto& rig) {
      std::string name = fs::path(rig.param).filename().string();
      for (char& c : name) c = std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
      return name;
    });

}  // namespace
}  // namespace sinew::tests
