#pragma once

#include <string>
#include <vector>

/// Implicit time integration as one stage:
///   x+ = xh + eta h v+,   M (v+ - vh) = theta h F+,
///   A = (1 + theta alpha h) M + theta eta h^2 (1 + beta/(kappa h)) K + theta eta h^2 P.
namespace sinew::fem {

enum class Integrator {
  Bdf2,              ///< second order, damps little; the default.
  BackwardEuler,     ///< first order, damps much; cannot fail.
  TrBdf2,            ///< two stages with one matrix; second order, the most exact of them for one region.
  ImplicitMidpoint,  ///< second order without damping, keeps the energy of a linear body; rings after a jolt.
};

struct Stage {
  double eta = 1.0;
  double theta = 1.0;
  double kappa = 1.0;
  /// Histories of two states are xh = x + look_back (x - x-), each in the frame of its own time.
  double look_back = 0.0;
  /// From the later of the two to the stage [steps].
  double reach = 1.0;
};

/// Where TR-BDF2 breaks its step, 2 - sqrt(2): both stages then have the same eta and theta, hence one factor
/// ([Bank85, sec. 3]). The forces at the begin of the first, the trapezoidal rule, are those that ended the
/// last step, M (v - v_h) / (theta h): known without being computed, and for bones what BDF2 makes of their
/// own velocities. Of the very first step it is the implicit midpoint rule over gamma h, which needs none.
inline constexpr double kTrBdf2Break = 0.58578643762690495;

/// The coefficients of an integrator's last stage; those before it have the same eta, theta and kappa, hence
/// the same factor. A start of BDF2, and the whole of the implicit midpoint rule, is one stage without
/// history to t + theta h, then extrapolated to the end of the step.
constexpr Stage stage_of(Integrator integrator) {
  constexpr double kRest = 1.0 - kTrBdf2Break;
  switch (integrator) {
    case Integrator::Bdf2:
      return {2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0, 1.0};
    case Integrator::TrBdf2:
      return {kTrBdf2Break / 2.0, kTrBdf2Break / 2.0, kTrBdf2Break / 2.0,
              kRest * kRest / (kTrBdf2Break * (2.0 - kTrBdf2Break)), kRest};
    case Integrator::ImplicitMidpoint:
      return {0.5, 0.5, 0.5, 0.0, 1.0};
    case Integrator::BackwardEuler:
      break;
  }
  return {};
}

/// Factors of M, K and P in A for a step h [s] with damping alpha [1/s], beta [s].
struct SystemFactors {
  double mass, stiffness, tie;
};
constexpr SystemFactors system_factors(const Stage& s, double h, double alpha, double beta) {
  return {1.0 + s.theta * alpha * h, s.theta * s.eta * h * h * (1.0 + beta / (s.kappa * h)),
          s.theta * s.eta * h * h};
}

}  // namespace sinew::fem
