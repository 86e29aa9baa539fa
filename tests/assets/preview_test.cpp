#include "assets/preview.h"

#include <cmath>
#include <filesystem>
#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>
#include <tbb/global_control.h>

#include "assets/detail/preview_scene.h"
#include "assets/error.h"
#include "tests/temporary_path.h"

namespace sinew::assets {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// A box of 1 x 2 x 1 [m] standing on the ground.
struct Box {
  lattice::Points points{8, 3};
  lattice::Triangles triangles{12, 3};
  Box() {
    for (int i = 0; i < 8; ++i) points.row(i) << (i & 1) - 0.5, 2.0 * ((i >> 1) & 1), (i >> 2) - 0.5;
    triangles << 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1,
        3, 7, 1, 7, 5;
  }
};

PreviewFrame frame_of(const lattice::Points& simulated, const lattice::Points& skinned) {
  PreviewFrame frame;
  frame.simulated = simulated;
  frame.skinned = skinned;
  return frame;
}

std::vector<std::uint8_t> tile(const Image& image, int left, int top, int size) {
  std::vector<std::uint8_t> pixels;
  for (int y = top; y < top + size; ++y) {
    const auto row = image.rgb.begin() + 3 * (y * image.width + left);
    pixels.insert(pixels.end(), row, row + 3 * size);
  }
  return pixels;
}

constexpr int kTile = 64;
/// Rows of a sheet of 64-pixel tiles: a title band of 17 pixels above each.
constexpr int kTop = 17, kBottom = 2 * 17 + kTile;

TEST(Preview, ShowsEquallySpacedFramesWithBothEnds) {
  EXPECT_THAT(preview_frames(71), testing::ElementsAre(0, 10, 20, 30, 40, 50, 60, 70));
  EXPECT_THAT(preview_frames(3), testing::ElementsAre(0, 1, 2));
  EXPECT_THAT(preview_frames(1), testing::ElementsAre(0));
  EXPECT_THROW(preview_frames(0), std::invalid_argument);
}

TEST(Preview, HasOneColumnPerFrameInTwoRows) {
  const Box box;
  const Image image = render_preview(
      box.triangles, {frame_of(box.points, box.points), frame_of(box.points, box.points)}, {.tile = kTile});
  EXPECT_EQ(image.width, 2 * kTile + 2);
  EXPECT_EQ(image.height, 2 * (kTile + 17));
  // Equal bodies give equal pictures, whatever row or column they stand in.
  EXPECT_EQ(tile(image, 0, kTop, kTile), tile(image, 0, kBottom, kTile));
  EXPECT_EQ(tile(image, 0, kTop, kTile), tile(image, kTile + 2, kTop, kTile));
}

TEST(Preview, ShowsTheSimulationAboveThePlainSkinning) {
  const Box box;
  lattice::Points fat = box.points;
  fat.col(0) *= 1.4;
  const std::vector<PreviewFrame> plain = {frame_of(fat, fat)}, both = {frame_of(fat, box.points)};
  const Image same = render_preview(box.triangles, plain, {.tile = kTile});
  const Image different = render_preview(box.triangles, both, {.tile = kTile});
  // The wide box in the upper row is in the same place of both sheets but warmer where it is away from
  // skinning: less green and blue, and the lower row shows the slim box.
  double warmth_same = 0.0, warmth_different = 0.0;
  const auto a = tile(same, 0, kTop, kTile), b = tile(different, 0, kTop, kTile);
  for (std::size_t i = 0; i < a.size(); i += 3) {
    warmth_same += a[i] - 0.5 * (a[i + 1] + a[i + 2]);
    warmth_different += b[i] - 0.5 * (b[i + 1] + b[i + 2]);
  }
  EXPECT_GT(warmth_different, 1.2 * warmth_same);
  EXPECT_NE(tile(same, 0, kBottom, kTile), tile(different, 0, kBottom, kTile));
}

TEST(Preview, DoesNotDependOnTheNumberOfThreads) {
  // A wavy sheet of 20000 triangles: large enough for the ray tracer to build its tree in parallel if it
  // could.
  constexpr int kSide = 101;
  lattice::Points sheet(kSide * kSide, 3);
  lattice::Triangles triangles(2 * (kSide - 1) * (kSide - 1), 3);
  Eigen::Index t = 0;
  for (int i = 0; i < kSide * kSide; ++i) {
    const double x = 0.02 * (i % kSide), z = 0.02 * (i / kSide);
    sheet.row(i) << x, 0.1 * std::sin(7 * x) * std::cos(5 * z), z;
    if (i % kSide == kSide - 1 || i / kSide == kSide - 1) continue;
    triangles.row(t++) << i, i + kSide, i + 1;
    triangles.row(t++) << i + 1, i + kSide, i + kSide + 1;
  }
  const std::vector<PreviewFrame> frames = {frame_of(1.1 * sheet, sheet)};
  const auto render = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return render_preview(triangles, frames, {.tile = kTile}).rgb;
  };
  const auto one = render(1);
  EXPECT_EQ(one, render(2));
  EXPECT_EQ(one, render(4));
}

