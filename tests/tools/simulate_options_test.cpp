#include "tools/commands/simulate_options.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "fem/models/model.h"
#include "tools/scene/scene_fields.h"

namespace sinew::tools {
namespace {

/// The names that a message lists; the registry grows.
std::string model_list() {
  std::string list;
  for (const fem::ModelInfo& model : fem::models()) list.append(list.empty() ? "" : ", ").append(model.name);
  return list;
}

Scene parse(std::vector<std::string> arguments) {
  CLI::App app;
  SimulateOptions options;
  options.add_to(app);
  std::reverse(arguments.begin(), arguments.end());  // as the parser wants a vector
  app.parse(arguments);
  return options.scene();
}

std::string refusal(const std::vector<std::string>& arguments) {
  try {
    parse(arguments);
  } catch (const assets::ConfigError& e) {
    return e.what();
  }
  return "accepted";
}

TEST(SimulateOptions, GiveTheDefaultsForARigAndAnOutput) {
  Scene expected;
  expected.rig = "hero.glb";
  expected.output = "out";
  EXPECT_EQ(parse({"hero.glb", "-o", "out"}), expected);
}

TEST(SimulateOptions, HaveAFlagForEveryKey) {
  CLI::App app;
  SimulateOptions options;
  options.add_to(app);
  for (const SceneField& field : scene_fields()) {
    if (field.key == "rig") continue;  // the positional argument
    EXPECT_NE(app.get_option_no_throw(flag_name(field)), nullptr) << field.key;
  }
}

TEST(SimulateOptions, SetWhatTheFlagsSay) {
  const Scene scene = parse({"hero.glb",
                             "-o",
                             "out",
                             "--clip",
                             "walk",
                             "--lattice",
                             "a.vtu",
                             "--cells",
                             "500",
                             "--levels",
                             "0",
                             "--young",
                             "2e4",
                             "--poisson",
                             "-.3",
                             "--density",
                             "900",
                             "--damping",
                             "0",
                             "--damping-frequency",
                             "2.5",
                             "--height",
                             "1.75",
                             "--output-space",
                             "si",
                             "--gravity",
                             "-1,-9.81, +2",
                             "--step",
                             "1/240",
                             "--fps",
                             "24000/1001",
                             "--integrator",
                             "backward-euler",
                             "--model",
                             "skin",
                             "--precision",
                             "float",
                             "--frames",
                             "0-47",
                             "--settle",
                             "0.5",
                             "--offset",
                             "0.25",
                             "--threads",
                             "3",
                             "--output-mesh",
                             "a.obj",
                             "--overwrite",
                             "--strict",
                             "--json"});
  EXPECT_EQ(scene.clip, "walk");
  EXPECT_EQ(scene.lattice, "a.vtu");
  EXPECT_EQ(scene.cells, 500);
  EXPECT_EQ(scene.levels, 0);
  EXPECT_EQ(scene.young, 20000.0);
  EXPECT_EQ(scene.poisson, -0.3);
  EXPECT_EQ(scene.density, 900.0);
  EXPECT_EQ(scene.damping, 0.0);
  EXPECT_EQ(scene.damping_frequency, 2.5);
  EXPECT_EQ(scene.height, 1.75);
  EXPECT_EQ(scene.output_space, OutputSpace::Si);
  EXPECT_EQ(scene.gravity, Eigen::Vector3d(-1.0, -9.81, 2.0));
  EXPECT_EQ(scene.step, 1.0 / 240.0);
  EXPECT_EQ(scene.fps, 24000.0 / 1001.0);
  EXPECT_EQ(scene.integrator, Integrator::BackwardEuler);
  EXPECT_EQ(scene.model, "skin");
  EXPECT_EQ(scene.precision, Precision::Float);
  EXPECT_EQ(scene.frames, (FrameRange{0, 47}));
  EXPECT_EQ(scene.settle, 0.5);
  EXPECT_EQ(scene.offset, 0.25);
  EXPECT_EQ(scene.threads, 3);
  EXPECT_EQ(scene.output_mesh, "a.obj");
  EXPECT_TRUE(scene.overwrite);
  EXPECT_TRUE(scene.strict);
  EXPECT_TRUE(scene.json);
}

TEST(SimulateOptions, WinOverTheSceneFile) {
  const auto directory = std::filesystem::path(SINEW_BINARY_DIR) / "simulate_options_test";
  std::filesystem::create_directories(directory);
  const std::string file = directory / "scene.TOML";  // the extension decides, in any case
  std::ofstream(file) << "rig = \"hero.glb\"\noutput = \"out\"\nyoung = 1e4\ncells = 300\n";
  const Scene scene = parse({"--cells", "400", file});
  EXPECT_EQ(scene.rig, directory / "hero.glb");
  EXPECT_EQ(scene.output, directory / "out");
  EXPECT_EQ(scene.young, 1e4);
  EXPECT_EQ(scene.cells, 400);
}

TEST(SimulateOptions, RefuseWithFlagValueRangeAndHint) {
  struct Case {
    const char* flag;
    const char* value;
    std::string message;
  };
  const Case cases[] = {
      {"--poisson", "0.5", "--poisson: got 0.5, expected -1 < nu < 0.5; hint: 0.49"},
      {"--poisson", "nan", "--poisson: got nan, expected -1 < nu < 0.5; hint: 0.49"},
      {"--poisson", "0,3", "--poisson: got '0,3', expected a number, -1 < nu < 0.5; hint: 0.49"},
      {"--poisson", "", "--poisson: got '', expected a number, -1 < nu < 0.5; hint: 0.49"},
      {"--young", "-5",
       "--young: got -5, expected 0.001 <= E <= 1e+12 Pa; hint: leave it out for the automatic "
       "value"},
      {"--young", "10kPa",
       "--young: got '10kPa', expected a number, 0.001 <= E <= 1e+12 Pa; hint: leave it out for the "
       "automatic "
       "value"},
      {"--young", "1e999",
       "--young: got '1e999', expected a number, 0.001 <= E <= 1e+12 Pa; hint: leave it out for the "
       "automatic "
       "value"},
      {"--density", "0", "--density: got 0, expected 1 <= rho <= 100000 kg/m^3; hint: 1000"},
      {"--damping", "-0.1", "--damping: got -0.1, expected 0 <= zeta <= 10; hint: 0.1"},
      {"--damping-frequency", "0", "--damping-frequency: got 0, expected 0.01 <= f <= 1000 Hz; hint: 3"},
      {"--height", "0", "--height: got 0, expected 0.001 <= height <= 10000 m; hint: 1.8"},
      {"--step", "0", "--step: got 0, expected 1e-06 <= h <= 0.1 s; hint: 1/120"},
      {"--step", "0x1p-7", "--step: got '0x1p-7', expected a number, 1e-06 <= h <= 0.1 s; hint: 1/120"},
      {"--fps", "1e9", "--fps: got 1000000000, expected 0.1 <= fps <= 10000 1/s; hint: 30"},
      {"--settle", "-1", "--settle: got -1, expected 0 <= settle <= 3600 s; hint: 5"},
      {"--gravity", "0,-9.81", "--gravity: got '0,-9.81', expected three numbers x,y,z; hint: 0,-9.81,0"},
      {"--gravity", "0,-9.81,0,0",
       "--gravity: got '0,-9.81,0,0', expected three numbers x,y,z; hint: 0,-9.81,0"},
      {"--gravity", "0,1e9,0",
       "--gravity: got 1000000000, expected -10000 <= each component <= 10000 m/s^2; hint: 0,-9.81,0"},
      {"--levels", "1.5", "--levels: got '1.5', expected a whole number, 0 <= levels <= 3; hint: 1"},
      {"--cells", "19", "--cells: got 19, expected 20 <= cells <= 1000000; hint: 1000"},
      {"--threads", "10000", "--threads: got 10000, expected 0 <= threads <= 1024; hint: 0"},
      {"--frames", "7-3", "--frames: got 7-3, expected A-B with 0 <= A <= B <= 10000000; hint: 0-47"},
      {"--frames", "-3-7", "--frames: got -3-7, expected A-B with 0 <= A <= B <= 10000000; hint: 0-47"},
      {"--offset", "-1", "--offset: got -1, expected 0 <= offset <= 10; hint: 1"},
      {"--integrator", "bfd2",
       "--integrator: got 'bfd2', expected bdf2, backward-euler, tr-bdf2 or implicit-midpoint; hint: bdf2"},
      {"--model", "skni", "--model: got 'skni', expected one of " + model_list() + "; hint: skin"},
      {"--output-space", "metres", "--output-space: got 'metres', expected file or si; hint: file"},
  };
  for (const auto& [flag, value, message] : cases) {
    EXPECT_EQ(refusal({"hero.glb", "-o", "out", flag, value}), message) << flag << " " << value;
  }
}

TEST(SimulateOptions, RefuseAnIntegratorThatAModelHasNoUseFor) {
  EXPECT_EQ(
      refusal({"hero.glb", "-o", "out", "--model", "skin", "--integrator", "tr-bdf2"}),
      "integrator: got tr-bdf2, expected nothing as the model skin stands where the pose puts it; hint: "
      "leave it out");
  EXPECT_EQ(refusal({"hero.glb", "-o", "out", "--model", "springs", "--integrator", "tr-bdf2"}), "accepted");
}

TEST(SimulateOptions, DemandARigAndAnOutputForARunOnly) {
  EXPECT_EQ(refusal({"-o", "out"}),
            "the rig is missing, expected sinew simulate (SCENE.toml | RIG) -o OUT; hint: try "
            "assets/samples/hopper.glb");
  EXPECT_EQ(refusal({"hero.glb"}), "--output: missing, expected a directory for the results; hint: -o out");
  EXPECT_EQ(refusal({"--print-scene"}), "accepted");
}

}  // namespace
}  // namespace sinew::tools
