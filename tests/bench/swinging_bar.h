#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "tests/fem/bar.h"

/// The bar that models are timed on: 1 x 0.2 x 0.2 m, E = 1e7 Pa, nu = 0.45, 3 % damping at 4 Hz, clamped at
/// a bone that swings to and fro by 60 degrees at 1 Hz. Its lowest frequency is 3.2 Hz.
namespace sinew::tests {

/// `blocks` along and across, each cut into 2^levels leaf cells.
inline fem::Body swinging_bar(int along, int across, int levels) {
  BarOptions options;
  options.box.blocks = {along, across, across};
  options.levels = levels;
  options.material = {1e7, 0.45, 1000.0};
  options.damping = {0.03, 4.0};
  return bar_body(options);
}

/// `degrees` at the height of a swing; the first quarter of a second is a start.
inline double swing(double time, double degrees) {
  return degrees * M_PI / 180.0 * std::sin(2.0 * M_PI * time) * std::min(1.0, 4.0 * time);
}

inline std::vector<Eigen::Affine3d> swinging(double time) {
  return {Eigen::Affine3d(Eigen::AngleAxisd(swing(time, 60.0), Eigen::Vector3d::UnitY()))};
}

inline int tip_of(const fem::Body& bar) { return vertex_at(bar, {1.0, 0.0, 0.0}); }

/// Root of the mean square distance of two paths of one point, as far as both go.
inline double rms_distance(const std::vector<Eigen::RowVector3d>& a,
                           const std::vector<Eigen::RowVector3d>& b) {
  double sum = 0.0;
  const std::size_t n = std::min(a.size(), b.size());
  for (std::size_t k = 0; k < n; ++k) sum += (a[k] - b[k]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(n));
}

/// Two significant digits, or whole numbers from 100 on.
inline std::string short_number(double value) {
  return value < 99.5 ? fmt::format("{:.2g}", value) : fmt::format("{:.0f}", value);
}

}  // namespace sinew::tests
