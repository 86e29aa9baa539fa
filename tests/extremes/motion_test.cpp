// Bones that turn, jump, race and are pulled apart, heavy gravity, and long runs.

#include "fem/equilibrium.h"
#include "tests/extremes/extremes.h"

namespace sinew::tests {
namespace {

using fem::Body;
using fem::Integrator;
using fem::Motion;
using fem::Simulation;
using lattice::Points;

constexpr double kFrame = 1.0 / 60.0;
const fem::Material kFirm{1e6, 0.3, 1000.0};
/// Critical at the bar's lowest frequency of 2 Hz: what is left falls by exp(-12.6) in a second.
const fem::Damping kCritical{1.0, 2.0};
const Eigen::Vector3d kNoWeight = Eigen::Vector3d::Zero();

Eigen::Affine3d turned(double degrees) {
  return Eigen::Affine3d(Eigen::AngleAxisd(degrees * kDegree, Eigen::Vector3d::UnitY()));
}

/// The bar without weight rests undeformed, wherever its base has gone.
Points moved(const Body& body, const Eigen::Affine3d& base) {
  return (body.mesh.points * base.linear().transpose()).rowwise() + base.translation().transpose();
}

// Turned within one frame and held: the bar ends where its base is. Flesh whose law gives up when squeezed
// may end by name where it is thrown round, and all of it where it is flung out at two turns a frame.
TEST(Extremes, X12BonesThatTurnByUpToTwoWholeTurnsInAFrame) {
  ExtremesTable table("X12");
  const Body body = short_bar(kFirm, kCritical);
  for (double degrees : {1.0, 30.0, 90.0, 179.0, 180.0, 181.0, 720.0}) {
    const Motion motion = [&](double time) -> std::vector<Eigen::Affine3d> {
      return {turned(degrees * std::clamp(time / kFrame, 0.0, 1.0))};
    };
    for (const std::string& rung : dynamic_rungs()) {
      Simulation simulation(body, motion, 0.0, extreme_options(rung, kFrame, kNoWeight));
      Extreme run = run_extreme(simulation, kFrame, 120);
      const std::string setting = fmt::format("{:g} degrees", degrees);
      // A slow whole turn may leave the soft tip wound round its base: 90 degrees and less must not.
      if (run.ok && degrees <= 90.0) {
        EXPECT_LE(distance(run.x, moved(body, turned(degrees))), 1e-6) << rung << ", " << setting;
      }
      if (run.ok) {
        EXPECT_LE(run.late, 1e-6 * std::max(run.early, 1e-12)) << rung << ", " << setting;
      }
      if (degrees <= 90.0 || (degrees <= 181.0 && rung != "stvk")) {
        EXPECT_TRUE(run.ok) << rung << ", " << setting << ": " << run.failure;
      }
      table.add(setting, rung, run);
    }
  }
}

// There and back. After a jump of more than a length flesh may stay tangled, and the run may be refused, by
// name.
TEST(Extremes, X13BonesThatJump) {
  ExtremesTable table("X13");
  const Body body = short_bar(kFirm, kCritical);
  for (double lengths : {1.0, 10.0, 100.0, 1e6}) {
    const Motion motion = [&](double time) -> std::vector<Eigen::Affine3d> {
      Eigen::Affine3d base = Eigen::Affine3d::Identity();
      if (time >= 2.5 * kFrame && time < 1.5) base.translation()[1] = lengths;
      return {base};
    };
    for (const std::string& rung : dynamic_rungs()) {
      Simulation simulation(body, motion, 0.0, extreme_options(rung, kFrame, kNoWeight));
      const Extreme run = run_extreme(simulation, kFrame, 240);
      const std::string setting = fmt::format("{:g} lengths", lengths);
      table.add(setting, rung, run);
      if (lengths <= 1.0) {
        EXPECT_TRUE(run.ok) << rung << ", " << setting << ": " << run.failure;
      }
      if (!run.ok || lengths > 1.0 || rung == "springs") continue;  // springs inside out are as happy
      EXPECT_LE(distance(run.x, body.mesh.points), 1e-8) << rung << ", " << setting;
      EXPECT_EQ(simulation.measures_at(simulation.state().time).inverted_cells, 0) << rung << ", " << setting;
    }
  }
}

// From rest at once to a speed up to that of sound, 32 m/s, and beyond, and on at that speed: after two
// seconds the bar travels undeformed. Faster than sound it may stay tangled.
TEST(Extremes, X14BonesAThousandTimesAsFastAsSound) {
  ExtremesTable table("X14");
  const Body body = short_bar(kFirm, kCritical);
  for (double mach : {0.1, 1.0, 10.0, 1000.0}) {
    const Motion motion = [&](double time) -> std::vector<Eigen::Affine3d> {
      Eigen::Affine3d base = Eigen::Affine3d::Identity();
      base.translation()[1] = 32.0 * mach * std::max(0.0, time);
      return {base};
    };
    for (const std::string& rung : dynamic_rungs()) {
      Simulation simulation(body, motion, 0.0, extreme_options(rung, kFrame, kNoWeight));
      const Extreme run = run_extreme(simulation, kFrame, 150);
      const std::string setting = fmt::format("{:g} times sound", mach);
      table.add(setting, rung, run);
      if (mach < 1.0 || (mach == 1.0 && rung != "stvk")) {
        EXPECT_TRUE(run.ok) << rung << ", " << setting << ": " << run.failure;
      }
      if (!run.ok || mach > 1.0 || rung == "springs") continue;
      const Points home = moved(body, motion(simulation.state().time)[0]);
      EXPECT_LE(distance(run.x, home), 1e-8) << rung << ", " << setting;
    }
  }
}

// Shaken at its own frequency without damping, a linear body swings higher by the same amount in every
// period. The others leave small displacements some time, and must stay finite.
TEST(Extremes, X15BonesThatShakeAtResonance) {
  ExtremesTable table("X15");
  const Body body = short_bar(kFirm, {0.0, 2.0});
  const double frequency = natural_frequencies(body, 1)[0];
  const Motion motion = [&](double time) -> std::vector<Eigen::Affine3d> {
    Eigen::Affine3d base = Eigen::Affine3d::Identity();
    base.translation()[2] = 1e-4 * std::sin(2.0 * M_PI * frequency * time);
    return {base};
  };
  const double step = 1.0 / (40.0 * frequency);
  const int tip = vertex_at(body, {1.0, 0.0, 0.0});
  for (const std::string& rung : dynamic_rungs()) {
    const bool linear = rung == "blended";
    Simulation simulation(body, motion, 0.0, extreme_options(rung, step, kNoWeight, Integrator::TrBdf2));
    const int periods = linear ? 100 : (kNightly ? 100 : 5);
    std::vector<double> amplitude;
    Extreme run;
    for (int period = 0; period < periods; ++period) {
      double largest = 0.0;
      run = run_extreme(simulation, step, 40);
      if (!run.ok) break;
      largest = std::abs(run.x(tip, 2));
      for (int k = 0; linear && k < 40; ++k) {
        const Extreme one = run_extreme(simulation, step, 1);
        largest = std::max(largest, std::abs(one.x(tip, 2)));
      }
      amplitude.push_back(largest);
    }
    table.add("at resonance", rung, run);
    EXPECT_TRUE(run.ok) << rung << ": " << run.failure;
    // 200 periods of the base in 100 entries: the growth from the 10th to the 20th is that of the first ten.
    if (linear) {
      EXPECT_NEAR(amplitude[19] / amplitude[9], 2.0, 0.1);
    }
  }
}

/// The bar held at both ends, the far one on a joint of its own.
Body held_at_both_ends() {
  BarOptions options;
  options.box.min = {0.0, -0.2, -0.2};
  options.box.max = {1.0, 0.2, 0.2};
  options.box.blocks = {2, 1, 1};
  options.material = kFirm;
  options.damping = kCritical;
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
  ExtremesTable table("X16");
  const Body body = held_at_both_ends();
  for (double stretch : {-0.5, 0.01, 0.1, 1.0, 10.0, 100.0}) {
    const Motion motion = [&](double time) -> std::vector<Eigen::Affine3d> {
      Eigen::Affine3d far = Eigen::Affine3d::Identity();
      far.translation()[0] = (stretch - 1.0) * smooth_step(time);
      return {Eigen::Affine3d::Identity(), far};
    };
    for (const std::string& rung : dynamic_rungs()) {
      Simulation simulation(body, motion, 0.0, extreme_options(rung, kFrame, kNoWeight));
      const Extreme run = run_extreme(simulation, kFrame, 70);
      const std::string setting = fmt::format("stretch {:g}", stretch);
      table.add(setting, rung, run);
      const bool must = (stretch >= 0.9 && stretch <= 10.0) || rung == "blended" || rung == "corotational";
      if (must) {
        EXPECT_TRUE(run.ok) << rung << ", " << setting << ": " << run.failure;
      }
      if (!run.ok && rung == "stvk") {
        EXPECT_NE(run.failure.find("neo-hookean"), std::string::npos) << run.failure;
      }
    }
  }
}

// A linear rung sags in proportion; under a thousand g soft flesh may end, by name.
TEST(Extremes, X17GravityFromNoneToAThousandfold) {
  ExtremesTable table("X17");
  const Body body = short_bar(kFirm, kCritical);
  for (double g : {0.0, 1e-6 * 9.81, 9.81, 1e3 * 9.81}) {
    for (const std::string& rung : dynamic_rungs()) {
      Simulation simulation(body, still_base, 0.0, extreme_options(rung, kFrame, {0.0, 0.0, -g}));
      const Extreme run = run_extreme(simulation, kFrame, 120);
      const std::string setting = fmt::format("{:g} m/s^2", g);
      table.add(setting, rung, run);
      if (g < 10.0) {
        EXPECT_TRUE(run.ok) << rung << ", " << setting << ": " << run.failure;
      }
      if (run.ok && rung == "blended" && g > 0.0) {
        const Points linear = static_displacement(body, gravity_force(body, {0.0, 0.0, -g}));
        // What critical damping leaves after two seconds; and the rounding of places of 1 m.
        EXPECT_LE(distance(run.x - body.mesh.points, linear),
                  1e-6 * linear.rowwise().norm().maxCoeff() + 1e-14);
      }
    }
  }
}

// Nothing drifts at rest, and the midpoint rule keeps its energy however long.
TEST(Extremes, X20AMillionSteps) {
  ExtremesTable table("X20");
  const Body body = short_bar(kFirm, {0.1, 2.0});
  for (const std::string& rung : dynamic_rungs()) {
    const int many = rung == "blended" ? 1'000'000 : 10'000;
    const int steps = kNightly ? many : many / 100;
    Simulation simulation(body, still_base, 0.0, extreme_options(rung, kFrame, kNoWeight));
    const Extreme run = run_extreme(simulation, kFrame, steps);
    table.add(fmt::format("{} steps at rest", steps), rung, run);
    ASSERT_TRUE(run.ok) << rung << ": " << run.failure;
    EXPECT_LE(distance(run.x, body.mesh.points), 1e-9) << rung;
    const Motion waving = [](double time) -> std::vector<Eigen::Affine3d> {
      return {turned(40.0 * std::sin(3.0 * time))};
    };
    Simulation moving(body, waving, 0.0, extreme_options(rung, kFrame, kNoWeight));
    const Extreme wave = run_extreme(moving, kFrame, steps);
    table.add(fmt::format("{} steps in motion", steps), rung, wave);
    EXPECT_TRUE(wave.ok) << rung << ": " << wave.failure;
  }
  const Body undamped = short_bar(kFirm, {0.0, 2.0});
  const Eigen::Vector3d weight(0.0, 0.0, -1.0);
  Simulation midpoint(undamped, still_base, 0.0,
                      extreme_options("blended", kFrame, weight, Integrator::ImplicitMidpoint));
  const Extreme swing = run_extreme(midpoint, kFrame, kNightly ? 100'000 : 3'000);
  EXPECT_LE(std::abs(swing.energy), 1e-6 * swing.late);
}

// An elbow held bent under its weight, from rest and without settling: it swings and comes to rest, and its
// energy never passes what the fall gave it.
TEST(Extremes, AHeldElbowGainsNoEnergy) {
  ExtremesTable table("held");
  const Arm arm = small_arm();
  const std::vector<double> all{0.0, 30.0, 60.0, 90.0, 120.0}, some{60.0, 120.0};
  for (double degrees : kNightly ? all : some) {
    const Body body = small_arm_body(arm, degrees * kDegree);
    const Motion held = [&](double) { return arm_pose(degrees * kDegree); };
    for (const std::string& rung : dynamic_rungs()) {
      fem::SimulationOptions options = extreme_options(rung, 1.0 / 30.0, {0.0, -9.81, 0.0});
      Simulation simulation(body, held, 0.0, options);
      const Extreme run = run_extreme(simulation, 1.0 / 30.0, 60);
      const std::string setting = fmt::format("{:g} degrees", degrees);
      table.add(setting, rung, run);
      // Springs and St. Venant's law have no rest where the elbow's inside is folded: they say so.
      if (degrees <= 60.0 || rung == "blended" || rung == "corotational" || rung == "neo-hookean") {
        EXPECT_TRUE(run.ok) << rung << ", " << setting << ": " << run.failure;
      }
      if (!run.ok) continue;
      EXPECT_LE(run.late, 1e-3 * run.early) << rung << ", " << setting;
    }
  }
}

}  // namespace
}  // namespace sinew::tests
