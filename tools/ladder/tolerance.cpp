#include "tools/ladder/tolerance.h"

#include <cmath>

#include <fmt/format.h>

#include "assets/error.h"
#include "tools/scene/scene_fields.h"

namespace sinew::tools {
namespace {

struct Unit {
  std::string_view name;
  double factor;
};
constexpr Unit kUnits[] = {{"um", 1e-6}, {"mm", 1e-3}, {"cm", 1e-2}, {"%", 1e-2}, {"m", 1.0}};

}  // namespace

Tolerance parse_tolerance(std::string_view text, const std::string& where) {
  for (const Unit& unit : kUnits) {
    if (!text.ends_with(unit.name)) continue;
    std::string_view number = text.substr(0, text.size() - unit.name.size());
    while (number.ends_with(' ')) number.remove_suffix(1);
    const auto value = parse_number(number);
    if (!value || !(*value > 0.0) || !std::isfinite(*value)) break;
    return {*value * unit.factor, unit.name == "%"};
  }
  throw assets::ConfigError(
      fmt::format("{}: got '{}', expected a positive length in um, mm, cm or m, or a percentage of the "
                  "height; hint: 2mm or 0.5%",
                  where, text));
}

std::string tolerance_text(const Tolerance& tolerance) {
  if (tolerance.of_height) return fmt::format("{:.4g} % of the height", 100.0 * tolerance.value);
  return length_text(tolerance.value);
}

std::string length_text(double metres) {
  const double size = std::abs(metres);
  if (size >= 0.1) return fmt::format("{:.3g} m", metres);
  if (size >= 1e-4 || size == 0.0) return fmt::format("{:.3g} mm", 1e3 * metres);
  return fmt::format("{:.3g} um", 1e6 * metres);
}

}  // namespace sinew::tools
