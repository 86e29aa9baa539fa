// `sinew simulate --offset A`: the rig's own skinning plus A times what the flesh adds to the bottom rung.

#include "assets/rig.h"
#include "skeleton/clip.h"
#include "tests/tools/simulate_run.h"

namespace sinew::tests {
namespace {

assets::FloatPoints frame(const fs::path& folder, int k) {
  return assets::Pc2Reader((folder / "skin.pc2").string()).read(k);
}

// Composed here from three runs. Frames are floats of up to 1 m: each holds rounding of 6e-8, four are
// summed, the offset scales two of them by 1.5.
TEST_F(Simulate, AddsAShareOfTheFleshToTheRigsOwnSkinning) {
  const std::string flags = "--frames 0-6 --fps 10 --cells 60 --preview off --output-space si --guard off ";
  simulate("arm", "flesh", flags);
  simulate("arm", "bottom", flags + "--model skin");
  simulate("arm", "plain", flags + "--offset 0");
  simulate("arm", "more", flags + "--offset 1.5");
  assets::LoadOptions options;
  options.importer_executable = SINEW_IMPORTER;
  const assets::Rig rig =
      assets::load_rig((fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb").string(), options);
  const skeleton::Clip& clip = rig.clips[static_cast<std::size_t>(assets::choose_clip(rig, ""))];
  float added = 0.0F;
  for (int k = 0; k <= 6; ++k) {
    const assets::FloatPoints flesh = frame(out("flesh"), k), bottom = frame(out("bottom"), k),
                              plain = frame(out("plain"), k);
    const assets::FloatPoints expected = plain + 1.5F * (flesh - bottom);
    EXPECT_LE((frame(out("more"), k) - expected).rowwise().norm().maxCoeff(), 1e-6F) << "frame " << k;
    added = std::max(added, (flesh - bottom).rowwise().norm().maxCoeff());
    // Where nothing is added, plain skinning to the last bit.
    const auto pose =
        skeleton::pose_from_rest(rig.skeleton, skeleton::sample(rig.skeleton, clip, clip.start + k / 10.0));
    EXPECT_TRUE(plain == assets::to_float(assets::skin(rig, pose))) << "frame " << k;
  }
  EXPECT_GT(added, 0.003F);  // there was something to add
}

// Several regions need damping that these integrators do not bring: one line, and no folder.
TEST_F(Simulate, RefusesAnIntegratorThatTheModelCannotBear) {
  const fs::path rig = fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb";
  const Outcome outcome = run(command_line("simulate " + quoted(rig) + " -o " + quoted(out("no")) +
                                           " --frames 0-1 --cells 60 --model blended --integrator tr-bdf2"));
  EXPECT_EQ(outcome.exit_code, 2) << outcome.text;
  EXPECT_NE(outcome.text.find("integrator: tr-bdf2 and implicit-midpoint step blended flesh of one region"),
            std::string::npos)
      << outcome.text;
  EXPECT_FALSE(fs::exists(out("no")));
}

}  // namespace
}  // namespace sinew::tests
