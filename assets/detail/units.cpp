#include "assets/detail/units.h"

#include <array>
#include <cmath>

#include "assets/detail/text.h"

namespace sinew::assets::detail {

namespace {

/// A rat to a giraffe's calf: characters outside are taken for a mistake in the units.
constexpr double kMinHeight = 0.2;
constexpr double kMaxHeight = 4.0;

bool plausible(double metres) { return metres >= kMinHeight && metres <= kMaxHeight; }

}  // namespace

Eigen::Matrix3d y_up_from(UpAxis up) {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  if (up == UpAxis::Z) turn << 1, 0, 0, 0, 0, 1, 0, -1, 0;  // (x, y, z) -> (x, z, -y)
  if (up == UpAxis::X) turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;  // (x, y, z) -> (-y, x, z)
  return turn;
}

double metres_per_unit(double height, double declared, double wanted, std::vector<Finding>& findings) {
  const std::string tall = number(height) + " units tall";
  if (!(height > 0.0)) return declared > 0.0 ? declared : 1.0;
  if (wanted > 0.0) {
    findings.push_back({Finding::Severity::Info, "units-from-height", "",
                        "1 unit = " + number(wanted / height) + " m, from the given height (" + tall + ")",
                        ""});
    return wanted / height;
  }
  if (declared > 0.0 && plausible(declared * height)) return declared;
  std::array<double, 19> factors{1.0, 0.01, 0.0254, 0.1};
  for (std::size_t k = 0; k < 15; ++k) {
    // 10^-3, 10^1, 10^-4, 10^2, ... ; 0.1, 0.01 and 1 were tried before.
    const double power = static_cast<double>(k / 2);
    factors[4 + k] = k % 2 == 0 ? std::pow(10.0, -3.0 - power) : std::pow(10.0, 1.0 + power);
  }
  for (const double factor : factors) {
    if (!plausible(factor * height)) continue;
    const std::string said = declared > 0.0 ? "the file's own unit of " + number(declared) +
                                                  " m would make the "
                                                  "character " +
                                                  number(declared * height) + " m tall"
                                            : "the file states no unit";
    findings.push_back({Finding::Severity::Warning, "units-guessed", "",
                        said + "; 1 unit is taken as " + number(factor) + " m, which makes it " +
                            number(factor * height) + " m tall",
                        "state the true height with --height"});
    return factor;
  }
  findings.push_back({Finding::Severity::Warning, "units-unknown", "",
                      "no usual unit makes a character of " + number(height) + " units plausible",
                      "state the true height with --height"});
  return declared > 0.0 ? declared : 1.0;
}

}  // namespace sinew::assets::detail
