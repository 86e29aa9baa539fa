#include "fem/time/track.h"

#include <gtest/gtest.h>

namespace sinew::fem {
namespace {

using lattice::Points;

/// A vertex on a cubic, its velocity and acceleration there.
State on_cubic(double time) {
  State state;
  state.time = time;
  state.x.resize(1, 3);
  state.v.resize(1, 3);
  state.x << 1.0 + time * (2.0 + time * (-3.0 + 4.0 * time)), -time * time, 0.5;
  state.v << 2.0 + time * (-6.0 + 12.0 * time), -2.0 * time, 0.0;
  state.a.resize(1, 3);
  state.a << -6.0 + 24.0 * time, -2.0, 0.0;
  return state;
}

/// Largest difference of what lies `span` before `now` from the cubic.
double error(const Track& track, const State& now, double span) {
  const std::optional<State> from = track.looking_back(now, span);
  if (!from) return std::numeric_limits<double>::infinity();
  EXPECT_TRUE(from->x == now.x && from->v == now.v);
  const State exact = on_cubic(now.time - span);
  return std::max((from->x_past - exact.x).cwiseAbs().maxCoeff(),
                  (from->v_past - exact.v).cwiseAbs().maxCoeff());
}

// A cubic lies on the cubics between any of its places: the few roundings of a sum of four terms are left.
TEST(Track, FindsCubicsAgainBetweenStatesAndAtThem) {
  Track track;
  EXPECT_FALSE(track.looking_back(on_cubic(0.0), 0.1));
  track.pass(on_cubic(0.0), 1.0);
  track.pass(on_cubic(0.5), 1.0);
  track.pass(on_cubic(0.6), 1.0);
  const State now = on_cubic(0.7);
  for (double span : {0.03, 0.1, 0.15, 0.2, 0.5, 0.69, 0.7})
    EXPECT_LT(error(track, now, span), 1e-14) << span;
  EXPECT_FALSE(track.looking_back(now, 0.71));
  // A start knows no acceleration: its quadratic is exact for velocities up to those.
  Track start;
  State rest = on_cubic(0.0);
  rest.a.resize(0, 3);
  start.pass(rest, 1.0);
  EXPECT_LT(error(start, on_cubic(0.5), 0.2), 1e-14);
  track.clear();
  EXPECT_FALSE(track.looking_back(now, 0.1));
}

// A state passed is given as it was, to the last bit, whatever the rounding of its time.
TEST(Track, GivesStatesThatWerePassedAsTheyWere) {
  Track track;
  for (int k = 0; k < 8; ++k) track.pass(on_cubic(0.1 * k), 1.0);
  const std::optional<State> from = track.looking_back(on_cubic(0.8), 0.1);
  ASSERT_TRUE(from);
  EXPECT_TRUE(from->x_past == on_cubic(0.1 * 7).x);
}

// A thousand steps of a thousandth of the reach: a dozen states span all of it, and those far back lie as far
// apart as a step that looks back to them is long.
TEST(Track, ReachesBackWithAHandfulOfStates) {
  Track track;
  for (int k = 0; k < 5000; ++k) track.pass(on_cubic(1e-3 * k), 1.0);
  const State now = on_cubic(5.0);
  for (double span : {0.001, 0.002, 0.0105, 0.1, 0.7654, 1.0})
    EXPECT_LT(error(track, now, span), 1e-10) << span;
  EXPECT_FALSE(track.looking_back(now, 2.0));
  EXPECT_LE(track.size(), 30U);
  // Nothing is kept that no step asks for.
  Track even;
  for (int k = 0; k < 100; ++k) even.pass(on_cubic(0.1 * k), 0.1);
  EXPECT_LE(even.size(), 2U);
}

}  // namespace
}  // namespace sinew::fem
