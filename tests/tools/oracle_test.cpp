// The bundled arm held bent: how far every rung is from neo-Hookean flesh on the same lattice.

#include "tests/tools/oracle.h"

#include <gtest/gtest.h>

namespace sinew::tests {
namespace {

struct Goal {
  const char* rung;
  double percent;  ///< rms of the skin, of the arm's height.
};

void expect_goals(double degrees, const std::vector<Goal>& goals) {
  const OracleSample arm(sample_scene("arm", "elbow", 200));
  const Frames exact = held(arm, "neo-hookean", degrees);
  ASSERT_FALSE(exact.empty());
  for (const Goal& goal : goals) {
    const Frames found = held(arm, goal.rung, degrees);
    ASSERT_FALSE(found.empty()) << goal.rung;
    EXPECT_LE(rms_percent(found, exact, arm.character.rig.height), goal.percent) << goal.rung;
  }
}

// What a rung may err is 3, 2 and 1 % at 120 degrees and half of that at 60. Measured 1.61, 1.10 and 0.19 %,
// and 0.25, 0.10 and 0.08 %; bounds a quarter above, so that losing what is there is seen.
TEST(Oracle, TheRungsStayWithinTheirGoalsAtASharpElbow) {
  expect_goals(120.0, {{"blended", 2.0}, {"blended-stiffness", 1.4}, {"corotational", 0.24}});
}

TEST(Oracle, TheRungsStayWithinHalfOfTheirGoalsAtSixtyDegrees) {
  expect_goals(60.0, {{"blended", 0.3}, {"blended-stiffness", 0.12}, {"corotational", 0.1}});
}

// Measured over these six frames 0.58, 0.20, 0.10 and 0.08 % of the height.
TEST(Oracle, DearerRungsAreNearerToNeoHookeanFleshInAHop) {
  const OracleSample hop(sample_scene("hopper", "", 200));
  const Frames exact = moving(hop, "neo-hookean", 6);
  ASSERT_FALSE(exact.empty());
  double before = 1e9;
  for (const char* rung : {"skin", "blended", "blended-stiffness", "corotational"}) {
    const Frames found = moving(hop, rung, 6);
    ASSERT_FALSE(found.empty()) << rung;
    const double error = rms_percent(found, exact, hop.character.rig.height);
    EXPECT_LT(error, before) << rung;
    before = error;
  }
}

}  // namespace
}  // namespace sinew::tests
