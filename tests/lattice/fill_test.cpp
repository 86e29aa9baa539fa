#include "lattice/fill.h"

#include <numeric>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/lattice/lattices.h"

namespace sinew::lattice {
namespace {

double filled_volume(const LeafMesh& mesh, const std::vector<FillFractions>& fill) {
  double volume = 0.0;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const HexCorners corners = hex_corners(mesh.points, mesh.cells[c]);
    const double cell = (corners.row(6) - corners.row(0)).cwiseAbs().prod();  // a box, its axes permuted
    volume += cell * std::accumulate(fill[c].begin(), fill[c].end(), 0.0) / 8.0;
  }
  return volume;
}

/// Surface of the axis-parallel box [low, high], outward.
Surface box_surface(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  Surface s;
  s.points.resize(8, 3);
  for (int k = 0; k < 8; ++k) {
    for (int c = 0; c < 3; ++c)
      s.points(k, c) = kCorners[static_cast<std::size_t>(k)][static_cast<std::size_t>(c)] ? high[c] : low[c];
  }
  s.triangles.resize(12, 3);
  int t = 0;
  for (const auto& face : cell_faces(CellType::Hexahedron)) {
    s.triangles.row(t++) << face[0], face[1], face[2];
    s.triangles.row(t++) << face[0], face[2], face[3];
  }
  return s;
}

TEST(FillFractions, OfASphereAddUpToItsVolume) {
  const Surface sphere = tests::blob({0.03, 0.02, -0.01}, 48, 96, [](const Eigen::Vector3d&) { return 0.8; });
  const SurfaceQuery query(sphere.points, sphere.triangles);
  for (int blocks : {2, 4}) {
    const Hierarchy hierarchy(
        box_lattice({{-1, -1, -1}, {1, 1, 1}, Eigen::Vector3i::Constant(blocks), CellType::Hexahedron, {}}),
        1);
    const LeafMesh mesh = tests::uniform_mesh(hierarchy, 1);
    const double volume = filled_volume(mesh, fill_fractions(mesh, query, 0.0));
    const double exact = 4.0 / 3.0 * std::numbers::pi * 0.512;
    // Samples stand d = 2 / (8 blocks) apart. Counting lattice points in a ball errs by about the square root
    // of the number of samples cut by the surface, 4 pi r^2 / d^2, times d^3: 0.7 % and 0.17 % of the volume;
    // the inscribed polyhedron lacks 0.2 %. Twice that.
    const double error = std::abs(volume / exact - 1.0);
    EXPECT_LT(error, blocks == 2 ? 0.018 : 0.0075);
  }
}

// The box's faces run through the middle between two layers of samples, so the share is exact in each octant.
TEST(FillFractions, OfABoxAreExact) {
  const Surface box = box_surface({0.0, 0.0, 0.0}, {0.75, 1.0, 0.5});
  const SurfaceQuery query(box.points, box.triangles);
  const Hierarchy hierarchy(box_lattice({{-1, -1, -1}, {1, 1, 1}, {2, 2, 2}, CellType::Hexahedron, {}}), 1);
  const LeafMesh mesh = tests::uniform_mesh(hierarchy, 1);
  const std::vector<FillFractions> fill = fill_fractions(mesh, query, 0.0);
  EXPECT_NEAR(filled_volume(mesh, fill), 0.375, 1e-14);  // rounding of 512 distances
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const HexCorners corners = hex_corners(mesh.points, mesh.cells[c]);
    for (int k = 0; k < 8; ++k) {
      // Octant k: the box between the cell's centre and its corner k.
      const Eigen::RowVector3d centre = corners.colwise().mean();
      const Eigen::RowVector3d low = corners.row(k).cwiseMin(centre), high = corners.row(k).cwiseMax(centre);
      const Eigen::RowVector3d overlap =
          (high.cwiseMin(Eigen::RowVector3d(0.75, 1.0, 0.5)) - low.cwiseMax(0.0)).cwiseMax(0.0);
      EXPECT_NEAR(fill[c][static_cast<std::size_t>(k)], overlap.prod() / (high - low).prod(), 1e-14);
    }
  }
}

