#pragma once

#include <string>
#include <string_view>

namespace sinew::tools {

/// How far two results may be apart: a length, or a share of the character's height.
struct Tolerance {
  double value = 0.0;  ///< [m], or a fraction of the height [-]; > 0.
  bool of_height = false;

  double metres(double height) const { return of_height ? value * height : value; }

  friend bool operator==(const Tolerance&, const Tolerance&) = default;
};

/// "2mm", "0.5 cm", "0.002m" or "1%". Throws assets::ConfigError, opened by `where`, for a number without a
/// unit, an unknown unit and anything that is not positive.
Tolerance parse_tolerance(std::string_view text, const std::string& where);

/// "2 mm", "1 % of the height".
std::string tolerance_text(const Tolerance& tolerance);

/// A length for people: "1.23 m", "4.5 mm", "12 um", three digits.
std::string length_text(double metres);

}  // namespace sinew::tools
