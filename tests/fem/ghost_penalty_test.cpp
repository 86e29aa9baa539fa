#include "fem/body/ghost_penalty.h"

#include <random>
#include <utility>

#include <gtest/gtest.h>

#include "fem/body/leaf_matrices.h"
#include "lattice/box.h"
#include "tests/lattice/lattices.h"

namespace sinew::fem {
namespace {

using lattice::FillFractions;
using lattice::LeafMesh;
using lattice::Points;

FillFractions filled(double share) {
  FillFractions fill;
  fill.fill(share);
  return fill;
}

/// Fill of cells left and right of a plane x = `split`.
std::vector<FillFractions> fill_of(const LeafMesh& mesh, double split, double left, double right) {
  std::vector<FillFractions> fill;
  for (const lattice::HexVertices& cell : mesh.cells)
    fill.push_back(filled(lattice::hex_corners(mesh.points, cell).col(0).mean() < split ? left : right));
  return fill;
}

TEST(GhostPenalty, KinkBetweenTwoCubesCostsItsClosedForm) {
  // One block of 2 m halves into eight leaf cells of 1 m.
  const lattice::BoxOptions box{{0, 0, 0}, {2, 2, 2}, {1, 1, 1}, lattice::CellType::Hexahedron, {}};
  const lattice::Hierarchy hierarchy(lattice::box_lattice(box), 1);
  const LeafMesh mesh = tests::uniform_mesh(hierarchy, 1);
  const Material material{2.9e3, 0.45, 1000.0};  // mu = 1000 Pa
  const std::vector<Material> materials(mesh.cells.size(), material);
  // Faces between the empty and the full half count, faces within the empty half too; the kink at x = 1 lies
  // on the four faces between the halves only.
  const LeafMatrices matrices = assemble(mesh, materials, fill_of(mesh, 1.0, 1.0, 0.0), {0.01, 0.3});
  Points kink = Points::Zero(mesh.num_vertices(), 3);
  for (int a = 0; a < mesh.num_vertices(); ++a) kink(a, 1) = 0.7 * std::abs(mesh.points(a, 0) - 1.0);
  const double energy = 0.5 * kink.cwiseProduct(apply_ghost(matrices, kink)).sum();
  // gamma mu h / 2 times the jump squared times the area: 0.01 x 1000 x 1 / 2 x (2 x 0.7)^2 x 4 m^2.
  EXPECT_NEAR(energy, 0.5 * 0.01 * 1000.0 * 1.0 * 1.96 * 4.0, 1e-9);
}

/// Level 1 and, where x > `from`, level 2.
LeafMesh graded_mesh(const lattice::Hierarchy& hierarchy, double from) {
  lattice::ActiveSet active = lattice::uniform_active_set(hierarchy, 1, {});
  for (int v = hierarchy.num_vertices(1); v < hierarchy.num_vertices(2); ++v)
    active[static_cast<std::size_t>(v)] = hierarchy.points()(v, 0) > from;
  return lattice::leaf_mesh(hierarchy, active);
}

TEST(GhostPenalty, KinkBetweenLevelsCostsItsClosedForm) {
  // Two blocks of 2 m: leaf cells of 1 m on the left and of half a metre on the right.
  const lattice::BoxOptions box{{0, 0, 0}, {4, 2, 2}, {2, 1, 1}, lattice::CellType::Hexahedron, {}};
  const lattice::Hierarchy hierarchy(lattice::box_lattice(box), 2);
  const LeafMesh mesh = graded_mesh(hierarchy, 2.1);
  ASSERT_EQ(mesh.cells.size(), 8u + 64u);
  const std::vector<Material> materials(mesh.cells.size(), {2.9e3, 0.45, 1000.0});  // mu = 1000 Pa
  Points kink = Points::Zero(mesh.num_vertices(), 3);
  for (int a = 0; a < mesh.num_vertices(); ++a) kink(a, 1) = 0.7 * std::abs(mesh.points(a, 0) - 2.0);
  for (const auto& [left, right] : {std::pair(1.0, 0.0), {0.0, 1.0}}) {
    const LeafMatrices matrices = assemble(mesh, materials, fill_of(mesh, 2.0, left, right), {0.01, 0.3});
    const double energy = 0.5 * kink.cwiseProduct(apply_ghost(matrices, kink)).sum();
    // As above with h = (1 + 0.5) / 2, on sixteen faces that are a quarter of a coarse one.
    EXPECT_NEAR(energy, 0.5 * 0.01 * 1000.0 * 0.75 * 1.96 * 4.0, 1e-9);
  }
}

// x y z is trilinear in boxes of every size and smooth from one to the next: the slopes of both sides agree
// at every point of a face, if they are taken at one point.
TEST(GhostPenalty, IsZeroForWhatIsSmoothWhereLevelsMeet) {
  const lattice::BoxOptions box{{0, 0, 0}, {4, 2, 2}, {2, 1, 1}, lattice::CellType::Hexahedron, {}};
  const lattice::Hierarchy hierarchy(lattice::box_lattice(box), 2);
  const LeafMesh mesh = graded_mesh(hierarchy, 2.1);
  const std::vector<FillFractions> empty(mesh.cells.size(), filled(0.0));
  const LeafMatrices matrices =
      assemble(mesh, std::vector<Material>(mesh.cells.size(), Material{2.9e3, 0.45, 1000.0}), empty);
  Points smooth = Points::Zero(mesh.num_vertices(), 3);
  smooth.col(1) = mesh.points.rowwise().prod();
  double largest = 0.0;
  for (const double s : matrices.ghost) largest = std::max(largest, std::abs(s));
  // Sums of some ten products each way that cancel.
  EXPECT_LE(apply_ghost(matrices, smooth).cwiseAbs().maxCoeff(), 1e-12 * largest * smooth.maxCoeff());
}

TEST(GhostPenalty, IsZeroForAffineMapsWhereLevelsMeet) {
  std::mt19937_64 rng(20021);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const lattice::Hierarchy hierarchy(complex, 2);
    const LeafMesh mesh = graded_mesh(hierarchy, 1.2);
    const std::vector<FillFractions> empty(mesh.cells.size(), filled(0.0));
    bool is_between_levels = false;
    for (const GhostFace& face : ghost_faces(mesh, empty, {}))
      is_between_levels |= mesh.level[static_cast<std::size_t>(face.cell[0])] !=
                           mesh.level[static_cast<std::size_t>(face.cell[1])];
    EXPECT_TRUE(is_between_levels) << name;
    const LeafMatrices matrices =
        assemble(mesh, std::vector<Material>(mesh.cells.size(), Material{2.9e3, 0.45, 1000.0}), empty);
    const Points pulled = apply_ghost(matrices, tests::Affine(rng)(mesh.points));
    double largest = 0.0;
    for (const double s : matrices.ghost) largest = std::max(largest, std::abs(s));
    // Sums of some ten products each way that cancel.
    EXPECT_LE(pulled.cwiseAbs().maxCoeff(), 1e-12 * largest) << name;
  }
}

/// Any lattice: its cells are distorted and filled at random.
void expect_zero_for_affine_maps(const lattice::Hierarchy& hierarchy) {
  std::mt19937_64 rng(20021);
  const LeafMesh mesh = tests::uniform_mesh(hierarchy, 1);
  std::vector<FillFractions> fill;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) fill.push_back(filled(tests::uniform(rng, 0.0, 1.0)));
  const std::vector<Material> materials(mesh.cells.size(), Material{2.9e3, 0.45, 1000.0});
  const LeafMatrices matrices = assemble(mesh, materials, fill);
  double largest = 0.0;
  for (const double s : matrices.ghost) largest = std::max(largest, std::abs(s));
  ASSERT_GT(largest, 0.0) << "no face counts";
  const Points moved = tests::Affine(rng)(mesh.points);
  // Some thirty products a row, each rounded at the size of the largest: 1e-13 leaves a factor of ten.
  EXPECT_LE(apply_ghost(matrices, moved).cwiseAbs().maxCoeff(),
            1e-13 * largest * moved.cwiseAbs().maxCoeff());
  Points kinked = moved;
  for (Eigen::Index a = 0; a < kinked.rows(); ++a) kinked(a, 0) += tests::uniform(rng, -0.1, 0.1);
  EXPECT_GT(kinked.cwiseProduct(apply_ghost(matrices, kinked)).sum(), 0.0);
}

