#pragma once

#include <array>
#include <string_view>

/// The settings inside which runs end well on every rung, as the tests of extremes show: random scenes are
/// drawn from here, and what lies outside gets a warning.
namespace sinew::fem {

/// An interval of one setting, in SI units, ends included.
struct TestedRange {
  std::string_view setting;  ///< a key of scenes.
  double low = 0.0, high = 0.0;

  constexpr bool contains(double value) const { return low <= value && value <= high; }
};

inline constexpr TestedRange kTestedStep{"step", 1e-5, 0.1};                           ///< [s].
inline constexpr TestedRange kTestedYoung{"young", 1e3, 1e9};                          ///< [Pa].
inline constexpr TestedRange kTestedPoisson{"poisson", -0.5, 0.49};                    ///< [-].
inline constexpr TestedRange kTestedDensity{"density", 10.0, 1e4};                     ///< [kg/m^3].
inline constexpr TestedRange kTestedDamping{"damping", 0.05, 10.0};                    ///< [-].
inline constexpr TestedRange kTestedDampingFrequency{"damping_frequency", 1.0, 30.0};  ///< [Hz].

inline constexpr std::array kEnvelope{kTestedStep,    kTestedYoung,   kTestedPoisson,
                                      kTestedDensity, kTestedDamping, kTestedDampingFrequency};

}  // namespace sinew::fem
