#pragma once

#include <cmath>

#include <Eigen/Geometry>

/// Arithmetic whose bits do not depend on the C library: only + - * / and the square root, which IEEE 754
/// rounds correctly. The bundled samples are compared byte by byte with what the generator makes.
namespace sinew::samples {

struct SineCosine {
  double sine, cosine;
};

/// Sine and cosine of an angle [degrees] to about 1e-15.
inline SineCosine sine_cosine(double degrees) {
  constexpr double kPi = 3.14159265358979323846;
  const double x = (degrees - 360.0 * std::floor(degrees / 360.0 + 0.5)) * (kPi / 180.0) / 8.0;
  // |x| <= pi/8: the first term left out, x^17/17!, is below 1e-21. Then three doublings of the angle.
  double sine = 0.0, versine = 0.0, term = x;  // versine = 1 - cosine keeps small angles accurate
  for (int n = 1; n < 17; n += 2) {
    sine += term;
    term *= x / (n + 1);
    versine += term;
    term *= -x / (n + 2);
  }
  for (int doubling = 0; doubling < 3; ++doubling) {
    const double doubled = 2.0 * sine * (1.0 - versine);
    versine = 2.0 * sine * sine;
    sine = doubled;
  }
  return {sine, 1.0 - versine};
}

/// Rotation by `degrees` about the unit axis.
inline Eigen::Quaterniond rotation(double degrees, const Eigen::Vector3d& axis) {
  const SineCosine half = sine_cosine(0.5 * degrees);
  return Eigen::Quaterniond(half.cosine, half.sine * axis.x(), half.sine * axis.y(), half.sine * axis.z());
}

/// Nearest multiple of one micrometre [m]: absorbs the last bits of sums whose order a compiler may choose.
inline double to_grid(double x) { return std::round(x * 1e6) / 1e6; }
inline Eigen::Vector3d to_grid(const Eigen::Vector3d& p) {
  return {to_grid(p.x()), to_grid(p.y()), to_grid(p.z())};
}

}  // namespace sinew::samples
