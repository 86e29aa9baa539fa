#pragma once

#include <string>
#include <vector>

#include "assets/figure.h"

namespace sinew::tools::detail {

/// One axis of a plot: values on a stretch of pixels.
struct PlotAxis {
  double low = 0.0, high = 1.0;  ///< values at the ends; low < high, both > 0 where logarithmic.
  double from = 0.0, to = 1.0;   ///< pixels at the ends.
  bool logarithmic = false;

  /// Pixel of a value; values beyond the ends stay there.
  double at(double value) const;
  /// Round values to mark, ascending: three to ten of them.
  std::vector<double> ticks() const;
};

/// Widens [low, high] of values to round ends. Values <= 0 are left out where the axis is logarithmic.
PlotAxis axis_over(const std::vector<double>& values, bool logarithmic);

/// The frame of a plot: axes with ticks, labels and faint lines across.
void draw_axes(assets::Figure& figure, const PlotAxis& x, const PlotAxis& y, const std::string& x_label,
               const std::string& y_label);

}  // namespace sinew::tools::detail
