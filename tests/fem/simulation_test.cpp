#include "fem/time/simulation.h"

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "tests/fem/arm.h"
#include "tests/lattice/shapes.h"

namespace sinew::fem {
namespace {

using lattice::Points;
using tests::kDegree;

constexpr std::array<Integrator, 2> kIntegrators{Integrator::Bdf2, Integrator::BackwardEuler};

/// Root mean square distance of two sets of points.
double rms(const Points& a, const Points& b) {
  return std::sqrt((a - b).squaredNorm() / static_cast<double>(a.rows()));
}

double largest_distance(const Points& a, const Points& b) { return (a - b).rowwise().norm().maxCoeff(); }

SimulationOptions options_of(Integrator integrator, double step = 1.0 / 120.0) {
  SimulationOptions options;
  options.model = "blended";
  options.integrator = integrator;
  options.step = step;
  return options;
}

Motion held(double degrees) {
  return [degrees](double) { return tests::arm_pose(degrees * kDegree); };
}

/// The elbow bends to `degrees` within `seconds` and stays.
Motion bending(double degrees, double seconds) {
  return [=](double time) { return tests::arm_pose(degrees * kDegree * tests::smooth_step(time / seconds)); };
}

/// An arm that bends, twists and travels for ever; no two instants are alike.
std::vector<Eigen::Affine3d> restless(double time) {
  Eigen::Affine3d base(Eigen::AngleAxisd(0.5 * std::sin(2.0 * time), Eigen::Vector3d(0.0, 0.6, 0.8)));
  base.pretranslate(Eigen::Vector3d(0.3 * time, 0.1 * std::sin(7.0 * time), 0.0));
  return tests::arm_pose(1.0 + std::sin(5.0 * time), base, 0.5 * std::sin(3.0 * time));
}

/// Where the clip puts the bone point that rests at distance r from the shoulder: linear between posed
/// joints.
Eigen::Vector3d point_on_bones(const std::vector<Eigen::Affine3d>& pose, double r) {
  const auto joint = [&](std::size_t j) -> Eigen::Vector3d {
    return pose[j] * Eigen::Vector3d(0.5 * static_cast<double>(j), 0.0, 0.0);
  };
  return r < 0.5 ? (1.0 - 2.0 * r) * joint(0) + 2.0 * r * joint(1)
                 : (2.0 - 2.0 * r) * joint(1) + (2.0 * r - 1.0) * joint(2);
}

TEST(Simulation, KeepsBoneVerticesOnTheClipAtEveryFrame) {
  const tests::Arm arm = tests::make_arm();
  BodyOptions finer;
  finer.levels = 2;
  for (const Body& body : {tests::arm_body(arm, 2.0), tests::arm_body(arm, 2.0, finer)}) {
    std::vector<std::pair<int, double>> on_bones;  // vertex, distance from the shoulder
    for (int a = 0; a < body.mesh.num_vertices(); ++a) {
      const auto x = body.mesh.points.row(a);
      if (x.tail<2>().norm() < 1e-12 && x[0] > -1e-12 && x[0] < 1.0 + 1e-12) on_bones.emplace_back(a, x[0]);
    }
    ASSERT_EQ(on_bones.size(), body.mesh.vertices.size() > 2000u ? 41u : 21u);
    Simulation simulation(body, restless, 0.0, options_of(Integrator::Bdf2));
    ASSERT_EQ(simulation.settle().status, SimulationStatus::Ok);
    for (int frame = 0; frame < 6; ++frame) {
      const double time = frame / 12.0 + 0.001;  // never at the end of a step
      ASSERT_EQ(simulation.advance_to(time).status, SimulationStatus::Ok);
      const Points x = simulation.positions_at(time);
      // The bound; positions are of size 1.
      for (const auto& [vertex, r] : on_bones)
        EXPECT_LE((x.row(vertex).transpose() - point_on_bones(restless(time), r)).norm(), 1e-12);
      EXPECT_LE(simulation.measures_at(time).bone_residual, 1e-12);
    }
  }
}

TEST(Simulation, ConstantVelocityLeavesNoDeformation) {
  const Eigen::Vector3d velocity(3.0, 2.0, -1.0);
  // With a margin of empty cells the body has dropped some, and its outermost hats hang on few.
  for (int margin : {0, 2}) {
    const tests::Arm arm = tests::make_arm(lattice::CellType::Hexahedron, margin);
    const Body body = tests::arm_body(arm, 120 * kDegree);
    ASSERT_GE(body.regions.size(), 4u);
    for (double far : {0.0, 1000.0}) {
      const Motion move = [&](double time) {
        Eigen::Affine3d base = Eigen::Affine3d::Identity();
        base.translation() = far * Eigen::Vector3d(1.0, 0.5, -0.2) + time * velocity;
        return tests::arm_pose(0.0, base);
      };
      for (Integrator integrator : kIntegrators) {
        SimulationOptions options = options_of(integrator);
        options.gravity.setZero();
        Simulation simulation(body, move, 0.0, options);
        ASSERT_EQ(simulation.settle().status, SimulationStatus::Ok);
        ASSERT_EQ(simulation.advance_to(2.0).status, SimulationStatus::Ok);
        const Points rigid = body.mesh.points.rowwise() + move(2.0)[0].translation().transpose();
        // Rounding of positions, eps times the distance from the origin, over 240 damped steps; the issue
        // asks for 1e-9 (measured 9e-15 and 8e-13).
        EXPECT_LE(largest_distance(simulation.flesh().x, rigid), far > 0.0 ? 1e-11 : 1e-13) << margin;
      }
    }
  }
}

// The bent arm's flesh is strained, and travelling must not change that.
TEST(Simulation, ConstantVelocityKeepsTheShapeOfABentArm) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 90 * kDegree);
  for (Integrator integrator : kIntegrators) {
    const auto shape = [&](const Eigen::Vector3d& velocity) -> Points {
      SimulationOptions options = options_of(integrator);
      options.settle_speed = 1e-9;
      const Motion move = [&](double time) {
        Eigen::Affine3d base = Eigen::Affine3d::Identity();
        base.translation() = time * velocity;
        return tests::arm_pose(90 * kDegree, base);
      };
      Simulation simulation(body, move, 0.0, options);
      EXPECT_EQ(simulation.settle().status, SimulationStatus::Ok);
      EXPECT_EQ(simulation.advance_to(1.0).status, SimulationStatus::Ok);
      return simulation.flesh().x.rowwise() - velocity.transpose();
    };
    // Both come to rest in the same place; what settling leaves is 1e-9 m/s for a fraction of a second.
    EXPECT_LE(largest_distance(shape(Eigen::Vector3d::Zero()), shape({5.0, -2.0, 1.0})), 1e-9);
  }
}

