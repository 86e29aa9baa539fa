#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "fem/time/simulation.h"

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

/// Of motions, from one step to the next.
inline constexpr double kTestedTurn = 90.0;          ///< of a bone [degrees].
inline constexpr double kTestedJump = kCutJump;      ///< of a bone's end, in sizes of the body [-].
inline constexpr double kTestedStretch = 10.0;       ///< length of a bone over its rest length [-].
inline constexpr double kTestedSqueeze = 0.1;        ///< the same, at the least.
inline constexpr double kTestedSqueezeOfStvk = 0.8;  ///< which buckles first and then gives up.
/// Change of a bone's velocity, in speeds of sound of the softest flesh, sqrt(E / rho) [-].
inline constexpr double kTestedJolt = 1.0;
inline constexpr double kTestedJoltOfStvk = 0.5;  ///< which the speed of sound squeezes beyond its law.

/// Weight of the softest flesh over its stiffness, rho g size / E [-]: of a heavier body linear flesh may sag
/// by a hundred of its lengths, and StVK's is squeezed below the least stretch of its law long before.
inline constexpr double kTestedWeight = 10.0;
inline constexpr double kTestedWeightOfStvk = 0.03;
/// Longest edge of a cell of the lattice over its shortest [-].
inline constexpr double kTestedAspect = 1000.0;

/// One sentence for each of these that body and motion leave, with the cell, or the bone and the time, where
/// they do so most. `steps` steps of options.step from `first` [s]; those that touch a cut move no flesh.
std::vector<std::string> outside_envelope(const Body& body, const Motion& motion,
                                          const SimulationOptions& options, double first, long steps);

}  // namespace sinew::fem