// A closed body is as heavy as it is, however it lies in the cells and whatever the shell.
TEST(FillFractions, OfATurnedBarAddUpToItsVolume) {
  std::mt19937_64 rng(20021);
  for (const int across : {1, 2, 3}) {
    const Hierarchy hierarchy(
        box_lattice(
            {{-4, -4, -4}, {4, 4, 4}, Eigen::Vector3i::Constant(8 * across), CellType::Hexahedron, {}}),
        1);
    const LeafMesh mesh = tests::uniform_mesh(hierarchy, 1);
    for (int place = 0; place < (across == 1 ? 8 : 3); ++place) {
      Surface bar = box_surface({-2.5, -0.5, -0.5}, {2.5, 0.5, 0.5});
      const Eigen::Vector3d axis = tests::uniform_point(rng, -1, 1).normalized();
      const Eigen::Affine3d turned = Eigen::Translation3d(tests::uniform_point(rng, -0.5, 0.5)) *
                                     Eigen::AngleAxisd(tests::uniform(rng, 0.0, 3.0), axis);
      for (Eigen::Index v = 0; v < 8; ++v)
        bar.points.row(v) = (turned * Eigen::Vector3d(bar.points.row(v).transpose())).transpose();
      const SurfaceQuery query(bar.points, bar.triangles);
      std::vector<FillFractions> fill = fill_fractions(mesh, query, 0.03 / across);
      fill_grazed_octants(mesh, sample_triangles(bar.points, bar.triangles, 0.125 / across).points, fill);
      // The plane of a face is exact in the mean; at edges it is not, and the floor of grazed octants adds.
      EXPECT_NEAR(filled_volume(mesh, fill), 5.0, 0.01 * 5.0) << across << " across, place " << place;
    }
  }
}

TEST(FillFractions, GiveAnOpenSheetTheThicknessOfItsShell) {
  Surface sheet;
  sheet.points.resize(4, 3);
  sheet.points << -2, -2, 0, 2, -2, 0, 2, 2, 0, -2, 2, 0;
  sheet.triangles.resize(2, 3);
  sheet.triangles << 0, 1, 2, 0, 2, 3;
  const SurfaceQuery query(sheet.points, sheet.triangles);
  const Hierarchy hierarchy(box_lattice({{-1, -1, -1}, {1, 1, 1}, {1, 1, 2}, CellType::Hexahedron, {}}), 1);
  const LeafMesh mesh = tests::uniform_mesh(hierarchy, 1);
  // Samples lie at odd multiples of 1/16 from the sheet: 1/16 and 3/16 are within 0.2, so 0.5 of thickness is
  // filled.
  EXPECT_DOUBLE_EQ(filled_volume(mesh, fill_fractions(mesh, query, 0.2)), 4.0 * 0.5);
}

TEST(SampleTriangles, LeavesNoPointOfATriangleFartherThanTheSpacing) {
  Points points(3, 3);
  points << 0, 0, 0, 3, 0, 0, 0, 1, 0.5;
  Triangles triangles(1, 3);
  triangles << 0, 1, 2;
  const Points samples = sample_triangles(points, triangles, 0.1).points;
  for (double a = 0.0; a <= 1.0; a += 0.05) {
    for (double b = 0.0; a + b <= 1.0; b += 0.05) {
      const Eigen::RowVector3d p = (1 - a - b) * points.row(0) + a * points.row(1) + b * points.row(2);
      EXPECT_LE((samples.rowwise() - p).rowwise().norm().minCoeff(), 0.1);
    }
  }
}

TEST(GrazedOctants, AreThoseThatHoldASampleOfTheSkin) {
  const Hierarchy hierarchy(box_lattice({{0, 0, 0}, {2, 2, 2}, {1, 1, 1}, CellType::Hexahedron, {}}), 1);
  const LeafMesh mesh = tests::uniform_mesh(hierarchy, 1);  // eight cells of size 1
  Points sample(1, 3);
  sample << 0.25, 0.75, 1.25;
  std::vector<FillFractions> fill(mesh.cells.size(), FillFractions{});
  fill[3].fill(0.5);
  fill_grazed_octants(mesh, sample, fill);
  int raised = 0;
  for (std::size_t c = 0; c < fill.size(); ++c) {
    for (std::size_t k = 0; k < 8; ++k) {
      if (c == 3) {
        EXPECT_EQ(fill[c][k], 0.5);
      }
      if (fill[c][k] != kGrazedFill) continue;
      ++raised;
      // The octant's middle: half-way between the cell's middle and its corner k.
      const HexCorners corners = hex_corners(mesh.points, mesh.cells[c]);
      const Eigen::RowVector3d middle = 0.5 * (corners.colwise().mean() + corners.row(static_cast<int>(k)));
      EXPECT_LE((middle - sample.row(0)).cwiseAbs().maxCoeff(), 0.25);
    }
  }
  EXPECT_EQ(raised, 1);
}

TEST(FilledCells, KeepsCellsWithFleshOrWithAnEmbeddedPoint) {
  std::vector<FillFractions> fill(4, FillFractions{});
  fill[1][5] = 0.125;
  EXPECT_EQ(filled_cells(fill, {}), (std::vector<std::uint8_t>{0, 1, 0, 0}));
  EXPECT_EQ(filled_cells(fill, {3, 3, -1}), (std::vector<std::uint8_t>{0, 1, 0, 1}));
}

}  // namespace
}  // namespace sinew::lattice
