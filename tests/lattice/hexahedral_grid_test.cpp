// The last resort: a plain grid of cubes with soft bones.
#include "lattice/detail/hexahedral_grid.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lattice/build.h"
#include "lattice/limb_copies.h"
#include "tests/lattice/limbs.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

BuildOptions grid_options(int cells) {
  BuildOptions options;
  options.cells = cells;
  options.construction = Construction::Grid;
  return options;
}

/// Cubes in which p lies, by comparing coordinates.
std::vector<int> cubes_at(const CellComplex& complex, const Vector3d& p, double slack) {
  std::vector<int> cubes;
  for (int c = 0; c < static_cast<int>(complex.cells.size()); ++c) {
    const auto& v = complex.cells[c].vertices;
    const Vector3d low = complex.points.row(v[0]).transpose(), high = complex.points.row(v[6]).transpose();
    if (((p - low).array() >= -slack).all() && ((high - p).array() >= -slack).all()) cubes.push_back(c);
  }
  return cubes;
}

TEST(HexahedralGrid, HoldsRandomCharacters) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 rng(seed);
    const tests::Character character = tests::random_character(rng);
    const int wanted = seed % 2 == 0 ? 60 : 400;
    const BuildResult result = build(character.skin, character.joints, grid_options(wanted));
    EXPECT_THAT(result.failures, testing::IsEmpty());
    EXPECT_TRUE(result.lattice.is_grid);
    EXPECT_NO_THROW(validate(result.lattice));
    EXPECT_NEAR(result.lattice.quality.min_dihedral_degrees, 90.0, 1e-6);  // acos near 1 halves the digits
    EXPECT_NEAR(result.lattice.quality.min_scaled_jacobian, 1.0, 1e-9);
    const auto doubles = std::count_if(result.lattice.copies.begin(), result.lattice.copies.end(),
                                       [](const CellCopy& copy) { return copy.cell != copy.place; });
    const double cubes =
        static_cast<double>(result.lattice.complex.cells.size()) - static_cast<double>(doubles);
    EXPECT_NEAR(cubes, wanted, 0.12 * wanted);
    for (const LatticeBone& bone : result.lattice.bones) EXPECT_TRUE(bone.soft) << bone.name;
    const LimbCopies copies(result.lattice);
    for (Eigen::Index v = 0; v < character.skin.points.rows(); ++v) {
      const Vector3d p = character.skin.points.row(v).transpose();
      const int frame =
          skin_frame(character.skin.weights[static_cast<std::size_t>(v)], result.lattice.frame_of_joint);
      // Positions of size 1 go to unit coordinates and back.
      const std::vector<int> cells = cubes_at(result.lattice.complex, p, 1e-12);
      EXPECT_TRUE(std::any_of(cells.begin(), cells.end(), [&](int c) { return copies.owns(c, frame, p); }))
          << "skin vertex " << v;
    }
  }
}

TEST(HexahedralGrid, GivesLegsInOneCubeACopyEach) {
  const tests::Character legs = tests::two_legs();
  const BuildResult result = build(legs.skin, legs.joints, grid_options(60));
  EXPECT_THAT(result.failures, testing::IsEmpty());
  EXPECT_GE(result.lattice.copies.size(), 10u);
}

TEST(HexahedralGrid, CoversAPlateThatNoGridPointIsIn) {
  // A plate of 1 x 0.02 x 1 between the planes of a grid of 0.1.
  const tests::Character plate = [] {
    tests::Character c;
    c.add_joint("plate", -1, {0, 0, 0});
    c.skin = tests::blob({0, 0, 0}, 12, 12, [](const Vector3d& d) {
      return 0.5 / std::max({std::abs(d.x()), std::abs(d.y()) / 0.02, std::abs(d.z())});
    });
    c.skin.weights.assign(static_cast<std::size_t>(c.skin.points.rows()), {{0, 1.0}});
    return c;
  }();
  const detail::UnitSkin skin = detail::make_unit_skin(plate.skin);
  const CellComplex grid = detail::grid_over_skin(skin, 0.1);
  // Ten by ten cubes and one more row, as the middle of the box is the middle of the grid.
  EXPECT_GE(grid.cells.size(), 100u);
  EXPECT_LE(grid.cells.size(), 121u);
}

TEST(HexahedralGrid, StandsInWhereTheGateRefusesEveryAttempt) {
  const tests::Character legs = tests::two_legs();
  BuildOptions options;
  options.cells = 150;
  options.max_retries = 0;
  options.min_dihedral_degrees = 69.0;  // only a regular tetrahedron reaches 70.5
  const BuildResult result = build(legs.skin, legs.joints, options);
  EXPECT_TRUE(result.lattice.is_grid);
  EXPECT_THAT(result.failures, testing::IsEmpty());
  ASSERT_FALSE(result.refused.empty());
  EXPECT_THAT(result.refused.front().failures.front().what, testing::HasSubstr("dihedral"));
  EXPECT_EQ(result.lattice.retries, 2);  // mirrored tetrahedra, then whole ones
  options.construction = Construction::Tetrahedra;
  const BuildResult tetrahedra = build(legs.skin, legs.joints, options);
  EXPECT_FALSE(tetrahedra.lattice.is_grid);
  EXPECT_FALSE(tetrahedra.failures.empty());
}

}  // namespace
}  // namespace sinew::lattice
