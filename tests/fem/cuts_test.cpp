#include "fem/time/cuts.h"

#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fem/time/envelope.h"
#include "tests/fem/arm.h"

namespace sinew::fem {
namespace {

using lattice::Points;
using tests::kDegree;

/// Where the shoulder is and how far the elbow is bent.
struct Place {
  Eigen::Vector3d shoulder{0, 0, 0};  // m
  double bend = 0.0;                  // rad
  double turn = 0.0;                  // of the whole arm about y, rad
};

using Path = std::function<Place(double)>;

std::vector<Eigen::Affine3d> pose_of(const Place& place) {
  Eigen::Affine3d base(Eigen::AngleAxisd(place.turn, Eigen::Vector3d::UnitY()));
  base.pretranslate(place.shoulder);
  return tests::arm_pose(place.bend, base);
}

/// A clip of 2 s with `fps` keys a second: linear between them.
struct KeyedClip {
  std::vector<double> keys;
  Motion motion;

  KeyedClip(double fps, const Path& path) {
    for (int k = 0; k <= static_cast<int>(2.0 * fps); ++k) keys.push_back(k / fps);
    motion = [fps, path](double time) {
      const double at = std::clamp(time * fps, 0.0, 2.0 * fps);
      const double key = std::min(std::floor(at + 1e-9), 2.0 * fps - 1.0), u = at - key;
      const Place a = path(key / fps), b = path((key + 1.0) / fps);
      return pose_of({(1.0 - u) * a.shoulder + u * b.shoulder, (1.0 - u) * a.bend + u * b.bend,
                      (1.0 - u) * a.turn + u * b.turn});
    };
  }
};

class Cuts : public ::testing::Test {
 protected:
  std::vector<Cut> of(const KeyedClip& clip) const {
    return find_cuts(body_.tree, body_.size, clip.motion, clip.keys);
  }