TEST(Simulation, AHeldElbowIsAFixedPoint) {
  const tests::Arm arm = tests::make_arm();
  for (double degrees : {60.0, 120.0}) {
    const Body body = tests::arm_body(arm, degrees * kDegree);
    for (Integrator integrator : kIntegrators) {
      SimulationOptions options = options_of(integrator);
      options.settle_speed = 1e-8;
      Simulation simulation(body, held(degrees), 0.0, options);
      const SimulationReport settled = simulation.settle();
      ASSERT_LT(settled.speed, 1e-8);
      const Points x = simulation.flesh().x;
      ASSERT_EQ(simulation.advance_to(1.0).status, SimulationStatus::Ok);
      // Flesh that creeps at 1e-8 m/s and slows down within 0.1 s goes no farther than this.
      EXPECT_LE(largest_distance(simulation.flesh().x, x), 1e-9) << degrees;
      EXPECT_LE(simulation.measures_at(1.0).largest_speed, 1e-8) << degrees;
    }
  }
}

// The blended step is not passive in bent poses, which is why it wants damping (10 % by
// default). After a whip to 90 degrees and a stop the motion must die out: the kinetic energy's largest value
// in each 0.25 s is below that of the one before, to a millionth of the blow in 2 s, and the total never
// passes what the stop left.
TEST(Simulation, InAHeldPoseEnergyDoesNotGrow) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 90 * kDegree);
  for (Integrator integrator : kIntegrators) {
    Simulation simulation(body, bending(90.0, 0.3), 0.0, options_of(integrator));
    ASSERT_EQ(simulation.settle().status, SimulationStatus::Ok);
    ASSERT_EQ(simulation.advance_to(0.3).status, SimulationStatus::Ok);
    const auto total = [](const Measures& m) { return m.kinetic + m.elastic + m.potential; };
    const Measures stop = simulation.measures_at(0.3);
    EXPECT_GT(stop.kinetic, 0.3);
    double previous = std::numeric_limits<double>::infinity(), largest = 0.0;
    for (int step = 3; step <= 240; step += 3) {
      const double time = 0.3 + step / 120.0;
      ASSERT_EQ(simulation.advance_to(time).status, SimulationStatus::Ok);
      const Measures now = simulation.measures_at(time);
      EXPECT_LE(total(now), total(stop));
      largest = std::max(largest, now.kinetic);
      if (step % 30 != 0) continue;
      EXPECT_LT(largest, previous) << "within the 0.25 s before " << time;
      previous = largest;
      largest = 0.0;
    }
    EXPECT_LT(previous, 1e-6 * stop.kinetic);
  }
}

