#include "lattice/box.h"

#include <algorithm>
#include <map>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/lattice/lattices.h"

namespace sinew::lattice {
namespace {

std::string message(const BoxOptions& options) {
  try {
    box_lattice(options);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(BoxLattice, FillsTheBoxWithCellsOfPositiveVolume) {
  for (const auto& [type, per_block] :
       {std::pair{CellType::Hexahedron, 1}, {CellType::Wedge, 2}, {CellType::Tetrahedron, 6}}) {
    const CellComplex box = box_lattice({{-1, 0, 2}, {1, 3, 4}, {2, 3, 4}, type, {}});
    EXPECT_EQ(box.cells.size(), 24u * static_cast<unsigned>(per_block));
    EXPECT_EQ(box.points.rows(), 3 * 4 * 5);
    double volume = 0.0;
    for (const Cell& cell : box.cells) {
      EXPECT_GT(cell_volume(box, cell), 0.0);
      volume += cell_volume(box, cell);
    }
    EXPECT_NEAR(volume, 12.0, 12.0 * 144 * 1e-15);               // at most 144 rounded terms
    EXPECT_EQ(box.points.row(1), Eigen::RowVector3d(0, 0, 2));   // x fastest
    EXPECT_EQ(box.points.row(59), Eigen::RowVector3d(1, 3, 4));  // the far corner is exact
  }
}

// Each face belongs to two cells, or to one on the boundary; a mismatch of diagonals would leave interior
// faces with one owner.
TEST(BoxLattice, CellsMeetInWholeFaces) {
  std::vector<BoxOptions> boxes{tests::mixed_box()};
  for (CellType type : {CellType::Hexahedron, CellType::Wedge, CellType::Tetrahedron})
    boxes.push_back({{0, 0, 0}, {3, 2, 2}, {3, 2, 2}, type, {}});
  for (const BoxOptions& options : boxes) {
    const CellComplex box = box_lattice(options);
    std::map<std::vector<int>, int> owners;
    for (const Cell& cell : box.cells) {
      for (const auto& face : cell_faces(cell.type)) {
        std::vector<int> vertices;
        for (int k : face) {
          if (k >= 0) vertices.push_back(cell.vertices[static_cast<std::size_t>(k)]);
        }
        std::sort(vertices.begin(), vertices.end());
        ++owners[vertices];
      }
    }
    double area = 0.0;  // of the faces with one owner, each of an axis-parallel plane
    for (const auto& [face, count] : owners) {
      ASSERT_LE(count, 2);
      if (count == 2) continue;
      Eigen::Vector3d low = box.points.row(face[0]), high = low;
      for (int v : face) {
        low = low.cwiseMin(box.points.row(v).transpose());
        high = high.cwiseMax(box.points.row(v).transpose());
      }
      const Eigen::Vector3d span = high - low;
      const double rectangle = span[0] * span[1] + span[1] * span[2] + span[2] * span[0];
      area += face.size() == 3 ? 0.5 * rectangle : rectangle;
    }
    // Box 3 x 2 x 2: 32. Mixed: three unit cubes in an L: 14 unit faces.
    EXPECT_DOUBLE_EQ(area, options.types.empty() ? 32.0 : 14.0);
  }
}

TEST(BoxLattice, LeavesOutVerticesThatNoBlockUses) {
  const CellComplex mixed = box_lattice(tests::mixed_box());
  EXPECT_EQ(mixed.points.rows(), 18 - 2);
  EXPECT_EQ(mixed.cells.size(), 1u + 2u + 6u);
}

TEST(BoxLattice, RefusesWhatTakesAPyramid) {
  BoxOptions options{{0, 0, 0}, {2, 1, 1}, {2, 1, 1}, CellType::Hexahedron, {}};
  options.types = {CellType::Hexahedron, CellType::Tetrahedron};
  EXPECT_THAT(message(options),
              testing::HasSubstr("block (0, 0, 0) and block (1, 0, 0) meet in two triangles"));
  options.types = {CellType::Hexahedron, CellType::Wedge};
  EXPECT_EQ(message(options), "");
  options.blocks = {1, 1, 2};  // the same two on top of each other
  EXPECT_THAT(message(options), testing::HasSubstr("which takes a pyramid"));
}

TEST(BoxLattice, NamesTheOptionAtFault) {
  EXPECT_THAT(message({{0, 0, 0}, {1, 0, 1}, {1, 1, 1}, CellType::Wedge, {}}),
              testing::HasSubstr("max: got 0.0"));
  EXPECT_EQ(message({{0, 0, 0}, {1, 1, 1}, {1, 0, 1}, CellType::Wedge, {}}), "blocks: got 0, expected >= 1");
  EXPECT_EQ(message({{0, 0, 0}, {1, 1, 1}, {1, 2, 1}, CellType::Wedge, {CellType::Wedge}}),
            "types: got 1 of them, expected 2 or none");
}

}  // namespace
}  // namespace sinew::lattice
