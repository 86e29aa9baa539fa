// `sinew simulate` on the samples: sound frames, the same bits, one line per failure.

#include <csignal>
#include <cstdlib>
#include <thread>

#include "tests/tools/simulate_run.h"

namespace sinew::tests {
namespace {

TEST_F(Simulate, RunsEverySampleToSoundFrames) {
  for (const char* sample : {"arm", "hopper", "patchwork"}) {
    SCOPED_TRACE(sample);
    const nlohmann::json report = simulate(sample, sample, "--frames 0-12 --cells 300");
    expect_sound(report, out(sample), 13);
    expect_no_spikes(out(sample));
  }
}

TEST_F(Simulate, GivesTheSameBitsForAnyNumberOfThreadsAndUnderACommaLocale) {
  const std::string flags = "--frames 0-8 --cells 300 --cache off";
  simulate("hopper", "one", flags + " --threads 1");
  const std::string one = read(out("one") / "skin.pc2");
  ASSERT_GT(one.size(), 1000u);
  for (const int threads : {2, 4}) {
    const std::string name = std::to_string(threads);
    simulate("hopper", name, flags + " --threads " + name);
    EXPECT_EQ(one, read(out(name) / "skin.pc2")) << threads << " threads";
  }
  simulate("hopper", "comma", flags, std::string("LOCPATH='") + SINEW_LOCALE_DIR + "' LC_ALL=de_DE.UTF-8");
  EXPECT_EQ(one, read(out("comma") / "skin.pc2"));
  EXPECT_EQ(read(out("one") / "lattice.vtu"), read(out("comma") / "lattice.vtu"));
  EXPECT_EQ(read(out("one") / "skin.obj"), read(out("comma") / "skin.obj"));
}

TEST_F(Simulate, DoesNotDependOnTheFrameRateOfItsOutput) {
  simulate("arm", "slow", "--frames 0-5 --fps 15 --cells 200");
  simulate("arm", "fast", "--frames 0-20 --fps 60 --cells 200");
  const assets::Pc2Reader slow((out("slow") / "skin.pc2").string()),
      fast((out("fast") / "skin.pc2").string());
  // 15 and 60 frames per second share every fourth frame, and both fall on steps of 1/120 s.
  for (int k = 0; k <= 5; ++k) {
    EXPECT_EQ((slow.read(k) - fast.read(4 * k)).cwiseAbs().maxCoeff(), 0.0F) << "frame " << k;
  }
}

TEST_F(Simulate, MovesHardlyAtAllWhenItsFactorsAreFloats) {
  const std::string flags = "--frames 0-8 --cells 300 --precision ";
  simulate("hopper", "double", flags + "double");
  simulate("hopper", "float", flags + "float");
  const assets::Pc2Reader one((out("double") / "skin.pc2").string()),
      other((out("float") / "skin.pc2").string());
  float largest = 0.0F;
  for (int k = 0; k <= 8; ++k)
    largest = std::max(largest, (one.read(k) - other.read(k)).rowwise().norm().maxCoeff());
  // A solve is off by about 3e-7 of its answer; 1e-5 of the 1.4 m height leaves room for a second of steps.
  // More than nothing, or the flag does nothing.
  EXPECT_LT(largest, 1.4e-5F);
  EXPECT_GT(largest, 0.0F);
}

TEST_F(Simulate, TakesAStepThatDoesNotDivideTheFrameTime) {
  const nlohmann::json report = simulate("arm", "odd", "--frames 0-6 --fps 24 --step 0.0073 --cells 200");
  expect_sound(report, out("odd"), 7);
}

TEST_F(Simulate, SettlesBeforeTheFirstFrameSoThatNothingPops) {
  const nlohmann::json report = simulate("arm", "settled", "--frames 0-2 --cells 200");
  EXPECT_LT(report["settle"]["speed_left_m_per_s"].get<double>(), 1e-3);
  EXPECT_GE(report["energy_cap"]["steps"].get<int>(), 0);
  EXPECT_GE(report["energy_cap"]["taken_J"].get<double>(), 0.0);
  const assets::Pc2Reader cache((out("settled") / "skin.pc2").string());
  // The arm's clip starts slowly: from frame to frame nothing may move more than a hundredth of its 0.67 m.
  EXPECT_LT((cache.read(1) - cache.read(0)).rowwise().norm().maxCoeff(), 0.0067F);
}

TEST_F(Simulate, KeepsAnotherRunUnlessToldToOverwrite) {
  const std::string flags = "--frames 0-0 --cells 100 --settle 0";
  simulate("arm", "run", flags);
  const std::string before = read(out("run") / "skin.pc2");
  const fs::path rig = fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb";
  const Outcome refused =
      run(command_line("simulate " + quoted(rig) + " -o " + quoted(out("run")) + " " + flags));
  EXPECT_EQ(refused.exit_code, 7) << refused.text;
  EXPECT_NE(refused.text.find("--overwrite"), std::string::npos) << refused.text;
  EXPECT_EQ(before, read(out("run") / "skin.pc2"));
  simulate("arm", "run", flags + " --overwrite");
  EXPECT_EQ(num_entries(), 2);  // and .sinew-cache
}

TEST_F(Simulate, ReadsBackTheLatticeItWroteToTheSameBits) {
  const std::string flags = "--frames 0-4 --cells 200";
  simulate("arm", "built", flags);
  simulate("arm", "read", flags + " --lattice " + quoted(out("built") / "lattice.vtu"));
  EXPECT_EQ(read(out("built") / "skin.pc2"), read(out("read") / "skin.pc2"));
}

TEST_F(Simulate, WritesFramesInTheOrderOfTheUsersMesh) {
  const std::string flags = "--frames 0-2 --cells 200";
  simulate("arm", "plain", flags);
  // The user's mesh: the rest mesh with its vertices backwards.
  const assets::NamedMesh rest = assets::read_surface((out("plain") / "skin.obj").string());
  const Eigen::Index n = rest.points.rows();
  assets::NamedMesh backwards{"mine", rest.points.colwise().reverse(), (n - 1) - rest.triangles.array()};
  std::ofstream(out("mine.obj")) << assets::obj_text({backwards});
  simulate("arm", "mine", flags + " --output-mesh " + quoted(out("mine.obj")));
  const assets::Pc2Reader plain((out("plain") / "skin.pc2").string()),
      mine((out("mine") / "skin.pc2").string());
  for (int k = 0; k < 3; ++k) {
    const assets::FloatPoints expected = plain.read(k).colwise().reverse();
    EXPECT_EQ((mine.read(k) - expected).cwiseAbs().maxCoeff(), 0.0F) << "frame " << k;
  }
}

TEST_F(Simulate, HeavierSofterFleshSagsMore) {
  // Frame 0 is the settled pose: softer flesh hangs farther from plain skinning, here from the stiffer run.
  const auto sag = [&](const std::string& name, const std::string& young) {
    simulate("hopper", name, "--frames 0-0 --cells 300 --young " + young);
    const assets::Pc2Reader cache((out(name) / "skin.pc2").string());
    return cache.read(0);
  };
  const assets::FloatPoints rigid = sag("rigid", "1e9"), firm = sag("firm", "4e4"), soft = sag("soft", "2e4");
  const double firm_sag = (firm - rigid).rowwise().norm().maxCoeff(),
               soft_sag = (soft - rigid).rowwise().norm().maxCoeff();
  // Linear elasticity: half the stiffness, twice the sag; the penalties scale with mu as well. 10 % for what
  // the blending of settled regions leaves.
  EXPECT_NEAR(soft_sag / firm_sag, 2.0, 0.2);
}

TEST_F(Simulate, StopsOnASignalAndLeavesNothing) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const fs::path rig = fs::path(SINEW_SOURCE_DIR) / "assets/samples/hopper.glb";
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      std::freopen("/dev/null", "w", stderr);
      ::execl(SINEW_COMMAND, "sinew", "simulate", rig.c_str(), "-o", out("stopped").c_str(), "--frames",
              "0-2000", nullptr);
      ::_exit(127);
    }
    std::this_thread::sleep_for(std::chrono::seconds(2));  // somewhere between loading and the first frames
    ::kill(child, signal);
    int status = 0;
    ::waitpid(child, &status, 0);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 128 + signal);
    EXPECT_EQ(num_entries(), 0);
  }
}