TEST(Preview, TakesTheColoursOfTheVertices) {
  const Box box;
  const std::vector<PreviewFrame> frames = {frame_of(box.points, box.points)};
  const Image flesh = render_preview(box.triangles, frames, {.tile = kTile});
  Rig rig;
  rig.parts.resize(1);
  rig.parts[0].points = box.points;
  rig.parts[0].role = PartRole::Simulated;
  EXPECT_EQ(render_preview(box.triangles, frames, {.tile = kTile, .colours = role_colours(rig)}).rgb,
            flesh.rgb);
  rig.parts[0].role = PartRole::Rigid;
  const Image follower = render_preview(box.triangles, frames, {.tile = kTile, .colours = role_colours(rig)});
  // In the middle of the tile stands the box: dark now.
  const std::size_t middle = static_cast<std::size_t>(3 * ((kTop + kTile / 2) * flesh.width + kTile / 2));
  EXPECT_LT(2 * follower.rgb[middle], flesh.rgb[middle]);
  EXPECT_THROW(render_preview(box.triangles, frames, {.tile = kTile, .colours = lattice::Points::Zero(7, 3)}),
               std::invalid_argument);
}

TEST(Preview, TurnsFilesWithZUpUpright) {
  const Box box;
  lattice::Points z_up = box.points;  // y to z, z to -y
  z_up.col(1) = -box.points.col(2);
  z_up.col(2) = box.points.col(1);
  EXPECT_EQ(render_preview(box.triangles, {frame_of(box.points, box.points)}, {.tile = kTile}).rgb,
            render_preview(box.triangles, {frame_of(z_up, z_up)}, {.tile = kTile, .up_axis = UpAxis::Z}).rgb);
}

TEST(Preview, RefusesWhatItCannotShow) {
  const Box box;
  EXPECT_THROW(render_preview(box.triangles, {}), std::invalid_argument);
  lattice::Points broken = box.points;
  broken(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT([&] { render_preview(box.triangles, {frame_of(broken, box.points)}); },
              testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("not finite")));
  lattice::Triangles wrong = box.triangles;
  wrong(0, 0) = 8;
  EXPECT_THROW(render_preview(wrong, {frame_of(box.points, box.points)}), std::invalid_argument);
  EXPECT_THROW(render_preview(box.triangles, {frame_of(box.points, box.points.topRows(7))}),
               std::invalid_argument);
}

TEST(PreviewCamera, ShowsEverythingAndLeavesNoMoreRoomThanItsMargins) {
  std::mt19937_64 rng(20021);
  const auto coordinate = [&](double scale) {
    return scale * (static_cast<double>(rng() % 2001) / 1000.0 - 1.0);
  };
  for (const Vector3d& size :
       {Vector3d(1, 1, 1), Vector3d(5, 0.2, 1), Vector3d(0.1, 3, 0.1), Vector3d(0.2, 0.2, 9)}) {
    lattice::Points points(200, 3);
    for (int i = 0; i < 200; ++i)
      points.row(i) << 100 + coordinate(size.x()), coordinate(size.y()), coordinate(size.z());
    const detail::Camera camera(points);
    Vector2d low(9, 9), high(-9, -9);
    for (int i = 0; i < 200; ++i) {
      Vector2d place;
      ASSERT_TRUE(camera.project(points.row(i).transpose(), place));
      low = low.cwiseMin(place);
      high = high.cwiseMax(place);
    }
    // 4 % left free on every side and 5 % more at the bottom (place.y points down); either the width or the
    // height is used up to rounding: positions of about 100 lose 14 of 53 bits more than the picture's.
    EXPECT_GE(low.minCoeff(), 0.04 - 1e-9);
    EXPECT_LE(high.x(), 0.96 + 1e-9);
    EXPECT_LE(high.y(), 0.91 + 1e-9);
    EXPECT_NEAR(std::max((high.x() - low.x()) / 0.92, (high.y() - low.y()) / 0.87), 1.0, 1e-9);
  }
}