  Body body_ = tests::arm_body(tests::make_arm(lattice::CellType::Hexahedron, 0, 3), 90.0 * kDegree);
};

/// A walk at 1.5 m/s with an arm that swings at 1 Hz.
Place walk(double time) {
  return {
      {1.5 * time, 0.03 * std::sin(4.0 * M_PI * time), 0.0}, 0.8 + 0.5 * std::sin(2.0 * M_PI * time), 0.0};
}

TEST_F(Cuts, AreFoundWhereTheBodyJumpsWithinOneOrTwoKeys) {
  for (double fps : {24.0, 30.0, 60.0}) {
    for (int frames : {1, 2}) {
      for (double way : {1.0, 3.0, 100.0}) {
        const double begin = 24.0 / fps, end = begin + frames / fps;
        const KeyedClip clip(fps, [=](double time) {
          Place place = walk(time);
          const double share = std::clamp((time - begin) / (end - begin), 0.0, 1.0);
          place.shoulder.z() += share * way;
          place.turn = share * 2.0;
          return place;
        });
        const std::vector<Cut> cuts = of(clip);
        ASSERT_EQ(cuts.size(), 1U) << fps << " " << frames << " " << way;
        // Keys are quotients of small numbers.
        EXPECT_NEAR(cuts[0].begin, begin, 1e-12);
        EXPECT_NEAR(cuts[0].end, end, 1e-12);
        // Shoulder and elbow, which the turn moves by up to 0.84 m besides.
        EXPECT_NEAR(cuts[0].way, way, 1.0);
        EXPECT_FALSE(cuts[0].stated);
      }
    }
  }
}

TEST_F(Cuts, AreFoundAtAClipsFirstAndLastKeysAndThereAndBack) {
  const auto jump_at = [](double when, double way) {
    return [=](double time) {
      Place place = walk(time);
      if (time > when - 1e-9) place.shoulder.z() += way;
      return place;
    };
  };
  ASSERT_EQ(of(KeyedClip(30.0, jump_at(1.0 / 30.0, 3.0))).size(), 1U);
  ASSERT_EQ(of(KeyedClip(30.0, jump_at(2.0, 3.0))).size(), 1U);
  // Put aside for a single key.
  const std::vector<Cut> glitch = of(KeyedClip(30.0, [](double time) {
    Place place = walk(time);
    if (std::abs(time - 1.0) < 1e-9) place.shoulder.z() += 3.0;
    return place;
  }));
  ASSERT_EQ(glitch.size(), 1U);
  EXPECT_NEAR(glitch[0].begin, 29.0 / 30.0, 1e-12);
  EXPECT_NEAR(glitch[0].end, 31.0 / 30.0, 1e-12);
}

TEST_F(Cuts, AreNotMistakenForFastMotions) {
  for (double fps : {12.0, 24.0, 30.0, 60.0, 120.0}) {
    // Off at 10 m/s from one key to the next, and stopped after 1 s as by a wall.
    EXPECT_THAT(of(KeyedClip(fps,
                             [](double time) {
                               return Place{{10.0 * std::clamp(time - 0.5, 0.0, 1.0), 0.0, 0.0}, 0.5, 0.0};
                             })),
                testing::IsEmpty())
        << fps;
    // 10 m down in free fall, then still: 14 m/s at the ground.
    EXPECT_THAT(of(KeyedClip(fps,
                             [](double time) {
                               const double fallen =
                                   std::clamp(time - 0.2, 0.0, std::sqrt(2.0 * 10.0 / 9.81));
                               return Place{{0.0, -0.5 * 9.81 * fallen * fallen, 0.0}, 0.5, 0.0};
                             })),
                testing::IsEmpty())
        << fps;
    // A blow: the forearm's end goes at 20 m/s for 0.06 s, the shoulder stays.
    EXPECT_THAT(of(KeyedClip(fps,
                             [](double time) {
                               return Place{{0, 0, 0}, 40.0 * std::clamp(time - 1.0, 0.0, 0.06), 0.0};
                             })),
                testing::IsEmpty())
        << fps;
    // A leap: to 5 m/s upwards within 0.2 s, and down to the ground again.
    EXPECT_THAT(of(KeyedClip(
                    fps,
                    [](double time) {
                      const double t = time - 0.5, flown = std::clamp(t - 0.2, 0.0, 10.0 / 9.81);
                      const double pushed = std::clamp(t, 0.0, 0.2);
                      return Place{
                          {0.0, 12.5 * pushed * pushed + 5.0 * flown - 4.905 * flown * flown, 0.0}, 0.5, 0.0};
                    })),
                testing::IsEmpty())
        << fps;
  }
  // Two keys say nothing of what is before and after.
  const Motion run = [](double time) { return pose_of({{10.0 * time, 0.0, 0.0}, 0.5, 0.0}); };
  EXPECT_THAT(find_cuts(body_.tree, body_.size, run, {0.0, 1.0 / 24.0}), testing::IsEmpty());
  EXPECT_THAT(find_cuts(body_.tree, body_.size, run, {0.0}), testing::IsEmpty());
}

TEST_F(Cuts, ThatAreStatedTakeTheKeysAroundThem) {
  const Path still = [](double) { return Place{}; };
  const KeyedClip keyed(24.0, still);
  const Cut same = stated_cut(body_.tree, keyed.motion, keyed.keys, 10.0 / 24.0, 11.0 / 24.0);
  EXPECT_EQ(same.begin, 10.0 / 24.0);
  EXPECT_EQ(same.end, 11.0 / 24.0);
  EXPECT_TRUE(same.stated);
  // From 12.9/30 to 13.9/30 s: the keys at 10/24 = 0.4167 and 12/24 = 0.5 lie outside of it.
  const Cut wider = stated_cut(body_.tree, keyed.motion, keyed.keys, 13.0 / 30.0, 14.0 / 30.0);
  EXPECT_EQ(wider.begin, 10.0 / 24.0);
  EXPECT_EQ(wider.end, 12.0 / 24.0);
  // What is interpolated over a second is a motion.
  const Cut sparse = stated_cut(body_.tree, keyed.motion, {0.0, 1.0, 2.0}, 0.5, 0.6);
  EXPECT_EQ(sparse.begin, 0.5);
  EXPECT_EQ(sparse.end, 0.6);
}

/// The arm walks, and jumps by 3 m and half a turn between two keys; the same without the jump is what its
/// flesh should do.
class ArmThatJumps : public Cuts, public ::testing::WithParamInterface<std::tuple<Integrator, const char*>> {
 protected:
  static constexpr double kFps = 24.0;
  static constexpr double kJump = 12.0 / kFps;

  static Path jumping(double way, double turn) {
    return [=](double time) {
      Place place = walk(time);
      if (time > kJump + 1e-9) {
        place.shoulder = Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()) * place.shoulder;
        place.shoulder.z() += way;
        place.turn += turn;
      }
      return place;
    };
  }