// The method's prototype showed how the held pose depends on the step: 0.1 to 0.65 % with joint regions, 1.8
// % without. Here as the rms distance, in % of the arm's length, of the pose at 1/120 s from that at 1/480 s.
// Measured with BDF2: 0.21, 0.41, 0.56 % at 60, 90, 120 degrees; 0.99 % at 120 degrees without joint regions.
TEST(Simulation, TheHeldPoseDependsOnTheStepAsPublished) {
  const tests::Arm arm = tests::make_arm();
  const auto dependence = [&](double degrees, const BodyOptions& body_options) {
    const Body body = tests::arm_body(arm, degrees * kDegree, body_options);
    const auto pose = [&](double step) -> Points {
      SimulationOptions options = options_of(Integrator::Bdf2, step);
      options.settle_speed = 1e-5;
      Simulation simulation(body, held(degrees), 0.0, options);
      EXPECT_EQ(simulation.settle().status, SimulationStatus::Ok);
      return simulation.flesh().x;
    };
    return 100.0 * rms(pose(1.0 / 120), pose(1.0 / 480));
  };
  double previous = 0.0;
  for (double degrees : {60.0, 90.0, 120.0}) {
    const double percent = dependence(degrees, {});
    EXPECT_LT(percent, 0.65) << degrees;
    EXPECT_GT(percent, previous) << degrees;
    previous = percent;
  }
  BodyOptions without;
  without.regions.joints = false;
  const double plain = dependence(120.0, without);
  EXPECT_GT(plain, previous);
  EXPECT_LT(plain, 2.5);
}

// In a straight arm all frames agree, so several regions with their rings must swing as one region does: what
// they know of each other's unknowns is a prediction, the skinned place plus the velocity relative to the
// frames.
TEST(Simulation, SeveralRegionsSwingAsOneWhereTheirFramesAgree) {
  const tests::Arm arm = tests::make_arm();
  const Body one = tests::arm_body(arm, 0.0), several = tests::arm_body(arm, 120 * kDegree);
  ASSERT_EQ(one.regions.size(), 1u);
  ASSERT_EQ(several.regions.size(), 4u);
  const auto difference = [&](int rings) {
    SimulationOptions options = options_of(Integrator::Bdf2, 1.0 / 480.0);
    options.solver.rings = rings;
    Simulation single(one, held(0.0), 0.0, options), blended(several, held(0.0), 0.0, options);
    double largest = 0.0, swing = 0.0;
    for (int step = 1; step <= 120; ++step) {
      const double time = step / 480.0;
      EXPECT_EQ(single.advance_to(time).status, SimulationStatus::Ok);
      EXPECT_EQ(blended.advance_to(time).status, SimulationStatus::Ok);
      largest = std::max(largest, largest_distance(single.flesh().x, blended.flesh().x));
      swing = std::max(swing, largest_distance(single.flesh().x, one.mesh.points));
    }
    return largest / swing;
  };
  // Measured 0.18 and 0.015 % of the swing with one and two rings; 1.6 and 0.13 % without the relative
  // velocity.
  EXPECT_LT(difference(1), 0.004);
  EXPECT_LT(difference(2), 0.0004);
}

TEST(Simulation, DoesNotDependOnTheOutputRate) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 115 * kDegree);
  const auto frames = [&](int fps) {
    Simulation simulation(body, restless, 0.0, options_of(Integrator::Bdf2));
    EXPECT_EQ(simulation.settle().status, SimulationStatus::Ok);
    std::vector<Points> at_twelfths;
    for (int frame = 0; frame <= fps; ++frame) {
      const double time = static_cast<double>(frame) / fps;
      EXPECT_EQ(simulation.advance_to(time).status, SimulationStatus::Ok);
      const Points x = simulation.positions_at(time);
      simulation.measures_at(time);  // sampling must not disturb
      if (12 * frame % fps == 0) at_twelfths.push_back(x);
    }
    return at_twelfths;
  };
  const std::vector<Points> film = frames(24), video = frames(60), odd = frames(36);
  ASSERT_EQ(film.size(), 13u);
  for (std::size_t k = 0; k < film.size(); ++k) {
    EXPECT_EQ(film[k], video[k]) << k;
    EXPECT_EQ(film[k], odd[k]) << k;
  }
}

// A joint that turns fast cuts the step into parts: 300 degrees/s are 10 degrees in 1/30 s, so a limit of 3
// makes four parts of 1/120 s. A frame that falls into an early part must be sampled there, not at the last
// part's begin.
TEST(Simulation, SamplesFramesBetweenSubSteps) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 100 * kDegree);
  const Motion motion = [](double time) { return tests::arm_pose(300.0 * kDegree * time); };
  SimulationOptions coarse = options_of(Integrator::Bdf2, 1.0 / 30.0);
  coarse.largest_turn = 3.0 * kDegree;
  Simulation parts(body, motion, 0.0, coarse), whole(body, motion, 0.0, options_of(Integrator::Bdf2));
  for (int frame = 1; frame <= 30; ++frame) {
    const double time = frame / 100.0;
    ASSERT_EQ(parts.advance_to(time).status, SimulationStatus::Ok);
    ASSERT_EQ(whole.advance_to(time).status, SimulationStatus::Ok);
    // The same steps but for the rounding of their times.
    EXPECT_LE(largest_distance(parts.positions_at(time), whole.positions_at(time)), 1e-11) << time;
  }
}

