#pragma once

#include <string>
#include <variant>
#include <vector>

#include "assets/image.h"

/// Line drawings that become SVG text or a picture: plots of reports.
namespace sinew::assets {

/// What a mark is drawn with.
struct Stroke {
  Eigen::Vector3d colour{0, 0, 0};  ///< sRGB, each in [0, 1].
  double width = 1.5;               ///< [pixels].
  double opacity = 1.0;             ///< in [0, 1].
};

struct FigureLine {
  std::vector<Eigen::Vector2d> points;  ///< joined in order.
  Stroke stroke;
};
struct FigureDisc {
  Eigen::Vector2d centre{0, 0};
  double radius = 3.0;
  Eigen::Vector3d colour{0, 0, 0};
  bool filled = true;    ///< else a ring.
  std::string tip = {};  ///< shown by browsers under the pointer.
};
struct FigureBox {
  Eigen::Vector2d min{0, 0}, max{0, 0};
  Eigen::Vector3d colour{0, 0, 0};
  std::string tip = {};
};
enum class TextAnchor { Left, Middle, Right };
struct FigureText {
  Eigen::Vector2d at{0, 0};  ///< left, middle or right end of the base line.
  std::string text;
  TextAnchor anchor = TextAnchor::Left;
  double size = 12.0;  ///< height of a line [pixels].
  Eigen::Vector3d colour{0.2, 0.2, 0.2};
};

/// Marks in drawing order on a white sheet; x to the right, y down [pixels].
struct Figure {
  int width = 640, height = 400;
  std::vector<std::variant<FigureLine, FigureDisc, FigureBox, FigureText>> marks;
};

/// An <svg> element for a page; the text is escaped. Numbers do not depend on the locale.
std::string svg_text(const Figure& figure);

/// The same as a picture, `scale` pixels per unit; text comes out in the built-in font.
Image draw_figure(const Figure& figure, int scale = 2);

/// A picture as the address of an <img> that needs no file.
std::string png_data_uri(const Image& image);

/// Text for a page: & < > " as entities.
std::string html_escaped(const std::string& text);

}  // namespace sinew::assets
