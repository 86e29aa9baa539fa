#include "lattice/hierarchy.h"

#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/lattice/lattices.h"

namespace sinew::lattice {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

// One cube: V = 8, E = 12, F = 6, C = 1, so level 1 has 27 vertices and level 2 has 125. The tetrahedron: 4 +
// 6 + 4 + 1 = 15; the wedge: 6 + 9 + 5 + 1 = 21.
TEST(Hierarchy, CountsVerticesAndCells) {
  const auto cell_of = [](CellType type) {
    CellComplex complex = box_lattice({{0, 0, 0}, {1, 1, 1}, {1, 1, 1}, type, {}});
    complex.cells.resize(1);
    return complex;
  };
  const Hierarchy cube(cell_of(CellType::Hexahedron), 2);
  EXPECT_EQ(cube.num_vertices(0), 8);
  EXPECT_EQ(cube.num_vertices(1), 27);
  EXPECT_EQ(cube.num_vertices(2), 125);
  EXPECT_EQ(cube.hexes(1).size(), 8u);
  EXPECT_EQ(cube.hexes(2).size(), 64u);
  const Hierarchy tetrahedron(cell_of(CellType::Tetrahedron), 1);
  EXPECT_EQ(tetrahedron.num_vertices() - 4, 15);  // the box's other 4 corners are unused vertices of level 0
  EXPECT_EQ(tetrahedron.hexes(1).size(), 4u);
  const Hierarchy wedge(cell_of(CellType::Wedge), 1);
  EXPECT_EQ(wedge.num_vertices() - 2, 21);
  EXPECT_EQ(wedge.hexes(1).size(), 6u);
}

TEST(Hierarchy, ChildrenFillTheirParentsAndAreNotInverted) {
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const Hierarchy hierarchy(complex, 3);
    double coarse = 0.0;
    for (const Cell& cell : complex.cells) coarse += cell_volume(complex, cell);
    for (int level = 1; level <= 3; ++level) {
      double volume = 0.0;
      for (const HexVertices& hex : hierarchy.hexes(level)) {
        const HexCorners corners = hex_corners(hierarchy.points(), hex);
        for (const auto& k : kCorners) {
          // det J has degree 2 in each coordinate: 2 x 2 x 2 Gauss points integrate it exactly.
          const double g = 0.5 / std::sqrt(3.0);
          const Eigen::Vector3d xi(k[0] ? 0.5 + g : 0.5 - g, k[1] ? 0.5 + g : 0.5 - g,
                                   k[2] ? 0.5 + g : 0.5 - g);
          const double det = trilinear_jacobian(corners, xi).determinant();
          EXPECT_GT(det, 0.0) << name;
          volume += det / 8.0;
        }
      }
      // cell_volume takes curved faces as four triangles about their mean; from level 1 on they are bilinear.
      // Interior faces cancel; those of the boundary differ at second order in the distortion, 0.1^2 per unit
      // face.
      EXPECT_NEAR(volume, coarse, 0.01 * coarse) << name << ", level " << level;
    }
  }
}

TEST(Hierarchy, ChildOfAHexahedronSitsAtItsCorner) {
  const Hierarchy hierarchy(tests::lattices_of_every_kind(0.1)[2].complex, 2);
  for (std::size_t h = 0; h < hierarchy.hexes(1).size(); ++h) {
    for (std::size_t k = 0; k < 8; ++k) {
      const HexVertices& child = hierarchy.hexes(2)[8 * h + k];
      EXPECT_THAT(child, testing::Contains(hierarchy.hexes(1)[h][k]));
    }
  }
}

TEST(Hierarchy, NewVerticesAreMeansOfTheirParents) {
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const Hierarchy hierarchy(complex, 2);
    for (int v = hierarchy.num_vertices(0); v < hierarchy.num_vertices(); ++v) {
      Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
      for (int p : hierarchy.parents(v)) {
        EXPECT_LT(hierarchy.level(p), hierarchy.level(v)) << name;
        mean += hierarchy.points().row(p) / static_cast<double>(hierarchy.parents(v).size());
      }
      EXPECT_LE((mean - hierarchy.points().row(v)).norm(), 16 * 3 * kEps) << name;  // 8 terms of size 3
    }
  }
}

TEST(Hierarchy, AnalysisAndSynthesisAreInverse) {
  std::mt19937_64 rng(1);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const Hierarchy hierarchy(complex, 3);
    const Points values = tests::random_points(hierarchy.num_vertices(), rng);
    // One mean of at most 8 values of size 1 is added and the same one taken off; on each of 3 levels the
    // error of the level before passes on.
    EXPECT_LE((synthesise(hierarchy, analyse(hierarchy, values)) - values).cwiseAbs().maxCoeff(), 32 * kEps)
        << name;
    EXPECT_LE((analyse(hierarchy, synthesise(hierarchy, values)) - values).cwiseAbs().maxCoeff(), 64 * kEps)
        << name;
  }
}

TEST(Hierarchy, DetailsVanishUnderAffineMaps) {
  std::mt19937_64 rng(2);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const Hierarchy hierarchy(complex, 3);
    const tests::Affine map(rng);
    const Points coefficients = analyse(hierarchy, map(hierarchy.points()));
    const int n = hierarchy.num_vertices(0);
    // Sums of 3 products of numbers of size 3, means of 8 of them.
    EXPECT_LE(coefficients.bottomRows(coefficients.rows() - n).cwiseAbs().maxCoeff(), 100 * kEps) << name;
    EXPECT_EQ(coefficients.topRows(n), map(hierarchy.points()).topRows(n)) << name;
  }
}

TEST(Hierarchy, FillInactiveAgreesWithSynthesisOfZeroDetails) {
  std::mt19937_64 rng(3);
  const Hierarchy hierarchy(tests::lattices_of_every_kind(0.1)[3].complex, 3);
  std::vector<std::uint8_t> is_active(static_cast<std::size_t>(hierarchy.num_vertices()), 1);
  Points coefficients = tests::random_points(hierarchy.num_vertices(), rng);
  for (int v = hierarchy.num_vertices(0); v < hierarchy.num_vertices(); ++v) {
    is_active[static_cast<std::size_t>(v)] = rng() % 3 == 0;
    if (!is_active[static_cast<std::size_t>(v)]) coefficients.row(v).setZero();
  }
  const Points expected = synthesise(hierarchy, coefficients);
  Points values = expected;
  for (int v = 0; v < hierarchy.num_vertices(); ++v) {
    if (!is_active[static_cast<std::size_t>(v)]) values.row(v).setConstant(1e9);  // must not be read
  }
  fill_inactive(hierarchy, is_active, values);
  EXPECT_EQ(values, expected);
}

TEST(Hierarchy, RefusesBadComplexes) {
  const auto message = [](const CellComplex& complex, int levels) -> std::string {
    try {
      const Hierarchy hierarchy(complex, levels);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  const CellComplex good = box_lattice({});
  EXPECT_EQ(message(good, 0), "Hierarchy: num_levels is 0, expected 1 to 6");
  EXPECT_EQ(message(good, 7), "Hierarchy: num_levels is 7, expected 1 to 6");
  CellComplex bad = good;
  bad.cells[0].vertices[3] = 8;
  EXPECT_EQ(message(bad, 1), "Hierarchy: cell 0 names vertex 8, expected 0 to 7");
  bad = good;
  bad.points.col(2).setZero();
  EXPECT_EQ(message(bad, 1), "Hierarchy: cell 0 has no positive volume");
}

}  // namespace
}  // namespace sinew::lattice