TEST(GhostPenalty, IsZeroForAffineMapsOnEveryCellType) {
  for (const tests::NamedLattice& one : tests::lattices_of_every_kind(0.1)) {
    SCOPED_TRACE(one.name);
    expect_zero_for_affine_maps(lattice::Hierarchy(one.complex, 1));
  }
}

TEST(GhostPenalty, LeavesCellsAloneThatHoldTheirOwnFlesh) {
  const lattice::BoxOptions box{{0, 0, 0}, {2, 2, 2}, {2, 2, 2}, lattice::CellType::Hexahedron, {}};
  const lattice::Hierarchy hierarchy(lattice::box_lattice(box), 1);
  const LeafMesh mesh = tests::uniform_mesh(hierarchy, 1);
  EXPECT_TRUE(ghost_faces(mesh, fill_of(mesh, 1.0, 0.31, 1.0), {0.01, 0.3}).empty());
  EXPECT_TRUE(ghost_faces(mesh, fill_of(mesh, 1.0, 0.0, 1.0), {0.0, 0.3}).empty());
  // 4 x 4 x 4 leaf cells, the left half empty: 16 faces between the halves, and within the left half 16 along
  // x and 2 x 2 x 12 across it.
  EXPECT_EQ(ghost_faces(mesh, fill_of(mesh, 1.0, 0.29, 1.0), {0.01, 0.3}).size(), 16u + 16u + 48u);
}

}  // namespace
}  // namespace sinew::fem
