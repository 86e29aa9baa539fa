#include "assets/detail/units.h"

#include <array>
#include <cmath>

#include "assets/detail/text.h"

namespace sinew::assets::detail {

namespace {

struct Range {
  double least, most;  ///< [m]
  bool contains(double metres) const { return metres >= least && metres <= most; }
};

/// A bee to the largest beast of any film: outside even a standard is not believed.
constexpr Range kStandard{0.01, 100.0};
/// A rat to a horse. What files state of their own accord is believed no further: humans of 5 and 8 m are
/// common in FBX.
constexpr Range kUsual{0.2, 4.0};

}  // namespace

Eigen::Matrix3d y_up_from(UpAxis up) {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  if (up == UpAxis::Z) turn << 1, 0, 0, 0, 0, 1, 0, -1, 0;  // (x, y, z) -> (x, z, -y)
  if (up == UpAxis::X) turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;  // (x, y, z) -> (-y, x, z)
  return turn;
}

double metres_per_unit(const BodySize& body, const DeclaredUnit& declared, double wanted,
                       std::vector<Finding>& findings) {
  if (!(body.longest > 0.0)) return declared.metres > 0.0 ? declared.metres : 1.0;
  if (wanted > 0.0 && body.height > 0.0) {
    findings.push_back({Finding::Severity::Info, "units-from-height", "",
                        "1 unit = " + number(wanted / body.height) + " m, from the given height (" +
                            number(body.height) + " units tall)",
                        ""});
    return wanted / body.height;
  }
  const Range& believed = declared.by_standard ? kStandard : kUsual;
  if (declared.metres > 0.0 && believed.contains(declared.metres * body.longest)) return declared.metres;
  std::array<double, 19> factors{1.0, 0.01, 0.0254, 0.1};
  for (std::size_t k = 0; k < 15; ++k) {
    // 10^-3, 10^1, 10^-4, 10^2, ... ; 0.1, 0.01 and 1 were tried before.
    const double power = static_cast<double>(k / 2);
    factors[4 + k] = k % 2 == 0 ? std::pow(10.0, -3.0 - power) : std::pow(10.0, 1.0 + power);
  }
  const char* remedy = "state the true height with `height`";
  for (const double factor : factors) {
    if (!kUsual.contains(factor * body.longest)) continue;
    const std::string said = declared.metres > 0.0 ? "the file's own unit of " + number(declared.metres) +
                                                         " m would make the character's longest side " +
                                                         number(declared.metres * body.longest) + " m"
                                                   : "the file states no unit";
    findings.push_back({Finding::Severity::Warning, "units-guessed", "",
                        said + "; 1 unit is taken as " + number(factor) + " m, which makes it " +
                            number(factor * body.longest) + " m long and " + number(factor * body.height) +
                            " m tall",
                        remedy});
    return factor;
  }
  findings.push_back({Finding::Severity::Warning, "units-unknown", "",
                      "no usual unit makes a character of " + number(body.longest) + " units plausible",
                      remedy});
  return declared.metres > 0.0 ? declared.metres : 1.0;
}

}  // namespace sinew::assets::detail
