#include "tools/ladder/detail/plot_axes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace sinew::tools::detail {
namespace {

using Eigen::Vector3d;

const Vector3d kGrid(0.9, 0.9, 0.9), kInk(0.25, 0.25, 0.25);

/// 1, 2 or 5 times a power of ten, at least `value`.
double round_step(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= value * (1.0 - 1e-9)) return factor * power;
  }
  return 10.0 * power;
}

}  // namespace

double PlotAxis::at(double value) const {
  const double v = std::clamp(value, low, high);
  const double s = logarithmic ? std::log(v / low) / std::log(high / low) : (v - low) / (high - low);
  return from + s * (to - from);
}

std::vector<double> PlotAxis::ticks() const {
  std::vector<double> ticks;
  if (!logarithmic) {
    const double step = round_step((high - low) / 6.0);
    for (double k = std::ceil(low / step - 1e-9); k * step <= high + 1e-9 * (high - low); k += 1.0)
      ticks.push_back(k * step + 0.0);  // + 0: no -0
    return ticks;
  }
  const double decades = std::log10(high / low);
  for (double e = std::floor(std::log10(low)); e <= std::ceil(std::log10(high)); e += 1.0) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double value = factor * std::pow(10.0, e);
      if ((decades > 3.0 && factor > 1.0) || value < low * (1 - 1e-9) || value > high * (1 + 1e-9)) continue;
      ticks.push_back(value);
    }
  }
  return ticks;
}

PlotAxis axis_over(const std::vector<double>& values, bool logarithmic) {
  PlotAxis axis;
  axis.logarithmic = logarithmic;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double v : values) {
    if (logarithmic && !(v > 0.0)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  if (!(low <= high)) {
    low = logarithmic ? 1.0 : 0.0;
    high = logarithmic ? 10.0 : 1.0;
  }
  if (logarithmic) {
    axis.low = low / 1.5;
    axis.high = high * 1.5;
  } else {
    axis.low = std::min(0.0, low);
    axis.high = high > axis.low ? axis.low + 1.05 * (high - axis.low) : axis.low + 1.0;
  }
  return axis;
}

void draw_axes(assets::Figure& figure, const PlotAxis& x, const PlotAxis& y, const std::string& x_label,
               const std::string& y_label) {
  for (const double value : x.ticks()) {
    const double p = x.at(value);
    figure.marks.emplace_back(assets::FigureLine{{{p, y.from}, {p, y.to}}, {kGrid, 1.0, 1.0}});
    figure.marks.emplace_back(assets::FigureText{
        {p, y.from + 16.0}, fmt::format("{:g}", value), assets::TextAnchor::Middle, 11.0, kInk});
  }
  for (const double value : y.ticks()) {
    const double p = y.at(value);
    figure.marks.emplace_back(assets::FigureLine{{{x.from, p}, {x.to, p}}, {kGrid, 1.0, 1.0}});
    figure.marks.emplace_back(assets::FigureText{
        {x.from - 6.0, p + 4.0}, fmt::format("{:g}", value), assets::TextAnchor::Right, 11.0, kInk});
  }
  figure.marks.emplace_back(
      assets::FigureLine{{{x.from, y.to}, {x.from, y.from}, {x.to, y.from}}, {kInk, 1.0, 1.0}});
  figure.marks.emplace_back(assets::FigureText{
      {0.5 * (x.from + x.to), y.from + 36.0}, x_label, assets::TextAnchor::Middle, 12.0, kInk});
  figure.marks.emplace_back(
      assets::FigureText{{x.from - 40.0, y.to - 12.0}, y_label, assets::TextAnchor::Left, 12.0, kInk});
}

}  // namespace sinew::tools::detail
