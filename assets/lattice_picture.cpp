#include "assets/lattice_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "assets/detail/preview_scene.h"
#include "assets/detail/render_square.h"
#include "lattice/quality.h"

namespace sinew::assets {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kGap = 2;  // between the views [pixels]
constexpr double kSkinOpacity = 0.45;
const Vector3d kSkinColour(0.62, 0.40, 0.30);  // linear RGB
const Vector3d kInk(0.17, 0.20, 0.24), kWorst(0.80, 0.05, 0.05);

using Segment = std::pair<Vector3d, Vector3d>;

/// Edges of faces that one cell alone has; `in_front` where such a face looks at the eye.
struct OuterEdge {
  int a, b;
  bool in_front;
};

std::vector<OuterEdge> outer_edges(const lattice::CellComplex& complex, const lattice::Points& points,
                                   const Vector3d& eye) {
  struct Face {
    std::array<int, 4> key, vertices;
  };
  std::vector<Face> faces;
  for (const lattice::Cell& cell : complex.cells)
    for (const std::array<int, 4>& corners : lattice::cell_faces(cell.type)) {
      Face face;
      for (int k = 0; k < 4; ++k) face.vertices[k] = corners[k] < 0 ? -1 : cell.vertices[corners[k]];
      face.key = face.vertices;
      std::sort(face.key.begin(), face.key.end());
      faces.push_back(face);
    }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.key < b.key; });
  std::vector<OuterEdge> edges;
  for (std::size_t i = 0, j = 0; i < faces.size(); i = j) {
    for (j = i; j < faces.size() && faces[j].key == faces[i].key;) ++j;
    if (j != i + 1) continue;
    const std::array<int, 4>& v = faces[i].vertices;
    const Vector3d a = points.row(v[0]), b = points.row(v[1]), c = points.row(v[2]);
    const bool in_front = (b - a).cross(c - a).dot(eye - a) > 0.0;
    const int n = v[3] < 0 ? 3 : 4;
    for (int k = 0; k < n; ++k)
      edges.push_back({std::min(v[k], v[(k + 1) % n]), std::max(v[k], v[(k + 1) % n]), in_front});
  }
  // Of the two faces at an edge the one in front decides.
  std::sort(edges.begin(), edges.end(), [](const OuterEdge& x, const OuterEdge& y) {
    return std::tuple(x.a, x.b, !x.in_front) < std::tuple(y.a, y.b, !y.in_front);
  });
  edges.erase(std::unique(edges.begin(), edges.end(),
                          [](const OuterEdge& x, const OuterEdge& y) { return x.a == y.a && x.b == y.b; }),
              edges.end());
  return edges;
}

/// Colours that neighbours in a list tell apart: hues a golden section of the circle from each other.
Vector3d frame_colour(int index) {
  const double hue = std::fmod(0.61803398874989485 * index, 1.0) * 6.0;
  Vector3d colour;
  for (int c = 0; c < 3; ++c) {
    const double x = std::abs(std::fmod(hue + 2.0 * (3 - c), 6.0) - 3.0) - 1.0;
    colour[c] = 0.05 + 0.85 * std::clamp(x, 0.0, 1.0);
  }
  return colour;
}

/// One view: everything is turned about the vertical and drawn by a camera that stands still.
class View {
 public:
  View(Image& image, int left, int top, int size, const lattice::ControlLattice& lattice,
       const lattice::Surface& skin, const Eigen::Matrix3d& turn)
      : image_(image),
        left_(left),
        top_(top),
        size_(size),
        lattice_(lattice),
        skin_(skin),
        turn_(turn),
        points_(lattice.complex.points * turn.transpose()),
        stage_(detail::make_stage(points_)) {}

  void draw(const std::vector<int>& worst) const {
    draw_skin();
    const std::vector<OuterEdge> edges = outer_edges(lattice_.complex, points_, stage_.camera.eye());
    const double unit = size_ / 640.0;
    for (const OuterEdge& edge : edges)
      if (!edge.in_front) line(point(edge.a), point(edge.b), {kInk, 0.16, 1.0 * unit});
    draw_bones(unit);
    for (const OuterEdge& edge : edges)
      if (edge.in_front) line(point(edge.a), point(edge.b), {kInk, 0.55, 1.1 * unit});
    for (int c : worst) {
      const lattice::Cell& cell = lattice_.complex.cells[static_cast<std::size_t>(c)];
      for (const std::array<int, 2>& e : lattice::cell_edges(cell.type))
        line(point(cell.vertices[e[0]]), point(cell.vertices[e[1]]), {kWorst, 0.95, 2.2 * unit});
    }
  }

 private:
  Vector3d point(int v) const { return points_.row(v).transpose(); }

  void line(const Vector3d& a, const Vector3d& b, const Pen& pen) const {
    Vector2d pa, pb;
    if (!stage_.camera.project(a, pa) || !stage_.camera.project(b, pb)) return;
    const Vector2d corner(left_, top_);
    draw_line(image_, {left_, top_, left_ + size_, top_ + size_}, corner + size_ * pa, corner + size_ * pb,
              pen);
  }

