#pragma once

#include <string>
#include <vector>

/// Implicit time integration as one stage:
///   x+ = xh + eta h v+,   M (v+ - vh) = theta h F+,
///   A = (1 + theta alpha h) M + theta eta h^2 (1 + beta/(kappa h)) K + theta eta h^2 P.
namespace sinew::fem {

enum class Integrator {
  Bdf2,           ///< second order, damps little; the default.
  BackwardEuler,  ///< first order, damps much; cannot fail.
};

struct Stage {
  double eta = 1.0;
  double theta = 1.0;
  double kappa = 1.0;
};

/// The coefficients of an integrator's stage; BDF2's start and restart use the same ones, hence the same
/// factor.
constexpr Stage stage_of(Integrator integrator) {
  return integrator == Integrator::Bdf2 ? Stage{2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0} : Stage{};
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
