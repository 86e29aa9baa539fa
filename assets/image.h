#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

/// A small picture and what is drawn on it: smooth lines, discs and text.
namespace sinew::assets {

/// 8-bit sRGB, rows from the top.
struct Image {
  /// White. Throws std::invalid_argument unless both are positive.
  Image(int width_pixels, int height_pixels);

  int width, height;
  std::vector<std::uint8_t> rgb;  ///< 3 * width * height.
};

/// What a line or a letter is drawn with.
struct Pen {
  Eigen::Vector3d colour{0, 0, 0};  ///< sRGB, each in [0, 1].
  double opacity = 1.0;             ///< in [0, 1].
  double width = 1.5;               ///< of a line, or the diameter of a disc [pixels]; text ignores it.
};

/// The part of a picture that drawing is confined to [pixels].
struct Window {
  int left, top, right, bottom;  ///< right and bottom are outside.
};

/// Smooth line between two places [pixels; the centre of the first pixel is (0.5, 0.5)]; equal ends give a
/// disc.
void draw_line(Image& image, const Window& window, const Eigen::Vector2d& a, const Eigen::Vector2d& b,
               const Pen& pen);

/// Text in a built-in 5 x 9 bitmap font, each of its dots `scale` pixels wide; (left, top) is the corner of
/// the first letter, capitals are 7 dots high. Knows ASCII letters (capitals come out small), digits and . ,
/// : - _ + = / ( ) % '; anything else leaves a gap. Returns the width drawn [pixels].
int draw_text(Image& image, int left, int top, int scale, const std::string& text, const Pen& pen);

/// The content of a PNG file.
std::string png_bytes(const Image& image);

/// Writes a PNG file. Throws IoError naming the file.
void write_png(const std::string& file, const Image& image);

}  // namespace sinew::assets
