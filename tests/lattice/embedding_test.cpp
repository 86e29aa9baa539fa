#include "lattice/embedding.h"

#include <stdexcept>

#include <gtest/gtest.h>

#include "tests/lattice/lattices.h"

namespace sinew::lattice {
namespace {

TEST(Embedding, ReproducesPointsInsideToRounding) {
  std::mt19937_64 rng(20);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.15)) {
    const Hierarchy hierarchy(complex, 2);
    for (int level = 1; level <= 2; ++level) {
      const LeafMesh mesh = tests::uniform_mesh(hierarchy, level);
      const Points at = tests::points_inside(mesh, 300, rng);
      const Embedding embedding = embed(mesh, at);
      EXPECT_TRUE(embedding.outside.empty()) << name;
      // The promise of embed(); the lattice is about 2 m across.
      EXPECT_LE((embedding.weights * mesh.points - at).rowwise().norm().maxCoeff(), 1e-12) << name;
      for (Eigen::Index i = 0; i < at.rows(); ++i) {
        EXPECT_GE(embedding.xi.row(i).minCoeff(), -1e-9);
        EXPECT_LE(embedding.xi.row(i).maxCoeff(), 1.0 + 1e-9);
      }
    }
  }
}

// A cell's map is that of its children, so that points are where they were with no search; cells that are not
// coarser keep their bits.
TEST(Embedding, IsCarriedToCoarserCellsExactly) {
  std::mt19937_64 rng(14);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const Hierarchy hierarchy(complex, 3);
    const LeafMesh fine = tests::uniform_mesh(hierarchy, 3);
    ActiveSet active = uniform_active_set(hierarchy, 1, {});
    for (int v = hierarchy.num_vertices(1); v < hierarchy.num_vertices(); ++v)
      active[static_cast<std::size_t>(v)] = hierarchy.points()(v, 0) > (hierarchy.level(v) == 2 ? 0.9 : 1.5);
    const LeafMesh mixed = leaf_mesh(hierarchy, active), coarse = tests::uniform_mesh(hierarchy, 1);
    const Points at = tests::points_inside(fine, 300, rng);
    const Embedding embedding = embed(fine, at);
    for (const LeafMesh& mesh : {fine, mixed, coarse}) {
      const std::vector<int> leaf_of = containing_cells(fine, mesh);
      const Embedding carried = carried_embedding(fine, embedding, mesh, leaf_of);
      EXPECT_LE((carried.weights * mesh.points - at).rowwise().norm().maxCoeff(), 1e-12) << name;
      EXPECT_GE(carried.xi.minCoeff(), -1e-9);
      EXPECT_LE(carried.xi.maxCoeff(), 1.0 + 1e-9);
      for (std::size_t i = 0; i < carried.cell.size(); ++i) {
        if (mesh.level[static_cast<std::size_t>(carried.cell[i])] < 3) continue;
        EXPECT_EQ(carried.xi.row(static_cast<Eigen::Index>(i)),
                  embedding.xi.row(static_cast<Eigen::Index>(i)));
      }
    }
    EXPECT_THROW(containing_cells(coarse, fine), std::invalid_argument);
  }
}

TEST(Embedding, GivesASharedFaceToTheCellWithTheSmallerIndex) {
  const Hierarchy hierarchy(box_lattice({{0, 0, 0}, {2, 1, 1}, {2, 1, 1}, CellType::Hexahedron, {}}), 1);
  const LeafMesh mesh = tests::uniform_mesh(hierarchy, 1);
  Points p(2, 3);
  p << 1.0, 0.3, 0.3, 1.0, 0.5, 0.5;
  const Embedding embedding = embed(mesh, p);
  for (Eigen::Index i = 0; i < 2; ++i) {
    int first = -1;
    for (int c = static_cast<int>(mesh.cells.size()) - 1; c >= 0; --c) {
      const HexCorners corners = hex_corners(mesh.points, mesh.cells[static_cast<std::size_t>(c)]);
      const Eigen::RowVector3d low = corners.colwise().minCoeff(), high = corners.colwise().maxCoeff();
      if ((p.row(i).array() >= low.array()).all() && (p.row(i).array() <= high.array()).all()) first = c;
    }
    EXPECT_EQ(embedding.cell[static_cast<std::size_t>(i)], first);
  }
}

// On either side of the face x = 1 and at several distances: from just beyond the tolerance to a hundred
// lengths.
TEST(Embedding, ReportsPointsOutsideAndExtrapolatesThem) {
  const Hierarchy hierarchy(box_lattice({{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, CellType::Hexahedron, {}}), 1);
  const LeafMesh mesh = tests::uniform_mesh(hierarchy, 1);
  Points p(6, 3);
  p << 1.0 - 1e-8, 0.5, 0.5,  // inside
      1.0 + 1e-11, 0.5, 0.5,  // on the face to within the tolerance of 1e-9 in local coordinates
      1.0 + 1e-8, 0.5, 0.5,   // just outside
      1.3, 0.6, 0.5,          // about a cell away
      -40.0, 0.5, 0.5,        // far away
      0.5, 100.0, 100.0;      // a hundred lengths away
  const Embedding embedding = embed(mesh, p);
  EXPECT_EQ(embedding.outside, (std::vector<int>{2, 3, 4, 5}));
  // The cells are cubes, so extrapolation is exact: 100 eps-sized errors times a distance of 100 cells.
  EXPECT_LE((embedding.weights * mesh.points - p).cwiseAbs().maxCoeff(), 1e-9);
  for (int cell : embedding.cell) EXPECT_GE(cell, 0);
}

TEST(Embedding, RefusesPointsThatAreNotFinite) {
  const Hierarchy hierarchy(box_lattice({}), 1);
  Points p = Points::Constant(2, 3, 0.5);
  p(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(embed(tests::uniform_mesh(hierarchy, 1), p), std::invalid_argument);
}

}  // namespace
}  // namespace sinew::lattice