TEST(PreviewCamera, DirectionIsTheInverseOfProjection) {
  const Box box;
  const detail::Camera camera(box.points);
  for (const Vector2d& place : {Vector2d(0.5, 0.5), Vector2d(0.1, 0.8), Vector2d(1, 0)}) {
    Vector2d back;
    ASSERT_TRUE(camera.project(camera.eye() + 3.0 * camera.direction(place), back));
    EXPECT_NEAR((back - place).norm(), 0.0, 1e-14);  // a dozen roundings of numbers near 1
  }
}

TEST(PreviewNormals, AreSmoothAcrossCopiedVerticesAndSharpOverABoxEdge) {
  // Two triangles that fold by 20 degrees along an edge whose vertices are stored twice.
  const double c = std::cos(20 * M_PI / 180), s = std::sin(20 * M_PI / 180);
  lattice::Points points(6, 3);
  points << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, -c, 0, s;
  lattice::Triangles triangles(2, 3);
  triangles << 0, 1, 2, 3, 4, 5;
  const detail::Body body =
      detail::make_body(points, triangles, detail::coincident(points), lattice::Points::Zero(6, 3));
  EXPECT_EQ(body.corner_normals.row(0), body.corner_normals.row(3));
  EXPECT_EQ(body.corner_normals.row(2), body.corner_normals.row(4));
  // A box: every corner keeps its face's normal.
  const Box box;
  const detail::Body cube = detail::make_body(box.points, box.triangles, detail::coincident(box.points),
                                              lattice::Points::Zero(8, 3));
  for (int corner = 0; corner < 3; ++corner)
    EXPECT_EQ(cube.corner_normals.row(corner), Eigen::RowVector3d(0, 0, -1));
}

TEST(Image, IsReadBackFromPngAsItWasWritten) {
  Image image(37, 11);
  std::mt19937_64 rng(5);
  for (auto& value : image.rgb) value = static_cast<std::uint8_t>(rng());
  const std::string file = tests::temporary_path("image.png");
  write_png(file, image);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  ASSERT_TRUE(png_image_begin_read_from_file(&png, file.c_str()));
  png.format = PNG_FORMAT_RGB;
  ASSERT_EQ(png.width, 37u);
  ASSERT_EQ(png.height, 11u);
  std::vector<std::uint8_t> rgb(PNG_IMAGE_SIZE(png));
  ASSERT_TRUE(png_image_finish_read(&png, nullptr, rgb.data(), 0, nullptr));
  EXPECT_EQ(rgb, image.rgb);
  std::filesystem::remove(file);
}

TEST(Image, ThatCannotBeWrittenIsAnIoErrorNamingTheFile) {
  EXPECT_THAT([] { write_png("/nonexistent/picture.png", Image(2, 2)); },
              testing::ThrowsMessage<IoError>(testing::HasSubstr("/nonexistent/picture.png")));
}

TEST(Image, LinesAreAsWideAsThePenAndStayInTheirWindow) {
  Image image(20, 20);
  draw_line(image, {0, 0, 10, 20}, {0, 10}, {20, 10}, {.width = 4.0});
  const auto value = [&](int x, int y) { return image.rgb[static_cast<std::size_t>(3 * (y * 20 + x))]; };
  for (const int y : {8, 9, 10, 11}) EXPECT_EQ(value(5, y), 0) << y;  // y = 10 +- 2
  EXPECT_EQ(value(5, 7), 255);
  EXPECT_EQ(value(5, 12), 255);
  EXPECT_EQ(value(10, 10), 255);  // outside the window
}

TEST(Image, TextAdvancesByItsGlyphsAndIsClippedAtTheEdge) {
  Image image(60, 12);
  // "i" is one dot wide and "o" four, each followed by one; a blank is three and one.
  EXPECT_EQ(draw_text(image, 0, 0, 1, "io o", {}), 2 + 5 + 4 + 5);
  EXPECT_EQ(draw_text(image, 55, -3, 2, "wwww", {}), 4 * 6 * 2);
}

}  // namespace
}  // namespace sinew::assets
