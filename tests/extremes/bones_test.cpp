// Bones that turn, jump, race, shake and are pulled apart.

#include "fem/time/envelope.h"
#include "tests/extremes/extremes.h"

namespace sinew::tests {
namespace {

// Turned within one frame and held: the bar ends where its base is, as on the slow way. Farther than a right
// angle a tip may be left wound round its base.
TEST(Extremes, X12BonesThatTurnByUpToTwoWholeTurnsInAFrame) {
  ExtremesTable table("X12",
                      "Bones that turn by 1 to 720 degrees in a frame: at most 15 degrees in a part of a "
                      "step; up to 90 degrees the same end as the slow way to 1e-6; all comes to rest.");
  table.excuse("stvk beyond 90 degrees", "flung round it is squeezed beyond its law, and says so");
  table.excuse("blended, blended-stiffness at 720 degrees",
               "linear flesh is flung out by a hundred lengths at 24 times the speed of sound, and says so");
  const Body body = short_bar(kFirm, kCritical);
  for (double degrees : {1.0, 30.0, 90.0, 179.0, 180.0, 181.0, 720.0}) {
    const Motion motion = [&](double time) -> std::vector<Eigen::Affine3d> {
      return {turned(degrees * std::clamp(time / kFrame, 0.0, 1.0))};
    };
    for (const std::string& rung : dynamic_rungs()) {
      const SimulationOptions options = extreme_options(rung, kFrame, kNoWeight);
      Simulation first(body, motion, 0.0, options);
      const fem::SimulationReport turn = first.advance_to(kFrame);
      const Extreme run = run_extreme({body, motion, options, 150, 2.5 * kFrame});
      table.add(fmt::format("{:g} degrees", degrees), rung, run,
                !((rung == "stvk" && degrees > 90.0) || (rung.starts_with("blended") && degrees > 181.0)));
      if (!run.ok) continue;
      table.at_most("degrees in a part", degrees / turn.steps, 15.0 + 1e-9);
      table.at_most("kinetic energy left", run.late / std::max(run.early, 1e-12), 1e-6);
      table.at_most("growth of energy", run.growth, 1e-6);
      if (degrees <= 90.0)
        table.at_most("off the slow way", distance(run.x, moved(body, turned(degrees))), 1e-6);
    }
  }
}

// There and back. Jumps of more than the size of the body, 1.15 m, are cuts, that flesh is carried over.
TEST(Extremes, X13BonesThatJump) {
  ExtremesTable table("X13",
                      "Bones that jump by 1 to 1e6 lengths in a frame and back: no inverted cell left, and "
                      "back where it began to 1e-8.");
  const Body body = short_bar(kFirm, kCritical);
  table.excuse("springs up to the body's size",
               "dragged over a length they may turn inside out, where they are as much at rest");
  EXPECT_NEAR(body.size, 1.149, 1e-3);
  for (double lengths : {1.0, 1.14, 1.16, 2.0, 10.0, 100.0, 1e6}) {
    const Motion motion = [&](double time) -> std::vector<Eigen::Affine3d> {
      Eigen::Affine3d base = Eigen::Affine3d::Identity();
      if (time >= 2.5 * kFrame && time < 1.5) base.translation()[1] = lengths;
      return {base};
    };
    for (const std::string& rung : dynamic_rungs()) {
      const Extreme run = run_extreme({body, motion, extreme_options(rung, kFrame, kNoWeight), 240, 1.6});
      table.add(fmt::format("{:g} lengths", lengths), rung, run);
      table.note("strain energy at most, J", run.elastic);
      if (!run.ok) continue;
      table.at_most("growth of energy", run.growth, 1e-6);
      if (rung == "springs" && lengths < body.size) continue;
      table.at_most("off the begin", distance(run.x, body.mesh.points), 1e-8);
      table.at_most("inverted cells", run.inverted, 0.0);
    }
  }
}

// Flesh that is carried over a cut keeps its velocity: it goes on swinging as if nothing had been.
TEST(Extremes, X13ACutGivesNoPush) {
  ExtremesTable table("X13-cut", "A cut gives no push: the flesh swings on as without it.");
  const Body body = short_bar(kFirm, kDamped);
  const auto swing = [&](const std::string& rung, double lengths, ExtremesTable* into) {
    const Motion motion = [lengths](double time) -> std::vector<Eigen::Affine3d> {
      Eigen::Affine3d base = Eigen::Affine3d::Identity();
      if (time > 10.5 * kFrame) base.translation()[1] = lengths;
      return {base};
    };
    const SimulationOptions options = extreme_options(rung, kFrame, 0.3 * kWeight, Integrator::BackwardEuler);
    Extreme run = run_extreme({body, motion, options, 20});
    if (into != nullptr) into->add(fmt::format("{:g} lengths", lengths), rung, run);
    run.x.col(1).array() -= lengths;
    return run;
  };
  for (const std::string& rung : dynamic_rungs()) {
    const Extreme without = swing(rung, 0.0, nullptr), with = swing(rung, 64.0, &table);
    table.at_most("off the swing without it", distance(with.x, without.x), 1e-9);
  }
}

// From rest at once to a speed up to that of sound, 32 m/s, and beyond, and on at that speed: after two
// seconds the bar travels undeformed.
TEST(Extremes, X14BonesAThousandTimesAsFastAsSound) {
  ExtremesTable table("X14",
                      "Bones at 0.1 to 1000 times the speed of sound, from rest: undeformed in the end; a "
                      "warning above the speed of sound.");
  const Body body = short_bar(kFirm, kCritical);
  table.excuse("stvk at the speed of sound", "jerked it is squeezed beyond its law, and says so");
  for (double mach : {0.1, 0.5, 1.0, 4.0, 10.0, 1000.0}) {
    const Motion motion = [&](double time) -> std::vector<Eigen::Affine3d> {
      Eigen::Affine3d base = Eigen::Affine3d::Identity();
      base.translation()[1] = 32.0 * mach * std::max(0.0, time);
      return {base};
    };
    for (const std::string& rung : dynamic_rungs()) {
      const Extreme run = run_extreme({body, motion, extreme_options(rung, kFrame, kNoWeight), 150});
      table.add(fmt::format("{:g} times sound", mach), rung, run, !(rung == "stvk" && mach == 1.0));
      if (!run.ok) continue;
      // A place of 8e4 m is known to 1e-11 m.
      table.at_most("off its base", distance(run.x, moved(body, motion(run.time)[0])), 1e-8);
    }
  }
}

// Shaken in the middle of its lowest mode without damping, the bar swings higher by the same amount in every
// period: by pi times the mode's share of the shaking, as a linear oscillator does.
TEST(Extremes, X15BonesThatShakeAtResonance) {
  ExtremesTable table("X15",
                      "Shaken at its own frequency, undamped, for 100 periods: grows in proportion to time "
                      "within 5 %.");
  table.excuse("springs", "their stiffness and so their lowest mode are others; they must stay finite");
  const Body body = short_bar(kFirm, {0.0, 2.0});
  const Modes modes = modes_of(body);
  const double w = modes.omega[0], period = 2.0 * M_PI / w, shaking = 1e-5;
  // TR-BDF2 swings slower than the mode by a part of (w h)^2: 100 steps stay in phase for 100 periods.
  const int per_period = 100, periods = kNightly ? 100 : 20;
  const Motion motion = [&](double time) -> std::vector<Eigen::Affine3d> {
    Eigen::Affine3d base = Eigen::Affine3d::Identity();
    base.translation()[2] = shaking * std::sin(w * time);
    return {base};
  };
  const int tip = vertex_at(body, {1.0, 0.0, 0.0});
  // q'' + w^2 q = share w^2 a sin(w t), with the mode's share of a translation in z; |q| = share w a t / 2.
  // The square bar has two modes of that frequency.
  Points unit = Points::Zero(body.mesh.num_vertices(), 3);
  unit.col(2).setOnes();
  double expected = 0.0;  // of the tip in a period
  for (Eigen::Index k = 0; modes.omega[k] < 1.0001 * w; ++k) {
    const Points mode = modes.at_leaves(k);
    expected += fem::apply_mass(body.matrices, unit).cwiseProduct(mode).sum() * mode(tip, 2) * M_PI * shaking;
  }
  for (const std::string& rung : dynamic_rungs()) {
    std::vector<double> amplitude(static_cast<std::size_t>(periods), 0.0);
    int step = 0;
    const auto look = [&](const Simulation& simulation) {
      double& most = amplitude[static_cast<std::size_t>(step++ / per_period)];
      most = std::max(
          most, std::abs(simulation.flesh().x(tip, 2) - motion(simulation.flesh().time)[0].translation()[2]));
    };
    const SimulationOptions options =
        extreme_options(rung, period / per_period, kNoWeight, Integrator::TrBdf2);
    const Extreme run = run_extreme({body, motion, options, periods * per_period}, look);
    table.add(fmt::format("{} periods", periods), rung, run);
    if (rung == "springs") continue;
    table.at_most("growth off the oscillator's", std::abs(amplitude.back() / (expected * periods) - 1.0),
                  0.05);
    table.at_most("second half over the first, off",
                  std::abs(amplitude.back() / amplitude[amplitude.size() / 2 - 1] / 2.0 - 1.0), 0.05);
  }
}

/// The bar held at both ends, the far one on a joint of its own.
Body held_at_both_ends() {
  BarOptions options = short_bar_options(kFirm, kCritical);
  options.held = [](const Eigen::Vector3d& x) { return x[0] < 1e-9 || x[0] > 1.0 - 1e-9; };
  Body body = bar_body(options);
  for (fem::BoneVertex& vertex : body.bones.vertices) {
    if (vertex.x_a[0] > 0.5) vertex.joint_a = vertex.joint_b = 1;
  }
  return body;
}

// Drawn to a hundred times the length and pushed to a hundredth, and through itself, within a second. What
// resists down to 0.58 of its length only must say so.
TEST(Extremes, X16BonesPulledApartAndPushedThroughEachOther) {
  ExtremesTable table("X16",
                      "Two ends drawn to 100 times the length, pushed to a hundredth and through each other: "
                      "ten times is well; squeezed below its law's least stretch it ends by name.");
  table.excuse("stvk at 0.6 and less",
               "its law resists down to 0.58, and the run says so (at 0.6 it buckles first)");
  const Body body = held_at_both_ends();
  for (double stretch : {-0.5, 0.01, 0.1, 0.6, 0.8, 1.0, 10.0, 100.0}) {
    const Motion motion = [&](double time) -> std::vector<Eigen::Affine3d> {
      Eigen::Affine3d far = Eigen::Affine3d::Identity();
      far.translation()[0] = (stretch - 1.0) * smooth_step(time);
      return {Eigen::Affine3d::Identity(), far};
    };
    for (const std::string& rung : dynamic_rungs()) {
      const Extreme run = run_extreme({body, motion, extreme_options(rung, kFrame, kNoWeight), 120, 1.1});
      const bool gives_up = rung == "stvk" && stretch < 0.58;
      table.add(fmt::format("stretch {:g}", stretch), rung, run, rung != "stvk" || stretch > 0.6);
      if (run.ok) table.at_most("growth of energy", run.growth, 1e-6);
      if (gives_up) {
        EXPECT_FALSE(run.ok) << stretch;
        EXPECT_NE(run.failure.find("neo-hookean"), std::string::npos) << run.failure;
      }
    }
    // With a preconditioner of other digits the same stages are solved on other ways.
    for (fem::Precision precision : {fem::Precision::Double, fem::Precision::Short}) {
      SimulationOptions options = extreme_options("corotational", kFrame, kNoWeight);
      options.solver.precision = precision;
      const Extreme run = run_extreme({body, motion, options, 120, 1.1});
      table.add(fmt::format("stretch {:g}, {} digits", stretch,
                            precision == fem::Precision::Double ? "more" : "fewer"),
                "corotational", run);
    }
  }
}

// What the rows of this file show is what the envelope of motions says, and a motion outside of it is told.
TEST(Extremes, MotionsOutsideOfTheEnvelopeAreToldWithBoneAndTime) {
  const Arm arm = small_arm();
  const Body body = small_arm_body(arm, 90 * kDegree);
  Eigen::Vector3d gravity = kNoWeight;
  const auto warnings = [&](const Motion& motion) {
    return fem::outside_envelope(body, motion, extreme_options("stvk", 1.0 / 30.0, gravity), 0.0, 30);
  };
  const auto bent = [](double degrees) -> Motion {
    return [degrees](double time) { return arm_pose(time < 0.5 ? 0.0 : degrees * kDegree); };
  };
  EXPECT_TRUE(warnings(bent(10.0)).empty());
  gravity[1] = -2.0;  // of sound that makes 50 m^2/s^2 by its square
  ASSERT_EQ(warnings(bent(10.0)).size(), 1U);
  EXPECT_EQ(
      warnings(bent(10.0))[0],
      fmt::format("model stvk: the weight of the flesh, rho g size / E, is {:.3g}, where it is tested up to "
                  "0.03",
                  2.0 * body.size / 50.0));
  gravity = kNoWeight;
  ASSERT_EQ(warnings(bent(135.0)).size(), 2U);
  EXPECT_EQ(warnings(bent(135.0))[0],
            "bone 'elbow': turns by 135 degrees in the step to 0.5 s, where every model is tested up to 90");
  const auto shifted = [](double metres) -> Motion {
    return [metres](double time) {
      return arm_pose(0.0, Eigen::Affine3d(Eigen::Translation3d(0.0, time < 0.5 ? 0.0 : metres, 0.0)));
    };
  };
  EXPECT_TRUE(warnings(shifted(0.1)).empty());  // 3 m/s; sound makes 7.07 there
  ASSERT_EQ(warnings(shifted(0.3)).size(), 1U);
  EXPECT_EQ(
      warnings(shifted(0.3))[0],
      "bone 'upper': changes its velocity by 9 m/s (1.27 times sound in the flesh) in the step to 0.5 s, "
      "where every model is tested up to 3.54");
  ASSERT_EQ(warnings(shifted(0.2)).size(), 1U);
  const fem::SimulationOptions others = extreme_options("neo-hookean", 1.0 / 30.0, gravity);
  EXPECT_TRUE(fem::outside_envelope(body, shifted(0.2), others, 0.0, 30).empty()) << "0.85 times sound";
  ASSERT_EQ(warnings(shifted(30.0)).size(), 2U);
  EXPECT_NE(warnings(shifted(30.0))[0].find("the flesh is carried along"), std::string::npos);
  const Motion drawn = [](double time) {
    std::vector<Eigen::Affine3d> pose = arm_pose(0.0);
    pose[2].translation()[0] += 6.0 * smooth_step(time);
    return pose;
  };
  ASSERT_EQ(warnings(drawn).size(), 1U);
  EXPECT_NE(warnings(drawn)[0].find("bone 'lower': is drawn to 13 times its length"), std::string::npos)
      << warnings(drawn)[0];
  const Motion pressed = [](double time) {
    std::vector<Eigen::Affine3d> pose = arm_pose(0.0);
    pose[2].translation()[0] -= 0.15 * smooth_step(time);
    return pose;
  };
  ASSERT_EQ(warnings(pressed).size(), 1U);
  EXPECT_NE(warnings(pressed)[0].find("bone 'lower': is squeezed to one part in 1.43 of its length"),
            std::string::npos)
      << warnings(pressed)[0];
}

}  // namespace
}  // namespace sinew::tests
