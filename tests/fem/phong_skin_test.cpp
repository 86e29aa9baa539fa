#include "fem/body/phong_skin.h"

#include <optional>

#include <gtest/gtest.h>

#include "lattice/box.h"
#include "tests/fem/arm.h"
#include "tests/lattice/lattices.h"

namespace sinew::fem {
namespace {

using lattice::Points;
using Rows = Eigen::SparseMatrix<double, Eigen::RowMajor>;

/// A skin of fine triangles inside a block of level-1 cells of 1/8 m.
struct Block {
  lattice::Hierarchy hierarchy;
  lattice::LeafMesh mesh;
  lattice::Surface skin;
  lattice::Embedding embedding;
  std::vector<lattice::FillFractions> fill;

  explicit Block(double spacing, lattice::CellType type = lattice::CellType::Hexahedron)
      : hierarchy(lattice::box_lattice({{0, 0, 0}, {1, 1, 1}, {4, 4, 4}, type, {}}), 1),
        mesh(tests::uniform_mesh(hierarchy, 1)),
        skin(tests::box_skin({0.2, 0.2, 0.2}, {0.8, 0.8, 0.8}, spacing)),
        embedding(lattice::embed(mesh, skin.points)),
        fill(mesh.cells.size(), lattice::FillFractions{1, 1, 1, 1, 1, 1, 1, 1}) {}

  Rows rows(double share) const { return phong_rows(mesh, fill, embedding, skin, share); }
};

TEST(PhongSkin, FollowsEveryAffineMotionExactly) {
  std::mt19937_64 rng(20021);
  const tests::Affine map(rng);
  for (const auto type :
       {lattice::CellType::Hexahedron, lattice::CellType::Wedge, lattice::CellType::Tetrahedron}) {
    const Block block(0.04, type);
    // Sums of some hundred products of numbers of order 1.
    EXPECT_LE((block.rows(0.5) * map(block.mesh.points) - map(block.skin.points)).cwiseAbs().maxCoeff(),
              1e-13);
  }
}

// On cells of one size the gradient at a vertex is the central difference, 2 X_a of x = X^2, and X_a^2 + 1/2
// 2 X_a (X
// - X_a) = X_a X: the hats sum that to X^2. Trilinear rows are off by up to h^2 / 4.
TEST(PhongSkin, ReproducesQuadraticBendingWithHalf) {
  const Block block(0.02);
  Points bent = block.mesh.points;
  bent.col(2) += bent.col(0).cwiseAbs2();
  Points exact = block.skin.points;
  exact.col(2) += exact.col(0).cwiseAbs2();
  EXPECT_LE((block.rows(0.5) * bent - exact).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_GE((block.rows(0.0) * bent - exact).cwiseAbs().maxCoeff(), 0.2 / 64.0);
}

// Two limbs that meet in one vertex, where a bone runs into both: neither moves the skin of the other.
TEST(PhongSkin, DoesNotReachThroughAVertex) {
  using lattice::CellType;
  std::vector<std::optional<CellType>> types(8);
  types[0] = types[7] = CellType::Hexahedron;  // opposite corners of the block
  const lattice::Hierarchy hierarchy(
      lattice::box_lattice({{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, CellType::Hexahedron, types}), 1);
  const lattice::LeafMesh mesh = tests::uniform_mesh(hierarchy, 1);
  const lattice::Surface skin = tests::box_skin({0.3, 0.3, 0.3}, {0.49, 0.49, 0.49}, 0.03);
  const std::vector<lattice::FillFractions> fill(mesh.cells.size(),
                                                 lattice::FillFractions{1, 1, 1, 1, 1, 1, 1, 1});
  const Rows rows = phong_rows(mesh, fill, lattice::embed(mesh, skin.points), skin, 0.5);
  Points moved = mesh.points;
  for (Eigen::Index a = 0; a < moved.rows(); ++a)
    if (moved.row(a).minCoeff() > 0.5 - 1e-9 && moved.row(a).maxCoeff() > 0.5 + 1e-9) moved.row(a) *= 2.0;
  EXPECT_EQ((rows * moved - rows * mesh.points).cwiseAbs().maxCoeff(), 0.0);
}

TEST(PhongSkin, LeavesSkinAloneWhoseTrianglesAreAsLongAsCells) {
  const Block block(0.15);
  EXPECT_EQ((block.rows(0.5) - block.embedding.weights).norm(), 0.0);
}

}  // namespace
}  // namespace sinew::fem
