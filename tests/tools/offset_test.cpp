// `sinew simulate --offset A`: the rig's own skinning plus A times what tells the flesh from its rest.

#include "assets/rig.h"
#include "skeleton/clip.h"
#include "tests/tools/simulate_run.h"

namespace sinew::tests {
namespace {

assets::FloatPoints frame(const fs::path& folder, int k) {
  return assets::Pc2Reader((folder / "skin.pc2").string()).read(k);
}

double largest(const assets::FloatPoints& difference) {
  return static_cast<double>(difference.rowwise().norm().maxCoeff());
}

// Composed here from two runs: an offset of 1.5 is half as much again as one of 1. Frames are floats of up to
// 1 m: each holds rounding of 6e-8, and the offset scales one of them by 1.5.
TEST_F(Simulate, AddsAShareOfTheFleshToTheRigsOwnSkinning) {
  const std::string flags =
      "--frames 0-6 --fps 10 --cells 60 --preview off --output-space si --guard off --young 3000 ";
  simulate("arm", "plain", flags + "--offset 0");
  simulate("arm", "whole", flags + "--offset 1");
  simulate("arm", "more", flags + "--offset 1.5");
  assets::LoadOptions options;
  options.importer_executable = SINEW_IMPORTER;
  const assets::Rig rig =
      assets::load_rig((fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb").string(), options);
  const skeleton::Clip& clip = rig.clips[static_cast<std::size_t>(assets::choose_clip(rig, ""))];
  double added = 0.0;
  for (int k = 0; k <= 6; ++k) {
    const assets::FloatPoints whole = frame(out("whole"), k), plain = frame(out("plain"), k);
    const assets::FloatPoints expected = plain + 1.5F * (whole - plain);
    EXPECT_LE(largest(frame(out("more"), k) - expected), 1e-6) << "frame " << k;
    added = std::max(added, largest(whole - plain));
    // Where nothing is added, plain skinning to the last bit.
    const auto pose =
        skeleton::pose_from_rest(rig.skeleton, skeleton::sample(rig.skeleton, clip, clip.start + k / 10.0));
    EXPECT_TRUE(plain == assets::to_float(assets::skin(rig, pose))) << "frame " << k;
  }
  EXPECT_GT(added, 5e-4);  // there was something to add
}

// The arm's clip is over by then, and its last pose holds: what the flesh has settled into is the artist's
// own shape, though it sags and bends away from plain skinning by far more.
TEST_F(Simulate, LeavesTheArtistsShapeInAHeldPose) {
  for (const char* model : {"blended", "blended-stiffness", "corotational"}) {
    const std::string flags =
        std::string("--frames 400-404 --cells 60 --preview off --output-space si --guard off --model ") +
        model;
    const nlohmann::json report = simulate("arm", std::string(model) + "0", flags + " --offset 0");
    simulate("arm", std::string(model) + "1", flags + " --offset 1");
    simulate("arm", std::string(model) + "flesh", flags);
    const double height = report["height_m"].get<double>();
    double sag = 0.0;
    for (int k = 0; k <= 4; ++k) {
      const assets::FloatPoints plain = frame(out(std::string(model) + "0"), k);
      EXPECT_LE(largest(frame(out(std::string(model) + "1"), k) - plain), 1e-4 * height)
          << model << ", frame " << k;
      sag = std::max(sag, largest(frame(out(std::string(model) + "flesh"), k) - plain));
    }
    EXPECT_GT(sag, 1e-2 * height) << model;
  }
}

TEST_F(Simulate, SaysHowFarTheFirstFrameIsFromPlainSkinning) {
  const fs::path rig = fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb";
  const std::string start = "simulate " + quoted(rig) + " --frames 0-1 --cells 60 --preview off -o ";
  const Outcome flesh = run(command_line(start + quoted(out("flesh"))));
  ASSERT_EQ(flesh.exit_code, 0) << flesh.text;
  const std::string words = "% of the height from plain skinning, in '";
  EXPECT_NE(flesh.text.find("frame 0: at most "), std::string::npos) << flesh.text;
  EXPECT_NE(flesh.text.find(words), std::string::npos) << flesh.text;
  const Outcome plain = run(command_line(start + quoted(out("plain")) + " --offset 0"));
  EXPECT_NE(plain.text.find("frame 0: at most 0 " + words), std::string::npos) << plain.text;
}

// Several regions need damping that these integrators do not bring: one line, and no folder.
TEST_F(Simulate, RefusesAnIntegratorThatTheModelCannotBear) {
  const fs::path rig = fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb";
  const Outcome outcome = run(command_line("simulate " + quoted(rig) + " -o " + quoted(out("no")) +
                                           " --frames 0-1 --cells 60 --model blended --integrator tr-bdf2"));
  EXPECT_EQ(outcome.exit_code, 2) << outcome.text;
  EXPECT_NE(outcome.text.find("integrator: tr-bdf2 and implicit-midpoint step "
                              "blended flesh of one region"),
            std::string::npos)
      << outcome.text;
  EXPECT_FALSE(fs::exists(out("no")));
}

}  // namespace
}  // namespace sinew::tests
