#include "assets/preview.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "assets/detail/preview_scene.h"
#include "assets/detail/render_square.h"

namespace sinew::assets {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kGap = 2;             // between tiles [pixels]
constexpr double kFullTint = 0.06;  // of the rest height: distance from plain skinning that tints fully [-]
constexpr double kMostTint = 0.65;  // share of the tint's own colour where it is full
const Vector3d kFollower(0.045, 0.055, 0.075);  // linear RGB of parts that are not simulated
const Vector3d kInk(0.17, 0.20, 0.24), kPaper(0.965, 0.955, 0.94);

/// Sizes that depend on the tile's.
struct Layout {
  int tile, columns, scale, band;
  explicit Layout(int tile_pixels, std::size_t num_frames)
      : tile(tile_pixels),
        columns(static_cast<int>(num_frames)),
        scale(std::max(tile_pixels / 160, 1)),
        band(17 * scale) {}
  int width() const { return columns * tile + (columns - 1) * kGap; }
  int height() const { return 2 * (band + tile); }
  int left(int column) const { return column * (tile + kGap); }
  int top(int row) const { return row * (band + tile) + band; }
};

/// The rotation that turns the given axis up.
Eigen::Matrix3d y_up_from(UpAxis axis) {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  if (axis == UpAxis::Z) turn << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  if (axis == UpAxis::X) turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  return turn;
}

void check(const lattice::Triangles& triangles, const std::vector<PreviewFrame>& frames) {
  if (frames.empty()) throw std::invalid_argument("preview: no frame");
  const Eigen::Index n = frames.front().simulated.rows();
  if (n == 0 || triangles.rows() == 0) throw std::invalid_argument("preview: no triangles");
  if (triangles.minCoeff() < 0 || triangles.maxCoeff() >= n)
    throw std::invalid_argument("preview: a triangle names a vertex out of range");
  for (const PreviewFrame& frame : frames) {
    const std::string name = "preview: frame " + std::to_string(frame.frame);
    if (frame.simulated.rows() != n || frame.skinned.rows() != n)
      throw std::invalid_argument(name + ": every frame needs the same vertices");
    if (!frame.simulated.allFinite() || !frame.skinned.allFinite())
      throw std::invalid_argument(name + ": a coordinate is not finite");
  }
}

/// Everything the camera must see, y up.
lattice::Points all_points(const std::vector<PreviewFrame>& frames) {
  const Eigen::Index n = frames.front().simulated.rows();
  lattice::Points points(2 * n * static_cast<Eigen::Index>(frames.size()), 3);
  Eigen::Index row = 0;
  for (const PreviewFrame& frame : frames) {
    points.middleRows(row, n) = frame.simulated;
    points.middleRows(row + n, n) = frame.skinned;
    row += 2 * n;
  }
  return points;
}

lattice::Points flesh(Eigen::Index num_vertices) {
  return detail::flesh_colour().transpose().replicate(num_vertices, 1);
}

/// The colours, turned towards the tint where the points are away from plain skinning.
lattice::Points tinted(lattice::Points colours, const lattice::Points& points, const lattice::Points& skinned,
                       double height) {
  if (!(height > 0.0)) return colours;
  for (Eigen::Index v = 0; v < colours.rows(); ++v) {
    const double away = (points.row(v) - skinned.row(v)).norm() / (kFullTint * height);
    const double share = kMostTint * std::min(away, 1.0);
    colours.row(v) = (1.0 - share) * colours.row(v) + share * detail::tint_colour().transpose();
  }
  return colours;
}

void draw_bones(Image& image, int left, int top, int size, const detail::Stage& stage,
                const std::vector<std::pair<Vector3d, Vector3d>>& bones) {
  const Window window{left, top, left + size, top + size};
  const double unit = size / 320.0;
  const Pen outline{kInk, 0.35, 2.9 * unit}, core{{0.99, 0.98, 0.94}, 0.9, 1.4 * unit};
  const Pen joint_outline{kInk, 0.5, 4.8 * unit}, joint{{0.16, 0.55, 0.58}, 1.0, 3.4 * unit};
  std::vector<std::pair<Vector2d, Vector2d>> segments;
  for (const auto& [a, b] : bones) {
    Vector2d pa, pb;
    if (!stage.camera.project(a, pa) || !stage.camera.project(b, pb)) continue;
    const Vector2d corner(left, top);
    segments.emplace_back(corner + size * pa, corner + size * pb);
  }
  for (const auto& [a, b] : segments) draw_line(image, window, a, b, outline);
  for (const auto& [a, b] : segments) draw_line(image, window, a, b, core);
  for (const auto& [a, b] : segments)
    for (const Vector2d& end : {a, b}) draw_line(image, window, end, end, joint_outline);
  for (const auto& [a, b] : segments)
    for (const Vector2d& end : {a, b}) draw_line(image, window, end, end, joint);
}

int text_width(const std::string& text, int scale) {
  Image scratch(1, 1);
  return draw_text(scratch, 0, 0, scale, text, {});
}

void draw_titles(Image& image, const Layout& layout, const PreviewOptions& options) {
  const std::string& caption = options.caption;
  const Pen ink{kInk, 1.0, 0.0}, pale{kInk, 0.6, 0.0};
  const int baseline = 4 * layout.scale;
  const std::array<std::string, 2> titles = {options.upper, options.lower};
  for (int row = 0; row < 2; ++row)
    draw_text(image, 6 * layout.scale, layout.top(row) - layout.band + baseline, layout.scale,
              titles[static_cast<std::size_t>(row)], ink);
  const int caption_left = layout.width() - 6 * layout.scale - text_width(caption, layout.scale);
  const int title_end = 14 * layout.scale + text_width(titles[0], layout.scale);
  const std::string legend = "redder: farther from " + options.lower;
  if (caption_left < title_end) return;
  draw_text(image, caption_left, baseline, layout.scale, caption, pale);
  if (title_end + text_width(legend, layout.scale) + 14 * layout.scale < caption_left)
    draw_text(image, title_end, baseline, layout.scale, legend, pale);
}

void draw_labels(Image& image, const Layout& layout, int row, int column, const PreviewFrame& frame) {
  const Pen ink{kInk, 0.85, 0.0};
  const int top = layout.top(row) + layout.tile - 11 * layout.scale;
  draw_text(image, layout.left(column) + 5 * layout.scale, top, layout.scale,
            "frame " + std::to_string(frame.frame), ink);
  const std::string time = fmt::format("{:.2f} s", frame.time);
  draw_text(image, layout.left(column) + layout.tile - 5 * layout.scale - text_width(time, layout.scale), top,
            layout.scale, time, ink);
}

}  // namespace