TEST(Simulation, GivesTheSameBitsForAnyNumberOfThreads) {
  const tests::Arm arm = tests::make_arm(lattice::CellType::Wedge);
  const auto state_with = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const Body body = tests::arm_body(arm, 115 * kDegree);
    Simulation simulation(body, restless, 0.0, options_of(Integrator::Bdf2));
    EXPECT_EQ(simulation.settle().status, SimulationStatus::Ok);
    EXPECT_EQ(simulation.advance_to(0.25).status, SimulationStatus::Ok);
    const State& state = simulation.flesh();
    Points all(4 * state.x.rows(), 3);
    all << state.x, state.v, state.x_past, simulation.positions_at(0.2487);
    return all;
  };
  const Points one = state_with(1);
  EXPECT_TRUE(one.allFinite());
  EXPECT_EQ(one, state_with(2));
  EXPECT_EQ(one, state_with(4));
}

std::string thrown_by(Simulation& simulation, double time) {
  try {
    static_cast<void>(simulation.advance_to(time));
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(Simulation, NamesTheJointAndTheTimeOfABadPose) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 60 * kDegree);
  const auto spoiled = [](double value, bool scale) {
    return [=](double time) {
      auto pose = tests::arm_pose(0.1 * time);
      if (time > 0.1 && scale) pose[1].linear() *= value;
      if (time > 0.1 && !scale) pose[1].translation()[1] = value;
      return pose;
    };
  };
  for (const Motion& motion : {Motion(spoiled(std::nan(""), false)), Motion(spoiled(0.0, true))}) {
    Simulation simulation(body, motion, 0.0, options_of(Integrator::Bdf2));
    // The step from 0.1 s looks at quarters of itself first.
    EXPECT_EQ(thrown_by(simulation, 0.2),
              "joint 'elbow': its transform at 0.102083 s is not finite or has no volume");
    EXPECT_NEAR(simulation.flesh().time, 0.1, 1e-12);
    EXPECT_TRUE(simulation.flesh().x.allFinite());
  }
}

TEST(Simulation, ReportsWhereAndWhenFleshDiverges) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 60 * kDegree);
  // A joint that no frame follows carries the end of the forearm's bone: not finite from 0.1 s on.
  const Motion broken = [](double time) {
    auto pose = tests::arm_pose(0.0);
    if (time > 0.1) pose[2].translation()[0] = std::nan("");
    return pose;
  };
  Simulation simulation(body, broken, 0.0, options_of(Integrator::Bdf2));
  const SimulationReport report = simulation.advance_to(1.0);
  EXPECT_EQ(report.status, SimulationStatus::Diverged);
  EXPECT_NEAR(report.time, 0.1 + 1.0 / 120.0, 1e-9);
  EXPECT_THAT(report.message,
              testing::MatchesRegex("the flesh of '.*' diverged at 0.108333 s; a smaller .*"));
}

TEST(Simulation, StopsWithinAStepWhenAsked) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 60 * kDegree);
  int asked = 0;
  Simulation simulation(body, held(30.0), 0.0, options_of(Integrator::Bdf2), [&] { return ++asked == 3; });
  const SimulationReport report = simulation.advance_to(1.0);
  EXPECT_EQ(report.status, SimulationStatus::Stopped);
  EXPECT_EQ(report.steps, 3);
  EXPECT_NEAR(simulation.flesh().time, 3.0 / 120.0, 1e-12);
}

TEST(SimulationOptions, NameTheFieldAtFault) {
  const auto message = [](const auto& change) -> std::string {
    SimulationOptions options;
    change(options);
    try {
      options.validate();
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message([](SimulationOptions&) {}), "");
  EXPECT_EQ(message([](SimulationOptions& o) { o.step = 0.0; }),
            "step: got 0.000000, expected a positive number of seconds");
  EXPECT_EQ(message([](SimulationOptions& o) { o.settle_limit = -1.0; }),
            "settle: got -1.000000, expected >= 0 s");
  EXPECT_THAT(message([](SimulationOptions& o) { o.gravity[1] = std::nan(""); }),
              testing::HasSubstr("gravity: got"));
  EXPECT_EQ(message([](SimulationOptions& o) { o.solver.rings = -1; }),
            "rings: got -1.000000, expected >= 0");
}

}  // namespace
}  // namespace sinew::fem