  /// Leaf positions seen from the shoulder, at 60 frames a second over 0.8 s.
  std::vector<Points> seen_from_shoulder(const KeyedClip& clip, const std::vector<Cut>& cuts) const {
    SimulationOptions options;
    options.integrator = std::get<0>(GetParam());
    options.model = std::get<1>(GetParam());
    options.cuts = cuts;
    Simulation simulation(body_, clip.motion, 0.0, options);
    EXPECT_EQ(simulation.settle().status, SimulationStatus::Ok);
    std::vector<Points> seen;
    for (int frame = 0; frame <= 48; ++frame) {
      const double time = frame / 60.0;
      EXPECT_EQ(simulation.advance_to(time).status, SimulationStatus::Ok);
      const Eigen::Affine3d to_shoulder = clip.motion(time)[0].inverse();
      const Points x = simulation.positions_at(time);
      seen.emplace_back(x.rows(), 3);
      for (Eigen::Index a = 0; a < x.rows(); ++a)
        seen.back().row(a) = (to_shoulder * x.row(a).transpose()).transpose();
    }
    return seen;
  }

  static double largest_difference(const std::vector<Points>& a, const std::vector<Points>& b) {
    double largest = 0.0;
    for (std::size_t k = 0; k < a.size(); ++k)
      largest = std::max(largest, (a[k] - b[k]).rowwise().norm().maxCoeff());
    return largest;
  }
};

TEST_P(ArmThatJumps, MovesItsFleshAlong) {
  const KeyedClip there(kFps, jumping(3.0, M_PI)), stays(kFps, jumping(0.0, 0.0));
  const std::vector<Cut> cuts = of(there);
  ASSERT_EQ(cuts.size(), 1U);
  const std::vector<Points> reference = seen_from_shoulder(stays, {});
  // No time passes in the cut for flesh that swings on without it for 1/24 s. The arm is 1.2 m long, a
  // hundredth of it is asked.
  EXPECT_LT(largest_difference(seen_from_shoulder(there, cuts), reference), 0.012);
  if (std::get<1>(GetParam()) != std::string("blended-stiffness")) return;
  // Not so long a jump that a single step shows it: the flesh was thrown.
  const KeyedClip straight(kFps, jumping(3.0, 0.0));
  EXPECT_GT(largest_difference(seen_from_shoulder(straight, {}), reference), 0.1);
}

INSTANTIATE_TEST_SUITE_P(Each, ArmThatJumps,
                         ::testing::Combine(::testing::Values(Integrator::Bdf2, Integrator::BackwardEuler),
                                            ::testing::Values("blended", "blended-stiffness",
                                                              "corotational")));

TEST_F(Cuts, GiveFleshOfASteadyMotionNoPush) {
  // The flesh of an arm that flies at 3 m/s and is weightless is at rest in it, before and after.
  const Path flight = [](double time) {
    return Place{{3.0 * time, time > 0.5 + 1e-9 ? 5.0 : 0.0, 0.0}, 0.0, 0.0};
  };
  const KeyedClip clip(24.0, flight);
  SimulationOptions options;
  options.gravity.setZero();
  options.cuts = of(clip);
  ASSERT_EQ(options.cuts.size(), 1U);
  for (double start : {0.0, 0.5, 0.52}) {  // also from within the cut
    Simulation simulation(body_, clip.motion, start, options);
    ASSERT_EQ(simulation.settle().status, SimulationStatus::Ok);
    for (double time : {0.51, 0.53, 0.6, 1.0}) {
      if (time < start) continue;
      ASSERT_EQ(simulation.advance_to(time).status, SimulationStatus::Ok);
      const Points rigid = body_.mesh.points.rowwise() + clip.motion(time)[0].translation().transpose();
      // Rounding over a hundred damped steps.
      EXPECT_LT((simulation.positions_at(time) - rigid).cwiseAbs().maxCoeff(), 1e-10) << start << " " << time;
    }
  }
}

TEST_F(Cuts, AreNoReasonToWarn) {
  const KeyedClip clip(24.0, [](double time) {
    Place place = walk(time);
    if (time > 1.0 + 1e-9) place.shoulder.z() += 3.0;
    return place;
  });
  SimulationOptions options;
  EXPECT_FALSE(outside_envelope(body_, clip.motion, options, 0.0, 239).empty());
  options.cuts = of(clip);
  EXPECT_THAT(outside_envelope(body_, clip.motion, options, 0.0, 239), testing::IsEmpty());
}

}  // namespace
}  // namespace sinew::fem
