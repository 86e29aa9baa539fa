#pragma once

#include <numbers>

/// Isotropic elastic materials and damping given as a ratio.
namespace sinew::fem {

/// Linear isotropic material.
struct Material {
  double young = 1e5;       ///< E [Pa]; > 0.
  double poisson = 0.45;    ///< nu [-]; in (-1, 0.5).
  double density = 1000.0;  ///< rho [kg/m^3]; > 0.

  /// Shear modulus mu [Pa].
  double mu() const { return young / (2.0 * (1.0 + poisson)); }
  /// First Lame parameter lambda [Pa].
  double lambda() const { return young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)); }
  /// Bulk modulus kappa_b = lambda + 2 mu / 3 [Pa].
  double bulk() const { return lambda() + 2.0 * mu() / 3.0; }
};

/// Damping as a ratio zeta at a frequency f0, half by mass, half by stiffness:
/// alpha = zeta w0, beta = zeta / w0, w0 = 2 pi f0; the ratio at f0 is (alpha/w0 + beta w0)/2 = zeta.
struct Damping {
  double ratio = 0.1;      ///< zeta [-]; >= 0.
  double frequency = 3.0;  ///< f0 [Hz]; > 0.

  double alpha() const { return ratio * 2.0 * std::numbers::pi * frequency; }   ///< [1/s]
  double beta() const { return ratio / (2.0 * std::numbers::pi * frequency); }  ///< [s]
};

}  // namespace sinew::fem
