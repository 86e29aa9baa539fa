#include "assets/lattice_picture.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "lattice/box.h"
#include "lattice/build.h"
#include "lattice/quality.h"
#include "tests/lattice/shapes.h"

namespace sinew::assets {
namespace {

using Eigen::Vector3d;

/// A box of tetrahedra round a ball, with one bone along a lattice edge.
struct Scene {
  lattice::ControlLattice lattice;
  lattice::Surface skin;
};
Scene make_scene() {
  Scene scene;
  scene.lattice.complex =
      lattice::box_lattice({{0, 0, 0}, {2, 2, 2}, {2, 2, 2}, lattice::CellType::Tetrahedron, {}});
  scene.skin = tests::blob({1, 1, 1}, 24, 16, [](const Vector3d&) { return 0.7; });
  const lattice::Cell& cell = scene.lattice.complex.cells.front();
  lattice::LatticeBone bone;
  bone.name = "bone";
  bone.frame = 0;
  bone.rest_start = scene.lattice.complex.points.row(cell.vertices[0]).transpose();
  bone.rest_end = scene.lattice.complex.points.row(cell.vertices[1]).transpose();
  bone.chain = {cell.vertices[0], cell.vertices[1]};
  scene.lattice.bones = {bone};
  return scene;
}

/// Pixels of a pure, strong red: nothing but the marks of the worst cells has it.
int red_pixels(const Image& image) {
  int count = 0;
  for (std::size_t i = 0; i < image.rgb.size(); i += 3)
    count += image.rgb[i] > 180 && image.rgb[i + 1] < 60 && image.rgb[i + 2] < 60;
  return count;
}

TEST(LatticePicture, MarksTheWorstCellsInRed) {
  Scene scene = make_scene();
  scene.lattice.bones.clear();  // a bone of frame 0 is red, too
  const LatticePictureOptions none{.tile = 200, .caption = "", .worst = 0},
      one{.tile = 200, .caption = "", .worst = 1};
  EXPECT_EQ(red_pixels(render_lattice(scene.lattice, scene.skin, none)), 0);
  // Six edges of about a third of the picture, two pixels wide or less: more than a hundred pixels.
  EXPECT_GT(red_pixels(render_lattice(scene.lattice, scene.skin, one)), 100);
}

TEST(LatticePicture, RanksCellsByTheirSmallestDihedralAngle) {
  Scene scene = make_scene();
  EXPECT_EQ(worst_cells(scene.lattice, 3).size(), 3u);
  const int victim = 17;
  // Flattens one cell by pulling a vertex of it near to the opposite face.
  lattice::Points& p = scene.lattice.complex.points;
  const auto& v = scene.lattice.complex.cells[victim].vertices;
  p.row(v[3]) = 0.9 * (p.row(v[0]) + p.row(v[1]) + p.row(v[2])) / 3.0 + 0.1 * p.row(v[3]);
  const int worst = worst_cells(scene.lattice, 1).front();
  for (const lattice::Cell& cell : scene.lattice.complex.cells)
    EXPECT_LE(lattice::min_dihedral_degrees(scene.lattice.complex,
                                            scene.lattice.complex.cells[static_cast<std::size_t>(worst)]),
              lattice::min_dihedral_degrees(scene.lattice.complex, cell));
  EXPECT_EQ(worst_cells(scene.lattice, 1000).size(), scene.lattice.complex.cells.size());
}

TEST(LatticePicture, HasTwoViewsAndTheSamePixelsForAnyNumberOfThreads) {
  const Scene scene = make_scene();
  const LatticePictureOptions options{.tile = 128, .caption = "ball", .worst = 2};
  const Image many = render_lattice(scene.lattice, scene.skin, options);
  EXPECT_EQ(many.width, 2 * 128 + 2);
  EXPECT_GT(many.height, 128);
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(render_lattice(scene.lattice, scene.skin, options).rgb, many.rgb);
  EXPECT_THROW(render_lattice(scene.lattice, scene.skin, {.tile = 10, .caption = "", .worst = 5}),
               std::invalid_argument);
  EXPECT_THROW(render_lattice({}, scene.skin, options), std::invalid_argument);
}

TEST(LatticePicture, PngBytesAreThoseOfTheFile) {
  const std::string bytes = png_bytes(Image(3, 2));
  EXPECT_THAT(bytes, testing::StartsWith("\x89PNG\r\n\x1a\n"));
  EXPECT_THAT(bytes, testing::HasSubstr("IEND"));
}

}  // namespace
}  // namespace sinew::assets
