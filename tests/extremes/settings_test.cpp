// Steps, materials, damping and shapes of cells.

#include <optional>

#include "fem/equilibrium.h"
#include "tests/extremes/extremes.h"

namespace sinew::tests {
namespace {

using fem::Body;
using fem::Integrator;
using fem::Simulation;
using lattice::Points;

const fem::Material kFirm{1e6, 0.3, 1000.0};
const fem::Damping kDamped{0.1, 5.0};
const fem::Damping kSlow{0.1, 0.7};  ///< for the bar of 1e5 Pa: its lowest frequency.
const Eigen::Vector3d kWeight(0.0, 0.0, -1.0);

Points rest_of(const Body& body, const std::string& rung, const Eigen::Vector3d& gravity) {
  fem::EquilibriumOptions options;
  options.model = rung;
  options.gravity = gravity;
  const fem::Equilibrium rest =
      fem::find_equilibrium(body, fem::held_pose({Eigen::Affine3d::Identity()}), options);
  EXPECT_TRUE(rest.report.ok()) << rung << ": " << rest.report.message;
  return rest.x;
}

// The bar's lowest mode swings at 2 Hz: a dozen steps of a second and more see the static answer only. In
// tiny ones the tip falls freely, but for the clamp that a consistent mass matrix feels at once: 1.03 %.
TEST(Extremes, X1StepsFromTenthsOfMicrosecondsToDays) {
  ExtremesTable table("X1");
  const Body body = short_bar(kFirm, kDamped);
  const int tip = vertex_at(body, {1.0, 0.0, 0.0});
  for (const std::string& rung : dynamic_rungs()) {
    const Points rest = rest_of(body, rung, kWeight);
    for (Integrator integrator : {Integrator::Bdf2, Integrator::BackwardEuler, Integrator::TrBdf2}) {
      for (double step : {1e-7, 1e-5, 1e-3, 1.0 / 240, 1.0 / 60, 1.0 / 24, 1.0, 1e3, 1e6}) {
        Simulation simulation(body, still_base, 0.0, extreme_options(rung, step, kWeight, integrator));
        const int steps = 12;
        const Extreme run = run_extreme(simulation, step, steps);
        const std::string setting =
            fmt::format("h {:g} s, integrator {}", step, static_cast<int>(integrator));
        table.add(setting, rung, run);
        ASSERT_TRUE(run.ok) << rung << ", " << setting << ": " << run.failure;
        if (step >= 1.0) {
          EXPECT_LE(distance(run.x, rest), 1e-6) << rung << ", " << setting;
        }
        // What Newton's method may leave of an energy's rounding is a tenth of the speed after 1e-7 s.
        if (step == 1e-5 || (step == 1e-7 && rung != "neo-hookean")) {
          const double time = simulation.state().time;
          EXPECT_NEAR(run.v(tip, 2), -time, 0.015 * time) << rung << ", " << setting;
        }
      }
    }
  }
}

// A base that now turns fast and now hardly, so that steps are halved and whole again all the time: not more
// than three times as far from the truth as steps that stay whole.
TEST(Extremes, X2StepsThatChangeAllTheTime) {
  ExtremesTable table("X2");
  const Body body = short_bar(kFirm, kDamped);
  const fem::Motion motion = [](double time) -> std::vector<Eigen::Affine3d> {
    const double angle = 0.3 * std::sin(9.0 * time) + 0.1 * std::sin(31.0 * time + 1.0);
    return {Eigen::Affine3d(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()))};
  };
  const auto end = [&](const std::string& rung, Integrator integrator, double step, double turn) {
    fem::SimulationOptions options = extreme_options(rung, step, kWeight, integrator);
    options.largest_turn = turn;
    Simulation simulation(body, motion, 0.0, options);
    Extreme run = run_extreme(simulation, step, static_cast<int>(std::lround(0.25 / step)));
    EXPECT_TRUE(run.ok) << run.failure;
    EXPECT_EQ(simulation.advance_to(0.25).status, fem::SimulationStatus::Ok);
    run.x = simulation.positions_at(0.25);
    return run;
  };
  for (const std::string& rung : element_rungs()) {
    for (Integrator integrator : {Integrator::Bdf2, Integrator::TrBdf2}) {
      const Points exact = end(rung, integrator, 1.0 / 960, 10.0).x;
      const double whole = distance(end(rung, integrator, 1.0 / 240, 10.0).x, exact);
      const Extreme halved = end(rung, integrator, 1.0 / 240, 3.0 / 240);
      table.add(fmt::format("halved, integrator {}", static_cast<int>(integrator)), rung, halved);
      EXPECT_LE(distance(halved.x, exact), 3.0 * whole) << rung;
    }
  }
}

/// The whip of a bar with E, rho, g, damping and step scaled so that nothing changes but the units.
Points whip(const std::string& rung, double young, double density, double size, ExtremesTable& table,
            const std::string& setting) {
  const double speed = std::sqrt(young / density / 1e3);  // of sound, over that of the base case
  const double time = size / speed;
  fem::Damping damping = kDamped;
  damping.frequency /= time;
  const Body body = short_bar({young, 0.3, density}, damping, size);
  const Eigen::Vector3d gravity = Eigen::Vector3d(0.0, 0.0, -3.0) * size / (time * time);
  Simulation simulation(body, still_base, 0.0, extreme_options(rung, time / 120.0, gravity));
  const Extreme run = run_extreme(simulation, time / 120.0, 12);
  table.add(setting, rung, run);
  EXPECT_TRUE(run.ok) << rung << ", " << setting << ": " << run.failure;
  return (run.x - body.mesh.points) / size;
}

// What is the same in other units moves the same; residuals of 1e-6 of the forces are cut where they are,
// whatever the unit, so the numbers differ by rounding only.
TEST(Extremes, X3X5X18StiffnessDensityAndSizeByPowersOfTen) {
  ExtremesTable table("X3X5X18");
  for (const std::string& rung : dynamic_rungs()) {
    const Points base = whip(rung, 1e6, 1e3, 1.0, table, "base");
    EXPECT_GT(base.rowwise().norm().maxCoeff(), 1e-3);
    for (double young : {1.0, 1e3, 1e9, 2.1e11, 1e15})
      EXPECT_LE(distance(whip(rung, young, 1e-3 * young, 1.0, table, fmt::format("E {:g}", young)), base),
                1e-8)
          << rung << ", E " << young;
    for (double density : {1e-6, 1.0, 1e5})
      EXPECT_LE(distance(whip(rung, 1e6, density, 1.0, table, fmt::format("rho {:g}", density)), base), 1e-8)
          << rung << ", rho " << density;
    for (double size : {1e-6, 1e-3, 1e3, 1e6})
      EXPECT_LE(distance(whip(rung, 1e6, 1e3, size, table, fmt::format("size {:g}", size)), base), 1e-8)
          << rung << ", size " << size;
  }
}

/// Distance of the rung's rest under a feather's weight from the linear answer, over the largest
/// displacement; nothing where there is no rest, by name.
std::optional<double> off_linear(const Body& body, const std::string& rung) {
  // Little enough to be linear to 1e-5; `blended` is linear anyway, and its way to rest ends at a speed.
  const Eigen::Vector3d feather(0.0, 0.0, rung == "blended" ? -10.0 : -1e-3);
  const Points linear = static_displacement(body, gravity_force(body, feather));
  fem::EquilibriumOptions options;
  options.model = rung;
  options.gravity = feather;
  const fem::Equilibrium rest =
      fem::find_equilibrium(body, fem::held_pose({Eigen::Affine3d::Identity()}), options);
  if (!rest.report.ok()) {
    EXPECT_FALSE(rest.report.message.empty());
    return std::nullopt;
  }
  return distance(rest.x - body.mesh.points, linear) / linear.rowwise().norm().maxCoeff();
}

// A direct solve of the linear system against every rung's own way. The energy of flesh a million times as
// stiff hides in its rounding what the rest of the bar does: Newton's rungs may say so.
TEST(Extremes, X4NeighboursAThousandMillionTimesAsStiff) {
  ExtremesTable table("X4");
  for (double contrast : {1e3, 1e6, 1e9}) {
    Body body = short_bar({1e5, 0.3, 1000.0}, kSlow);
    for (std::size_t c = 0; c < body.materials.size(); c += 2) body.materials[c].young *= contrast;
    body.matrices = fem::assemble(body.mesh, body.materials, body.fill);
    for (const std::string& rung : element_rungs()) {
      Extreme run;
      const std::optional<double> off = off_linear(body, rung);
      run.ok = off.has_value();
      run.failure = "no rest found";
      table.add(fmt::format("1:{:g}", contrast), rung, run);
      const bool newton = rung == "stvk" || rung == "neo-hookean";
      EXPECT_TRUE(off.has_value() || (newton && contrast >= 1e3)) << rung << ", 1:" << contrast;
      if (off && !(newton && contrast >= 1e6)) {
        EXPECT_LE(*off, 1e-4) << rung << ", 1:" << contrast;
      }
    }
  }
}

TEST(Extremes, X6PoissonsRatioFromNearMinusOneToNearOneHalf) {
  ExtremesTable table("X6");
  for (double poisson : {-0.9, -0.5, 0.0, 0.3, 0.45, 0.49, 0.499, 0.4999, 0.49999}) {
    const Body body = short_bar({1e5, poisson, 1000.0}, kSlow);
    for (const std::string& rung : dynamic_rungs()) {
      const std::string setting = fmt::format("nu {:g}", poisson);
      Simulation simulation(body, still_base, 0.0, extreme_options(rung, 1.0 / 60, kWeight));
      const Extreme run = run_extreme(simulation, 1.0 / 60, 20);
      table.add(setting, rung, run);
      EXPECT_TRUE(run.ok) << rung << ", " << setting << ": " << run.failure;
      if (rung != "springs") {
        EXPECT_LE(off_linear(body, rung).value_or(1.0), 1e-4) << rung << ", " << setting;
      }
    }
  }
}

// Overdamped flesh creeps to its rest and never past it; undamped flesh under the midpoint rule keeps its
// energy.
TEST(Extremes, X7DampingFromNoneToAThousandTimesCritical) {
  ExtremesTable table("X7");
  for (double ratio : {0.0, 1e-6, 0.01, 1.0, 10.0, 1e3}) {
    const Body body = short_bar(kFirm, {ratio, 2.0});
    const int tip = vertex_at(body, {1.0, 0.0, 0.0});
    for (const std::string& rung : dynamic_rungs()) {
      const std::string setting = fmt::format("zeta {:g}", ratio);
      // Of linear flesh; the other rungs differ by the square of a sag of a thousandth.
      const double rest = static_displacement(body, gravity_force(body, kWeight))(tip, 2);
      fem::SimulationOptions options = extreme_options(rung, 1.0 / 60, kWeight);
      Simulation simulation(body, still_base, 0.0, options);
      const Extreme run = run_extreme(simulation, 1.0 / 60, 40);
      table.add(setting, rung, run);
      ASSERT_TRUE(run.ok) << rung << ", " << setting << ": " << run.failure;
      if (ratio >= 10.0) {
        EXPECT_GE(run.x(tip, 2), 1.01 * rest) << rung << ", " << setting;
      }
      if (ratio == 0.0 && rung == "blended") {
        options.integrator = Integrator::ImplicitMidpoint;
        Simulation midpoint(body, still_base, 0.0, options);
        const Extreme kept = run_extreme(midpoint, 1.0 / 60, 1000);
        EXPECT_LE(std::abs(kept.energy), 1e-9 * kept.early) << setting;  // 0 at the start
      }
    }
  }
}

TEST(Extremes, X8CellsTenThousandTimesAsLongAsTheyAreThick) {
  ExtremesTable table("X8");
  for (double aspect : {1.0, 10.0, 100.0, 1e3, 1e4}) {
    BarOptions options;
    options.box.min = {0.0, -0.25, -0.25 / aspect};
    options.box.max = {1.0, 0.25, 0.25 / aspect};
    options.box.blocks = {2, 1, 1};
    options.material = kFirm;
    options.damping = kDamped;
    const Body body = bar_body(options);
    for (const std::string& rung : dynamic_rungs()) {
      const std::string setting = fmt::format("aspect {:g}", aspect);
      const Eigen::Vector3d gravity(0.0, 0.0, -1.0 / (aspect * aspect));
      Simulation simulation(body, still_base, 0.0, extreme_options(rung, 1.0 / 60, gravity));
      const Extreme run = run_extreme(simulation, 1.0 / 60, 20);
      table.add(setting, rung, run);
      EXPECT_TRUE(run.ok) << rung << ", " << setting << ": " << run.failure;
    }
  }
}

TEST(Extremes, X9CellsSkewTaperedTwistedAndAlmostFlat) {
  ExtremesTable table("X9");
  using Map = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;
  const std::vector<std::pair<std::string, Map>> shapes{
      {"skew by 60 degrees",
       [](const Eigen::Vector3d& x) -> Eigen::Vector3d {
         return {x[0] + std::tan(60 * kDegree) * (x[2] + 0.2), x[1], x[2]};
       }},
      {"tapered ten to one",
       [](const Eigen::Vector3d& x) -> Eigen::Vector3d {
         const double s = 1.0 - 0.9 * x[0];
         return {x[0], s * x[1], s * x[2]};
       }},
      {"twisted by 45 degrees",
       [](const Eigen::Vector3d& x) -> Eigen::Vector3d {
         return Eigen::AngleAxisd(45 * kDegree * x[0], Eigen::Vector3d::UnitX()) * x;
       }},
      {"flat to a millionth", [](const Eigen::Vector3d& x) -> Eigen::Vector3d {
         return {x[0] < 0.75 && x[0] > 0.25 ? 1e-6 : x[0], x[1], x[2]};
       }}};
  for (const auto& [setting, map] : shapes) {
    BarOptions options;
    options.box.min = {0.0, -0.2, -0.2};
    options.box.max = {1.0, 0.2, 0.2};
    options.box.blocks = {2, 1, 1};
    options.material = kFirm;
    options.damping = kDamped;
    options.distort = map;
    const bool skew = setting.starts_with("skew");
    options.held = [skew](const Eigen::Vector3d& x) {
      return x[0] <= 1e-9 + (skew ? std::tan(60 * kDegree) * (x[2] + 0.2) : 0.0);
    };
    const Body body = bar_body(options);
    for (const std::string& rung : dynamic_rungs()) {
      Simulation simulation(body, still_base, 0.0, extreme_options(rung, 1.0 / 60, 0.1 * kWeight));
      const Extreme run = run_extreme(simulation, 1.0 / 60, 20);
      table.add(setting, rung, run);
      EXPECT_TRUE(run.ok) << rung << ", " << setting << ": " << run.failure;
      if (rung != "springs") {
        EXPECT_LE(off_linear(body, rung).value_or(1.0), 1e-4) << rung << ", " << setting;
      }
    }
  }
}

}  // namespace
}  // namespace sinew::tests
