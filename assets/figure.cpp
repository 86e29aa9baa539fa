#include "assets/figure.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include "assets/detail/base64.h"

namespace sinew::assets {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

template <class... Ts>
struct Overloaded : Ts... {
  using Ts::operator()...;
};
template <class... Ts>
Overloaded(Ts...) -> Overloaded<Ts...>;

std::string hex(const Vector3d& colour) {
  const auto byte = [&](int c) {
    return static_cast<int>(std::lround(255.0 * std::clamp(colour[c], 0.0, 1.0)));
  };
  return fmt::format("#{:02x}{:02x}{:02x}", byte(0), byte(1), byte(2));
}

std::string title(const std::string& tip) {
  return tip.empty() ? "" : "<title>" + html_escaped(tip) + "</title>";
}

std::string svg_line(const FigureLine& line) {
  std::string points;
  for (const Vector2d& p : line.points) points += fmt::format("{:.2f},{:.2f} ", p.x(), p.y());
  return fmt::format(
      "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{:g}\" stroke-opacity=\"{:g}\" "
      "stroke-linejoin=\"round\"/>\n",
      points, hex(line.stroke.colour), line.stroke.width, line.stroke.opacity);
}

std::string svg_disc(const FigureDisc& d) {
  const std::string paint =
      d.filled ? fmt::format("fill=\"{}\"", hex(d.colour))
               : fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"", hex(d.colour));
  return fmt::format("<circle cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"{:g}\" {}>{}</circle>\n", d.centre.x(),
                     d.centre.y(), d.radius, paint, title(d.tip));
}

std::string svg_box(const FigureBox& b) {
  return fmt::format(
      "<rect x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" fill=\"{}\">{}</rect>\n", b.min.x(),
      b.min.y(), b.max.x() - b.min.x(), b.max.y() - b.min.y(), hex(b.colour), title(b.tip));
}

std::string svg_label(const FigureText& t) {
  const char* anchor = t.anchor == TextAnchor::Left     ? "start"
                       : t.anchor == TextAnchor::Middle ? "middle"
                                                        : "end";
  return fmt::format(
      "<text x=\"{:.2f}\" y=\"{:.2f}\" font-size=\"{:g}\" text-anchor=\"{}\" fill=\"{}\" "
      "font-family=\"sans-serif\">{}</text>\n",
      t.at.x(), t.at.y(), t.size, anchor, hex(t.colour), html_escaped(t.text));
}

/// Everything in pixels of the picture.
class Painter {
 public:
  Painter(Image& image, int scale) : image_(image), scale_(scale), window_{0, 0, image.width, image.height} {}

  void operator()(const FigureLine& line) const {
    const Pen pen{line.stroke.colour, line.stroke.opacity, line.stroke.width * scale_};
    for (std::size_t i = 1; i < line.points.size(); ++i)
      draw_line(image_, window_, scale_ * line.points[i - 1], scale_ * line.points[i], pen);
  }
  void operator()(const FigureDisc& d) const {
    const Vector2d c = scale_ * d.centre;
    draw_line(image_, window_, c, c, {d.colour, 1.0, 2.0 * scale_ * d.radius});
    if (!d.filled) draw_line(image_, window_, c, c, {Vector3d::Ones(), 1.0, 2.0 * scale_ * (d.radius - 1.5)});
  }
  void operator()(const FigureBox& b) const {
    const auto edge = [&](double v, int most) {
      return std::clamp(static_cast<int>(std::lround(scale_ * v)), 0, most);
    };
    for (int y = edge(b.min.y(), image_.height); y < edge(b.max.y(), image_.height); ++y) {
      for (int x = edge(b.min.x(), image_.width); x < edge(b.max.x(), image_.width); ++x) {
        for (int c = 0; c < 3; ++c) {
          image_.rgb[static_cast<std::size_t>(3 * (y * image_.width + x) + c)] =
              static_cast<std::uint8_t>(std::lround(255.0 * b.colour[c]));
        }
      }
    }
  }
  void operator()(const FigureText& t) const {
    const Pen pen{t.colour, 1.0, 1.0};
    const int dots =
        std::max(1, static_cast<int>(std::lround(t.size * scale_ / 12.0)));  // capitals are 7 dots high
    Image scratch(1, 1);
    const int width = draw_text(scratch, 0, 0, dots, t.text, pen);
    const double shift = t.anchor == TextAnchor::Left ? 0.0 : t.anchor == TextAnchor::Middle ? 0.5 : 1.0;
    draw_text(image_, static_cast<int>(std::lround(scale_ * t.at.x() - shift * width)),
              static_cast<int>(std::lround(scale_ * t.at.y())) - 7 * dots, dots, t.text, pen);
  }

 private:
  Image& image_;
  int scale_;
  Window window_;
};

}  // namespace

std::string html_escaped(const std::string& text) {
  std::string escaped;
  for (const char letter : text) {
    if (letter == '&') {
      escaped += "&amp;";
    } else if (letter == '<') {
      escaped += "&lt;";
    } else if (letter == '>') {
      escaped += "&gt;";
    } else if (letter == '"') {
      escaped += "&quot;";
    } else {
      escaped += letter;
    }
  }
  return escaped;
}

std::string svg_text(const Figure& figure) {
  std::string text = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\">\n"
      "<rect width=\"{0}\" height=\"{1}\" fill=\"#ffffff\"/>\n",
      figure.width, figure.height);
  for (const auto& mark : figure.marks) {
    text += std::visit(Overloaded{[](const FigureLine& m) { return svg_line(m); },
                                  [](const FigureDisc& m) { return svg_disc(m); },
                                  [](const FigureBox& m) { return svg_box(m); },
                                  [](const FigureText& m) { return svg_label(m); }},
                       mark);
  }
  return text + "</svg>\n";
}

Image draw_figure(const Figure& figure, int scale) {
  Image image(scale * figure.width, scale * figure.height);
  const Painter painter(image, scale);
  for (const auto& mark : figure.marks) std::visit(painter, mark);
  return image;
}

std::string png_data_uri(const Image& image) {
  const std::string bytes = png_bytes(image);
  return "data:image/png;base64," +
         detail::encode_base64(std::vector<std::uint8_t>(bytes.begin(), bytes.end()));
}

}  // namespace sinew::assets
