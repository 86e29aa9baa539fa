// Steps from tenths of microseconds to days, steps that change all the time, and time that stands still.

#include <random>

#include "tests/extremes/extremes.h"

namespace sinew::tests {
namespace {

const std::vector<Integrator> kDamping{Integrator::Bdf2, Integrator::BackwardEuler, Integrator::TrBdf2};

// The bar's lowest mode swings at 2 Hz: a dozen steps of a second and more see the static answer only.
TEST(Extremes, X1StepsFromTenthsOfMicrosecondsToDays) {
  ExtremesTable table("X1",
                      "Steps of 1e-7 to 1e6 s; the static answer to 1e-6 of the length from two periods on.");
  const Body body = short_bar(kFirm, kDamped);
  for (const std::string& rung : dynamic_rungs()) {
    const Points rest = rest_of(body, rung, kWeight);
    for (Integrator integrator : kDamping) {
      for (double step : {1e-7, 1e-5, 1e-3, 1.0 / 240, 1.0 / 60, 1.0 / 24, 1.0, 1e3, 1e6}) {
        const Extreme run =
            run_extreme({body, still_base, extreme_options(rung, step, kWeight, integrator), 12, 0.0});
        table.add(fmt::format("{:.4g} s, {}", step, name_of(integrator)), rung, run);
        if (step >= 1.0) table.at_most("off the static answer", distance(run.x, rest), 1e-6);
        table.note("growth of energy", run.growth);
      }
    }
  }
}

/// u and v of the linear bar, let go at rest under a weight, at a time: the sum over all its modes, each with
/// Rayleigh damping.
std::pair<Points, Points> exact_fall(const Body& body, const Modes& modes, const Eigen::Vector3d& gravity,
                                     double time) {
  const Eigen::VectorXd pull =
      modes.shape.transpose() * restricted(modes.system, gravity_force(body, gravity));
  Eigen::VectorXd u(pull.size()), v(pull.size());
  for (Eigen::Index k = 0; k < pull.size(); ++k) {
    const double w = modes.omega[k], decay = 0.5 * (body.damping.alpha() + body.damping.beta() * w * w);
    // q'' + 2 decay q' + w^2 q = p with both roots, real or complex, of s^2 + 2 decay s + w^2.
    const std::complex<double> root = std::sqrt(std::complex<double>(decay * decay - w * w)),
                               a = -decay + root, b = -decay - root;
    const std::complex<double> ea = std::exp(a * time), eb = std::exp(b * time);
    const double rest = pull[k] / (w * w);
    u[k] = rest * (1.0 - ((a * eb - b * ea) / (a - b))).real();
    v[k] = rest * (a * b * (ea - eb) / (a - b)).real();
  }
  return {leaf_values(modes.system, modes.shape * u), leaf_values(modes.system, modes.shape * v)};
}

// What a step of 1e-7 s moves is less than the last digits of where the flesh is: after ten thousand of them
// velocities and displacements are those of the modes all the same. Half the difference of a fall down and
// one up is linear to the square of the strain, 1e-10.
TEST(Extremes, X1TenThousandStepsOfATenthOfAMicrosecond) {
  ExtremesTable table("X1-tiny", "Steps of 1e-7 s: round-off of 1e-6 after 1e4 steps.");
  table.excuse("backward-euler",
               "its own error of first order is 1e-4 here; the two of second order show the round-off");
  table.excuse("springs", "their stiffness and so their modes are others");
  const Body body = short_bar(kFirm, {0.001, 2.0});
  const Modes modes = modes_of(body);
  const double step = 1e-7;
  const int steps = kNightly ? 10'000 : 1'000;
  const Eigen::Vector3d gravity = 10.0 * kWeight;
  const auto [u, v] = exact_fall(body, modes, gravity, steps * step);
  // Places of 1 m lose up to half of their last digit, 1e-16 m, in every step, and always the same way while
  // the step hardly changes: over 1e4 steps 2e-7 of the displacement, over 1e3 ten times that.
  const double places = kNightly ? 1e-6 : 1e-5;
  for (const std::string& rung : element_rungs()) {
    for (Integrator integrator : {Integrator::Bdf2, Integrator::TrBdf2}) {
      const Extreme down =
          run_extreme({body, still_base, extreme_options(rung, step, gravity, integrator), steps});
      const Extreme up =
          run_extreme({body, still_base, extreme_options(rung, step, -gravity, integrator), steps});
      table.add(fmt::format("{} steps, {}", steps, name_of(integrator)), rung, down);
      table.at_most("velocity off the modes", distance(0.5 * (down.v - up.v), v) / largest(v), 1e-6);
      table.at_most("displacement off the modes", distance(0.5 * (down.x - up.x), u) / largest(u), places);
    }
  }
}

// The error after one period of the lowest mode, against steps of T/1280: its slope from T/40 to T/80 is the
// integrator's order, with T/20 the largest step that still sees the swing.
TEST(Extremes, X1OrderOfStepsUpToATwentiethOfThePeriod) {
  ExtremesTable table("X1-order", "The integrator's order up to steps of a twentieth of the lowest period.");
  const Body body = short_bar(kFirm, {0.02, 2.0});
  const Modes modes = modes_of(body);
  const double period = 2.0 * M_PI / modes.omega[0];
  const Points velocity = 0.1 / largest(modes.at_leaves(0)) * modes.at_leaves(0);
  for (const std::string& rung : dynamic_rungs()) {
    for (Integrator integrator : kDamping) {
      const auto end = [&](int parts) {
        const SimulationOptions options = extreme_options(rung, period / parts, kNoWeight, integrator);
        return run_extreme({body, still_base, options, parts, 0.0, velocity});
      };
      const Extreme exact = end(kNightly ? 2560 : 1280);
      std::vector<double> error;
      for (int parts : {20, 40, 80}) {
        const Extreme run = end(parts);
        table.add(fmt::format("T/{}, {}", parts, name_of(integrator)), rung, run);
        error.push_back(distance(run.x, exact.x));
        table.note("error", error.back());
      }
      const double order = integrator == Integrator::BackwardEuler ? 1.0 : 2.0;
      table.at_most("order missing from T/40 to T/80", order - std::log2(error[1] / error[2]), 0.2);
      table.at_most("and from T/20 to T/40", order - std::log2(error[0] / error[1]), 0.4);
    }
  }
}

// A second frame, on which nothing hangs, spins by a whole turn in one step and hardly in the next, at
// random: the steps of the bar are cut into up to 32 parts and made whole again all the time, and nothing
// else changes.
TEST(Extremes, X2StepsThatChangeAllTheTime) {
  ExtremesTable table("X2-halved",
                      "Steps that change at random: not more than three times the error of the largest.");
  Body body = short_bar(kFirm, kDamped);
  fem::Frame spinner = body.tree.frames[0];
  spinner.joint = 1;
  body.tree.frames.push_back(spinner);
  body.tree.frame_of_joint.push_back(1);
  body.weights.conservativeResize(body.weights.rows(), 2);
  const double step = 1.0 / 240;
  const int steps = kNightly ? 1000 : 100;
  std::mt19937_64 rng(20'021);
  std::vector<double> turned_by{0.0};  // after every step [rad]
  for (int k = 0; k < steps; ++k)
    turned_by.push_back(turned_by.back() + 14.0 * kDegree * std::exp2(rng() % 6));
  const auto base = [](double time) {
    return Eigen::Affine3d(Eigen::AngleAxisd(0.3 * std::sin(9.0 * time) + 0.1 * std::sin(31.0 * time + 1.0),
                                             Eigen::Vector3d::UnitY()));
  };
  const Motion steady = [&](double time) -> std::vector<Eigen::Affine3d> {
    return {base(time), Eigen::Affine3d::Identity()};
  };
  const Motion restless = [&](double time) -> std::vector<Eigen::Affine3d> {
    const double at = std::clamp(time / step, 0.0, static_cast<double>(steps) - 1e-9);
    const auto k = static_cast<std::size_t>(at);
    const double angle = turned_by[k] + (at - static_cast<double>(k)) * (turned_by[k + 1] - turned_by[k]);
    return {base(time), Eigen::Affine3d(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX()))};
  };
  for (const std::string& rung : dynamic_rungs()) {
    for (Integrator integrator : {Integrator::Bdf2, Integrator::TrBdf2}) {
      const auto end = [&](const Motion& motion, int parts) {
        const SimulationOptions options = extreme_options(rung, step / parts, kWeight, integrator);
        return run_extreme({body, motion, options, steps * parts});
      };
      const Extreme exact = end(steady, 4), whole = end(steady, 1), changing = end(restless, 1);
      table.add(name_of(integrator), rung, changing);
      table.note("parts of a step, mean", static_cast<double>(changing.steps) / steps);
      EXPECT_GT(changing.steps, 4 * steps);
      table.at_most("error over that of whole steps",
                    distance(changing.x, exact.x) / distance(whole.x, exact.x), 3.0);
    }
  }
}

/// Steps of 1, 10 or 100 hundredths of the longest, each a tenth or ten times the one before, at random.
/// Every so often they add up to a multiple of the longest.
struct RandomSteps {
  std::vector<int> hundredths;
  std::vector<int> whole_at;  ///< numbers of steps after which the sum is a multiple of 100.
};
RandomSteps random_steps(int count, int checks) {
  std::mt19937_64 rng(20'021);
  RandomSteps steps;
  int sum = 0, now = 100;
  const auto take = [&](int next) {
    steps.hundredths.push_back(now = next);
    sum += next;
  };
  for (int check = 1; check <= checks; ++check) {
    while (static_cast<int>(steps.hundredths.size()) < count * check / checks)
      take(now == 100 ? 10 : now == 1 ? 10 : rng() % 2 == 0 ? 1 : 100);
    while (sum % 10 != 0) take(1);
    while (sum % 100 != 0) take(10);
    steps.whole_at.push_back(static_cast<int>(steps.hundredths.size()));
  }
  return steps;
}

TEST(Extremes, X2StepsATenthOrTenTimesTheOneBefore) {
  ExtremesTable table("X2",
                      "Steps changed by a factor of 10 at random, every time: not more than three times "
                      "the error of the longest alone.");
  const Body body = short_bar(kFirm, kDamped);
  const double longest = 1.0 / 240;
  const RandomSteps steps = random_steps(kNightly ? 1000 : 200, 8);
  const Motion motion = [](double time) -> std::vector<Eigen::Affine3d> {
    return {Eigen::Affine3d(Eigen::AngleAxisd(0.3 * std::sin(9.0 * time) + 0.1 * std::sin(31.0 * time + 1.0),
                                              Eigen::Vector3d::UnitY()))};
  };
  for (const std::string& rung : dynamic_rungs()) {
    for (Integrator integrator : kDamping) {
      const auto simulation = [&](double step) {
        return Simulation(body, motion, 0.0, extreme_options(rung, step, kWeight, integrator));
      };
      Simulation changing = simulation(longest), whole = simulation(longest),
                 exact = simulation(longest / 16);
      double error = 0.0, error_of_whole = 0.0;
      std::size_t k = 0;
      Extreme run;
      double time = 0.0, seconds = 0.0;
      for (int until : steps.whole_at) {
        for (; k < static_cast<std::size_t>(until); ++k) {
          const double step = steps.hundredths[k] / 100.0 * longest;
          changing.set_step(step);
          seconds += run.seconds;
          run = run_extreme(changing, step, 1);
          if (!run.ok) break;
          time += step;
        }
        if (!run.ok) break;
        const auto to = [&](Simulation& s) {
          EXPECT_EQ(s.advance_to(time - 1e-3 * longest / 16).status, fem::SimulationStatus::Ok);
          EXPECT_NEAR(s.flesh().time, time, 1e-9);
          return s.flesh().x;
        };
        const Points x = to(exact);
        error_of_whole = std::max(error_of_whole, distance(to(whole), x));
        error = std::max(error, distance(changing.flesh().x, x));
      }
      run.seconds += seconds;
      table.add(name_of(integrator), rung, run);
      table.note("error of the longest step", error_of_whole);
      table.at_most("error over it", error / error_of_whole, 3.0);
    }
  }
}

// Sound crosses a cell of 0.25 m, at 32 m/s, in 8 ms.
TEST(Extremes, X28StepsThatSoundCrossesThousandsOfCellsIn) {
  ExtremesTable table("X28",
                      "Steps in which sound crosses 1e-3 to 1e4 cells: stable, and energy never grows.");
  const Body body = short_bar(kFirm, kDamped);
  for (double cells : {1e-3, 1.0, 100.0, 1e4}) {
    const double step = cells * 0.25 / 32.0;
    for (const std::string& rung : dynamic_rungs()) {
      const Extreme run = run_extreme({body, still_base, extreme_options(rung, step, kWeight), 30, 0.0});
      table.add(fmt::format("{:g} cells", cells), rung, run);
      table.at_most("growth of energy", run.growth, 1e-6);
      table.at_most("rise over the least before", run.rise, 1e-6);
    }
  }
}

TEST(Extremes, X35TimeThatStandsStill) {
  ExtremesTable table("X35",
                      "Keys that fall on one instant, and frames without duration: nothing divides by 0.");
  const Body body = short_bar(kFirm, kDamped);
  // A clip whose keys fall on one instant: a jump, and nothing else ever.
  const Motion motion = [](double time) -> std::vector<Eigen::Affine3d> {
    Eigen::Affine3d base = Eigen::Affine3d::Identity();
    if (time >= 0.1) base.translation()[2] = 0.05;
    return {base};
  };
  for (const std::string& rung : dynamic_rungs()) {
    Simulation simulation(body, motion, 0.0, extreme_options(rung, kFrame, kWeight));
    table.add("a key on the same instant", rung, run_extreme(simulation, kFrame, 12));
    ASSERT_EQ(simulation.advance_to(0.21).status, fem::SimulationStatus::Ok);
    const Points x = simulation.positions_at(0.21);
    for (int k = 0; k < 3; ++k) {
      const fem::SimulationReport report = simulation.advance_to(0.21);
      EXPECT_EQ(report.steps, 0);
      EXPECT_TRUE(x == simulation.positions_at(0.21)) << rung;
    }
  }
}

}  // namespace
}  // namespace sinew::tests