TEST_F(Simulate, NamesWhatIsWrongInOneLineAndLeavesNothing) {
  const fs::path rig = fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb";
  struct Row {
    std::string arguments;
    int exit_code;
    std::string text;
  };
  const std::vector<Row> rows{
      {quoted(rig) + " --poisson 0.5", 2, "poisson"},
      {quoted(rig) + " --clip nod", 2, "nod"},
      {quoted(rig) + " --dampnig 0.1", 2, "--damping"},
      {quoted(rig) + " --levels 7", 2, "levels"},
      {quoted(rig) + " --cells 100000000", 6, "cells"},
      {quoted(out("absent.glb")), 5, "absent.glb"},
      {quoted(fs::path(SINEW_SOURCE_DIR) / "README.md"), 3, "README.md"},
  };
  for (const Row& row : rows) {
    const Outcome outcome = run(command_line("simulate " + row.arguments + " -o " + quoted(out("none"))));
    EXPECT_EQ(outcome.exit_code, row.exit_code) << row.arguments << "\n" << outcome.text;
    EXPECT_NE(outcome.text.find(row.text), std::string::npos) << row.arguments << "\n" << outcome.text;
    EXPECT_EQ(std::count(outcome.text.begin(), outcome.text.end(), '\n'), 1) << outcome.text;
    EXPECT_EQ(num_entries(), 0) << row.arguments;
  }
}

}  // namespace
}  // namespace sinew::tests