void PreviewOptions::validate() const {
  if (tile < 64)
    throw std::invalid_argument("PreviewOptions: tile is " + std::to_string(tile) + ", expected >= 64");
}

lattice::Points role_colours(const Rig& rig) {
  lattice::Points colours = flesh(num_vertices(rig));
  const std::vector<bool> is_flesh = flesh_vertices(rig.parts, rig.props);
  for (std::size_t v = 0; v < is_flesh.size(); ++v)
    if (!is_flesh[v]) colours.row(static_cast<Eigen::Index>(v)) = kFollower.transpose();
  return colours;
}

std::vector<int> preview_frames(int num_frames, int count) {
  if (num_frames < 1 || count < 1)
    throw std::invalid_argument("preview_frames: both counts must be positive");
  const int shown = std::min(num_frames, count);
  std::vector<int> frames;
  for (int k = 0; k < shown; ++k)
    frames.push_back(
        shown == 1 ? 0
                   : static_cast<int>(std::lround(static_cast<double>(k) * (num_frames - 1) / (shown - 1))));
  return frames;
}

Image render_preview(const lattice::Triangles& triangles, const std::vector<PreviewFrame>& frames,
                     const PreviewOptions& options) {
  options.validate();
  check(triangles, frames);
  const Eigen::Matrix3d turn = y_up_from(options.up_axis);
  std::vector<PreviewFrame> turned = frames;
  for (PreviewFrame& frame : turned) {
    frame.simulated = (frame.simulated * turn.transpose()).eval();
    frame.skinned = (frame.skinned * turn.transpose()).eval();
    for (auto& [a, b] : frame.bones) {
      a = turn * a;
      b = turn * b;
    }
  }
  const detail::Stage stage = detail::make_stage(all_points(turned));
  const std::vector<int> same_place = detail::coincident(turned.front().skinned);
  const lattice::Points& first = turned.front().skinned;
  const double height = first.col(1).maxCoeff() - first.col(1).minCoeff();
  const lattice::Points base = options.colours.rows() > 0 ? options.colours : flesh(first.rows());
  if (base.rows() != first.rows() || !base.allFinite())
    throw std::invalid_argument("preview: one finite colour per vertex expected");
  const Layout layout(options.tile, frames.size());
  Image image(layout.width(), layout.height());
  for (std::size_t i = 0; i < image.rgb.size(); ++i)
    image.rgb[i] = static_cast<std::uint8_t>(std::lround(255.0 * kPaper[static_cast<Eigen::Index>(i % 3)]));
  for (int column = 0; column < layout.columns; ++column) {
    const PreviewFrame& frame = turned[static_cast<std::size_t>(column)];
    for (int row = 0; row < 2; ++row) {
      const lattice::Points& points = row == 0 ? frame.simulated : frame.skinned;
      const detail::Body body =
          detail::make_body(points, triangles, same_place, tinted(base, points, frame.skinned, height));
      detail::render_square(image, layout.left(column), layout.top(row), layout.tile, stage.camera,
                            [&](const Vector3d& direction, const detail::LightSamples& samples) {
                              return detail::radiance(stage, body, direction, samples);
                            });
      draw_bones(image, layout.left(column), layout.top(row), layout.tile, stage, frame.bones);
      draw_labels(image, layout, row, column, frame);
    }
  }
  draw_titles(image, layout, options);
  return image;
}

void write_preview(const std::string& file, const lattice::Triangles& triangles,
                   const std::vector<PreviewFrame>& frames, const PreviewOptions& options) {
  write_png(file, render_preview(triangles, frames, options));
}

}  // namespace sinew::assets