  void draw_skin() const {
    const lattice::Points points = skin_.points * turn_.transpose();
    const detail::Body body = detail::make_body(points, skin_.triangles, detail::coincident(points),
                                                kSkinColour.transpose().replicate(points.rows(), 1));
    // A triangle without area far below: no ray meets it.
    lattice::Points nowhere(3, 3);
    nowhere.rowwise() = Eigen::RowVector3d(0.0, stage_.ground - 1e3 * stage_.radius, 0.0);
    lattice::Triangles one(1, 3);
    one << 0, 1, 2;
    const detail::Body nothing =
        detail::make_body(nowhere, one, {0, 0, 0}, kSkinColour.transpose().replicate(3, 1));
    // Part of the light through the skin, the rest past it.
    const auto translucent = [&](const Vector3d& direction, const detail::LightSamples& samples) -> Vector3d {
      const Vector3d through = detail::radiance(stage_, body, direction, samples).cwiseMin(1.0);
      const Vector3d past = detail::radiance(stage_, nothing, direction, samples).cwiseMin(1.0);
      return kSkinOpacity * through + (1.0 - kSkinOpacity) * past;
    };
    detail::render_square(image_, left_, top_, size_, stage_.camera, translucent);
  }

  void draw_bones(double unit) const {
    for (const lattice::LatticeBone& bone : lattice_.bones) {
      const Vector3d a = turn_ * bone.rest_start, b = turn_ * bone.rest_end;
      const double width = bone.soft ? 1.8 * unit : 4.0 * unit;
      line(a, b, {kInk, 0.8, width + 2.0 * unit});
      line(a, b, {frame_colour(bone.frame), 1.0, width});
      for (int v : bone.chain) line(point(v), point(v), {kInk, 0.9, 6.0 * unit});
      for (int v : bone.chain) line(point(v), point(v), {{0.99, 0.98, 0.94}, 1.0, 3.6 * unit});
    }
    for (const lattice::SoftFrame& frame : lattice_.soft_frames) {
      const Vector3d p = turn_ * frame.position;
      line(p, p, {kInk, 0.8, 11.0 * unit});
      line(p, p, {frame_colour(frame.frame), 1.0, 8.0 * unit});
    }
  }

  Image& image_;
  int left_, top_, size_;
  const lattice::ControlLattice& lattice_;
  const lattice::Surface& skin_;
  Eigen::Matrix3d turn_;
  lattice::Points points_;
  detail::Stage stage_;
};

std::string quality_line(const lattice::ControlLattice& lattice, const std::vector<int>& worst) {
  int hard = 0, soft = 0;
  for (const lattice::LatticeBone& bone : lattice.bones) ++(bone.soft ? soft : hard);
  std::string line = fmt::format("{} cells, {} bones on edges, {} soft", lattice.complex.cells.size(), hard,
                                 soft + static_cast<int>(lattice.soft_frames.size()));
  if (worst.empty()) return line;
  std::vector<std::string> names;
  for (int c : worst)
    names.push_back(fmt::format(
        "{} ({:.1f})", c,
        lattice::min_dihedral_degrees(lattice.complex, lattice.complex.cells[static_cast<std::size_t>(c)])));
  return line + fmt::format(".  red: smallest dihedral angles, cells {} degrees", fmt::join(names, ", "));
}

}  // namespace

void LatticePictureOptions::validate() const {
  if (tile < 64) throw std::invalid_argument(fmt::format("tile: got {}, expected at least 64", tile));
  if (worst < 0) throw std::invalid_argument(fmt::format("worst: got {}, expected at least 0", worst));
}

std::vector<int> worst_cells(const lattice::ControlLattice& lattice, int count) {
  std::vector<std::pair<double, int>> ranked;
  for (std::size_t c = 0; c < lattice.complex.cells.size(); ++c)
    ranked.emplace_back(lattice::min_dihedral_degrees(lattice.complex, lattice.complex.cells[c]),
                        static_cast<int>(c));
  std::sort(ranked.begin(), ranked.end());
  ranked.resize(std::min(ranked.size(), static_cast<std::size_t>(count)));
  std::vector<int> cells;
  for (const auto& [angle, cell] : ranked) cells.push_back(cell);
  return cells;
}

Image render_lattice(const lattice::ControlLattice& lattice, const lattice::Surface& skin,
                     const LatticePictureOptions& options) {
  options.validate();
  if (lattice.complex.cells.empty() || skin.triangles.rows() == 0)
    throw std::invalid_argument("picture of a lattice: there is no cell or no triangle");
  const int scale = std::max(options.tile / 320, 1), band = 12 * scale;
  Image image(2 * options.tile + kGap, options.tile + 2 * band);
  std::fill(image.rgb.begin(), image.rgb.end(), std::uint8_t{245});
  const std::vector<int> worst = worst_cells(lattice, options.worst);
  const Eigen::Matrix3d half_turn =
      Eigen::AngleAxisd(3.14159265358979323846, Vector3d::UnitY()).toRotationMatrix();
  for (int view = 0; view < 2; ++view)
    View(image, view * (options.tile + kGap), band, options.tile, lattice, skin,
         view == 0 ? Eigen::Matrix3d::Identity() : half_turn)
        .draw(worst);
  const Pen ink{kInk, 1.0, 0.0};
  draw_text(image, 4 * scale, 2 * scale, scale, options.caption, ink);
  draw_text(image, 4 * scale, band + options.tile + 2 * scale, scale, quality_line(lattice, worst), ink);
  return image;
}

}  // namespace sinew::assets
