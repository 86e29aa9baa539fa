// Tolerances, threads, denormals, reversal, symmetry, time that stands still, and scenes at random.

#include <random>

#include <tbb/global_control.h>

#include "assets/pc2.h"
#include "fem/envelope.h"
#include "fem/models/neo_hookean.h"
#include "fem/models/newton_model.h"
#include "tests/extremes/extremes.h"

namespace sinew::tests {
namespace {

using fem::Body;
using fem::Integrator;
using fem::Motion;
using fem::Simulation;
using lattice::Points;

const fem::Material kFirm{1e6, 0.3, 1000.0};
const fem::Damping kDamped{0.1, 2.0};
const Eigen::Vector3d kWeight(0.0, 0.0, -1.0);

// Sound crosses a cell of 0.25 m, at 32 m/s, in 8 ms.
TEST(Extremes, X28StepsThatSoundCrossesThousandsOfCellsIn) {
  ExtremesTable table("X28");
  const Body body = short_bar(kFirm, kDamped);
  for (double cells : {1e-3, 1.0, 100.0, 1e4}) {
    const double step = cells * 0.25 / 32.0;
    for (const std::string& rung : dynamic_rungs()) {
      Simulation simulation(body, still_base, 0.0, extreme_options(rung, step, kWeight));
      const Extreme run = run_extreme(simulation, step, 30);
      table.add(fmt::format("{:g} cells", cells), rung, run);
      EXPECT_TRUE(run.ok) << rung << ", " << cells << ": " << run.failure;
    }
  }
}

// The looser, the farther off; where rounding rules, a tighter tolerance ends all the same.
TEST(Extremes, X29TolerancesOfNewtonsMethod) {
  ExtremesTable table("X29");
  const Body body = short_bar({1e5, 0.45, 1000.0}, kDamped);
  const auto rest = [&](double tolerance) {
    fem::NewtonOptions options;
    options.rest_tolerance = tolerance;
    const auto model = fem::make_newton_model("neo-hookean", body, fem::neo_hookean_cells(body), options);
    const fem::PosedFrames pose = fem::pose_frames(body.tree, still_base(0.0), 0.0);
    fem::PoseProblem problem;
    problem.pose = &pose;
    problem.gravity = kWeight;
    Extreme run;
    run.x = body.mesh.points;
    const fem::SolveReport report = model->equilibrate(problem, run.x);
    run.ok = report.ok();
    run.failure = report.message;
    table.add(fmt::format("tolerance {:g}", tolerance), "neo-hookean", run);
    EXPECT_TRUE(run.ok) << tolerance << ": " << run.failure;
    return run.x;
  };
  const Points exact = rest(1e-12);
  double before = 1.0;
  for (double tolerance : {1e-2, 1e-4, 1e-6, 1e-8, 1e-14}) {
    const double error = distance(rest(tolerance), exact);
    EXPECT_LE(error, std::max(before, 1e-12)) << tolerance;
    before = error;
  }
}

TEST(Extremes, X30ThreadsOneToSixteenGiveTheSameBits) {
  ExtremesTable table("X30");
  const Arm arm = small_arm();
  const Body body = small_arm_body(arm, 60 * kDegree);
  const Motion motion = [](double time) { return arm_pose(60 * kDegree * smooth_step(2.0 * time)); };
  for (const std::string& rung : dynamic_rungs()) {
    Points one;
    for (std::size_t threads : {1, 2, 4, 16}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      Simulation simulation(body, motion, 0.0, extreme_options(rung, 1.0 / 60, kWeight));
      const Extreme run = run_extreme(simulation, 1.0 / 60, 15);
      table.add(fmt::format("{} threads", threads), rung, run);
      EXPECT_TRUE(run.ok) << rung << ": " << run.failure;
      if (threads == 1) one = run.x;
      EXPECT_TRUE(one == run.x) << rung << ", " << threads << " threads";
    }
  }
}

// Flesh that comes to rest ends in numbers too small for the processor's fast path. The fastest of many steps
// at the begin and at the end, so that nothing else on the machine counts.
TEST(Extremes, X31RestIsNoSlowerThanMotion) {
  ExtremesTable table("X31");
  const Body body = short_bar(kFirm, {1.0, 2.0});
  Simulation simulation(body, still_base, 0.0, extreme_options("blended", 1.0 / 60, {0.0, 0.0, 0.0}));
  Points v = Points::Zero(body.mesh.num_vertices(), 3);
  v.col(2).setConstant(0.1);
  simulation.set_velocity(v);
  const auto fastest = [&](int steps) {
    double least = 1e9;
    for (int k = 0; k < steps; k += 50)
      least = std::min(least, run_extreme(simulation, 1.0 / 60, 50).seconds);
    return least;
  };
  const double moving = fastest(1000);
  run_extreme(simulation, 1.0 / 60, kNightly ? 1'000'000 : 5'000);
  EXPECT_LE(fastest(1000), 1.5 * moving);
}

TEST(Extremes, X32FramesThatFloatsCannotHold) {
  lattice::Points points(1, 3);
  points << 1e-40, 0.0, 1.0;
  EXPECT_LE(std::abs(assets::to_float(points)(0, 0)), 1e-38F);
  points(0, 0) = 1e39;
  EXPECT_THROW(assets::to_float(points), std::domain_error);
}

// The midpoint rule is its own inverse: with all velocities turned round a linear body finds back.
TEST(Extremes, X33ThousandStepsAndBack) {
  ExtremesTable table("X33");
  const Body body = short_bar(kFirm, {0.0, 2.0});
  Simulation simulation(body, still_base, 0.0,
                        extreme_options("blended", 1.0 / 60, kWeight, Integrator::ImplicitMidpoint));
  const Extreme there = run_extreme(simulation, 1.0 / 60, 1000);
  EXPECT_GT(distance(there.x, body.mesh.points), 1e-4);
  simulation.set_velocity(-there.v);
  const Extreme back = run_extreme(simulation, 1.0 / 60, 1000);
  table.add("there and back", "blended", back);
  EXPECT_LE(distance(back.x, body.mesh.points), 1e-9);
}

// The arm is its own mirror image in z and bends about z.
TEST(Extremes, X34AMirroredBodyMovesAsItsMirrorImage) {
  ExtremesTable table("X34");
  const Arm arm = small_arm();
  const Body body = small_arm_body(arm, 60 * kDegree);
  std::vector<int> mirror;
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    const Eigen::RowVector3d x = body.mesh.points.row(a);
    mirror.push_back(vertex_at(body, {x[0], x[1], -x[2]}));
  }
  const Motion motion = [](double time) { return arm_pose(60 * kDegree * smooth_step(2.0 * time)); };
  for (const std::string& rung : dynamic_rungs()) {
    Simulation simulation(body, motion, 0.0, extreme_options(rung, 1.0 / 60, {0.0, -9.81, 0.0}));
    const Extreme run = run_extreme(simulation, 1.0 / 60, 30);
    table.add("elbow", rung, run);
    EXPECT_TRUE(run.ok) << rung << ": " << run.failure;
    double worst = 0.0;
    for (int a = 0; a < body.mesh.num_vertices(); ++a) {
      const Eigen::RowVector3d x = run.x.row(a), y = run.x.row(mirror[static_cast<std::size_t>(a)]);
      worst = std::max(worst, (x - Eigen::RowVector3d(y[0], y[1], -y[2])).norm());
    }
    EXPECT_LE(worst, 1e-9) << rung;
  }
}

TEST(Extremes, X35TimeThatStandsStill) {
  ExtremesTable table("X35");
  const Body body = short_bar(kFirm, kDamped);
  // A clip whose keys fall on one instant: a jump, and nothing else ever.
  const Motion motion = [](double time) -> std::vector<Eigen::Affine3d> {
    Eigen::Affine3d base = Eigen::Affine3d::Identity();
    if (time >= 0.1) base.translation()[2] = 0.05;
    return {base};
  };
  for (const std::string& rung : dynamic_rungs()) {
    Simulation simulation(body, motion, 0.0, extreme_options(rung, 1.0 / 60, kWeight));
    ASSERT_EQ(simulation.advance_to(0.2).status, fem::SimulationStatus::Ok);
    const Points x = simulation.positions_at(0.2);
    for (int k = 0; k < 3; ++k) {
      const fem::SimulationReport report = simulation.advance_to(0.2);
      EXPECT_EQ(report.steps, 0);
      EXPECT_TRUE(x == simulation.positions_at(0.2)) << rung;
    }
    EXPECT_TRUE(x.allFinite());
  }
}

/// A scene of everything at random within the envelope, log-uniform but for Poisson's ratio.
Extreme random_scene(std::uint64_t seed, const Arm& arm, std::string& setting, std::string& rung) {
  std::mt19937_64 rng(seed);
  // Not std::uniform_real_distribution, whose numbers differ between libraries.
  const auto unit = [&] { return static_cast<double>(rng() >> 11) * 0x1p-53; };
  const auto log_uniform = [&](double low, double high) { return low * std::pow(high / low, unit()); };
  const std::vector<std::string> rungs = dynamic_rungs();
  rung = rungs[rng() % rungs.size()];
  const auto within = [&](const fem::TestedRange& range) { return log_uniform(range.low, range.high); };
  const fem::TestedRange nu = fem::kTestedPoisson;
  const fem::Material material{within(fem::kTestedYoung), nu.low + (nu.high - nu.low) * unit(),
                               within(fem::kTestedDensity)};
  const fem::Damping damping{within(fem::kTestedDamping), within(fem::kTestedDampingFrequency)};
  const double step = within(fem::kTestedStep), bend = (unit() - 0.5) * M_PI, rate = log_uniform(0.1, 10.0);
  const Eigen::Vector3d gravity(0.0, -log_uniform(1e-3, 20.0), 0.0);
  const bool elbow = unit() < 0.2;
  const std::vector<Integrator> integrators{Integrator::Bdf2, Integrator::BackwardEuler, Integrator::TrBdf2};
  Integrator integrator = integrators[rng() % integrators.size()];
  if (elbow && rung == "blended" && integrator == Integrator::TrBdf2) integrator = Integrator::Bdf2;
  setting = fmt::format("seed {}: E {:.2g}, nu {:.2g}, rho {:.2g}, zeta {:.2g}, h {:.2g}, {}, integrator {}",
                        seed, material.young, material.poisson, material.density, damping.ratio, step,
                        elbow ? "elbow" : "bar", static_cast<int>(integrator));
  fem::BodyOptions options;
  options.levels = 0;
  options.material = material;
  options.damping = damping;
  const std::vector<std::vector<Eigen::Affine3d>> poses{arm_pose(0.0), arm_pose(bend)};
  const Body body = elbow ? fem::make_body({arm.lattice, arm.skin, arm.skeleton, poses}, options)
                          : short_bar(material, damping);
  const Motion motion = [&](double time) -> std::vector<Eigen::Affine3d> {
    const double angle = bend * std::sin(rate * time);
    if (elbow) return arm_pose(angle);
    return {Eigen::Affine3d(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()))};
  };
  Simulation simulation(body, motion, 0.0, extreme_options(rung, step, gravity, integrator));
  return run_extreme(simulation, step, 10);
}

TEST(Extremes, X36ScenesAtRandom) {
  ExtremesTable table("X36");
  const Arm arm = small_arm();
  const int scenes = kNightly ? 10'000 : 300;
  int failures = 0;
  std::string named;
  for (int k = 0; k < scenes; ++k) {
    std::string setting, rung;
    const Extreme run = random_scene(20'021 + static_cast<std::uint64_t>(k), arm, setting, rung);
    if (!run.ok) {
      ++failures;
      named += "\n  " + rung + ", " + setting + ": " + run.failure;
    }
    table.add(setting, rung, run);
    EXPECT_FALSE(::testing::Test::HasFailure()) << rung << ", " << setting;
  }
  EXPECT_LE(failures, scenes / 100) << named;
}

}  // namespace
}  // namespace sinew::tests
