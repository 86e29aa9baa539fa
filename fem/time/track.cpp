#include "fem/time/track.h"

#include <algorithm>
#include <cmath>

namespace sinew::fem {

using lattice::Points;

namespace {

/// Hermite's cubic at s in 0 ... 1 between y_0 and y_1 with rates f_0 and f_1, `gap` [s] apart.
Points cubic(const Points& y_0, const Points& f_0, const Points& y_1, const Points& f_1, double gap,
             double s) {
  return y_0 + s * s * (3.0 - 2.0 * s) * (y_1 - y_0) + gap * s * (1.0 - s) * ((1.0 - s) * f_0 - s * f_1);
}

}  // namespace

void Track::pass(const State& state, double reach) {
  passed_.insert(passed_.begin(), {state.time, state.x, state.v, state.a});
  const auto age = [&](std::size_t k) { return state.time - passed_[k].time; };
  // The one that lies beyond the reach, or on it but for rounding, ends the track.
  for (std::size_t k = 0; k + 1 < passed_.size(); ++k) {
    if (age(k) >= (1.0 - 1e-9) * reach) passed_.resize(k + 1);
  }
  // Gaps of half of their age: cubics across them err as little as the step that looks back over all of it.
  for (std::size_t k = 1; k + 1 < passed_.size();) {
    if (age(k + 1) - age(k - 1) <= 0.5 * age(k - 1)) {
      passed_.erase(passed_.begin() + static_cast<std::ptrdiff_t>(k));
    } else {
      ++k;
    }
  }
}

std::optional<State> Track::looking_back(const State& now, double span) const {
  const double time = now.time - span, rounding = 1e-9 * span;
  State state = now;
  double later = now.time;
  const Points *x = &now.x, *v = &now.v, *a = &now.a;  // of the later end of the gap
  for (const Passed& passed : passed_) {
    const double gap = later - passed.time;
    if (std::abs(passed.time - time) <= rounding) {
      state.x_past = passed.x;
      state.v_past = passed.v;
      return state;
    }
    if (passed.time < time) {
      const double s = (time - passed.time) / gap;
      state.x_past = cubic(passed.x, passed.v, *x, *v, gap, s);
      // Rates of v are its own, not what x says of v: that is off by as much as the error of v itself, and to
      // take it in every step would leave a method of first order.
      const bool known = passed.a.rows() > 0;
      state.v_past =
          cubic(passed.v, known ? passed.a : Points((2.0 / gap) * (*v - passed.v) - *a), *v, *a, gap, s);
      return state;
    }
    later = passed.time;
    x = &passed.x;
    v = &passed.v;
    a = &passed.a;
  }
  return std::nullopt;
}

}  // namespace sinew::fem
