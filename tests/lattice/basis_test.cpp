#include "lattice/basis.h"

#include <stdexcept>

#include <gtest/gtest.h>

#include "lattice/embedding.h"
#include "tests/lattice/lattices.h"

namespace sinew::lattice {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();
/// Values of size 1 to 3, weights summed over 8 corners and means of 8 over up to 4 levels; the local
/// coordinates of a point are known to a few eps times the cells' aspect.
constexpr double kRounding = 500 * kEps;

/// Values of a field at points: rows of the basis times coefficients.
Points field_at(const LeafMesh& mesh, const Points& coefficients, const Points& at) {
  const Embedding embedding = embed(mesh, at);
  return embedding.weights * (mesh.values_from_coefficients * coefficients);
}

/// Coefficients of the mesh's functions out of those of all vertices.
Points coefficients_of(const LeafMesh& mesh, const Points& all) {
  Points picked(mesh.num_functions(), 3);
  for (int f = 0; f < mesh.num_functions(); ++f)
    picked.row(f) = all.row(mesh.functions[static_cast<std::size_t>(f)]);
  return picked;
}

TEST(Basis, LevelZeroHatsSumToOneOnEveryLevel) {
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const Hierarchy hierarchy(complex, 3);
    for (int level = 0; level <= 3; ++level) {
      const LeafMesh mesh = tests::uniform_mesh(hierarchy, level);
      Points ones = Points::Zero(mesh.num_functions(), 3);
      ones.topRows(hierarchy.num_vertices(0)).setOnes();
      const Points values = mesh.values_from_coefficients * ones;
      EXPECT_LE((values.array() - 1.0).abs().maxCoeff(), 16 * kEps) << name << ", level " << level;
    }
  }
}

TEST(Basis, NodalHatsOfEveryLevelSumToOneAndReproduceLinearFields) {
  std::mt19937_64 rng(3);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const Hierarchy hierarchy(complex, 3);
    for (int level = 1; level <= 3; ++level) {
      const LeafMesh mesh = tests::uniform_mesh(hierarchy, level);
      const Points at = tests::points_inside(mesh, 60, rng);
      const Embedding embedding = embed(mesh, at);
      ASSERT_TRUE(embedding.outside.empty()) << name;
      const Eigen::VectorXd sums = embedding.weights * Eigen::VectorXd::Ones(mesh.num_vertices());
      EXPECT_LE((sums.array() - 1.0).abs().maxCoeff(), 8 * kEps) << name << ", level " << level;
      const tests::Affine map(rng);
      const Points values = embedding.weights * map(mesh.points);
      EXPECT_LE((values - map(at)).cwiseAbs().maxCoeff(), kRounding) << name << ", level " << level;
    }
  }
}

TEST(Basis, LevelZeroHatsAloneReproduceLinearFields) {
  std::mt19937_64 rng(4);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const Hierarchy hierarchy(complex, 3);
    const tests::Affine map(rng);
    for (int level = 0; level <= 3; ++level) {
      const LeafMesh mesh = tests::uniform_mesh(hierarchy, level);
      const Points at = tests::points_inside(mesh, 60, rng);
      Points coefficients = Points::Zero(mesh.num_functions(), 3);
      coefficients.topRows(complex.points.rows()) = map(complex.points);
      EXPECT_LE((field_at(mesh, coefficients, at) - map(at)).cwiseAbs().maxCoeff(), kRounding)
          << name << ", level " << level;
    }
  }
}

// The hat of a tetrahedron's vertex is its barycentric coordinate; subdivided it has 1/2 at edge points, 1/3
// at face points and 1/4 at the cell point, and the trilinear hexahedra between reproduce the linear
// function.
TEST(TwoScaleRelation, GivesTheBarycentricHatsOfATetrahedron) {
  std::mt19937_64 rng(5);
  CellComplex complex = box_lattice({{0, 0, 0}, {1, 1, 1}, {1, 1, 1}, CellType::Tetrahedron, {}});
  complex = tests::distorted(complex, 0.1, 6);
  const Hierarchy hierarchy(complex, 2);
  const LeafMesh mesh = tests::uniform_mesh(hierarchy, 2);
  for (std::size_t c = 0; c < complex.cells.size(); ++c) {
    const auto& v = complex.cells[c].vertices;
    for (int i = 0; i < 20; ++i) {
      Eigen::Vector4d barycentric(tests::uniform(rng, 0.01, 1), tests::uniform(rng, 0.01, 1),
                                  tests::uniform(rng, 0.01, 1), tests::uniform(rng, 0.01, 1));
      barycentric /= barycentric.sum();
      Points p = Points::Zero(1, 3);
      for (int k = 0; k < 4; ++k) p += barycentric[k] * complex.points.row(v[static_cast<std::size_t>(k)]);
      const Embedding embedding = embed(mesh, p);
      const Eigen::SparseMatrix<double, Eigen::RowMajor> row =
          embedding.weights * mesh.values_from_coefficients;
      for (int k = 0; k < 4; ++k)
        EXPECT_NEAR(row.coeff(0, v[static_cast<std::size_t>(k)]), barycentric[k], kRounding);
    }
  }
}

// On an affine prism the hat is the product of the triangle's barycentric coordinate and the axis' linear
// hat.
TEST(TwoScaleRelation, GivesTheProductHatsOfAWedge) {
  std::mt19937_64 rng(7);
  CellComplex complex;
  complex.cells = {{CellType::Wedge, {0, 1, 2, 3, 4, 5, -1, -1}}};
  complex.points.resize(6, 3);
  complex.points << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1;
  Eigen::Matrix3d shear;
  shear << 1.0, 0.3, -0.2, 0.1, 1.2, 0.4, 0.0, -0.3, 0.8;
  complex.points = complex.points * shear.transpose();
  const Hierarchy hierarchy(complex, 2);
  const LeafMesh mesh = tests::uniform_mesh(hierarchy, 2);
  for (int i = 0; i < 50; ++i) {
    const double x = tests::uniform(rng, 0, 1), y = tests::uniform(rng, 0, x), z = tests::uniform(rng, 0, 1);
    Points p(1, 3);
    p.row(0) = (shear * Eigen::Vector3d(x, y, z)).transpose();
    const Eigen::SparseMatrix<double, Eigen::RowMajor> row =
        embed(mesh, p).weights * mesh.values_from_coefficients;
    const Eigen::Vector3d triangle(1.0 - x, x - y, y);  // barycentric coordinates of (0,0), (1,0), (1,1)
    for (int k = 0; k < 6; ++k) {
      const double hat = triangle[k % 3] * (k < 3 ? 1.0 - z : z);
      EXPECT_NEAR(row.coeff(0, k), hat, kRounding);
    }
  }
}

TEST(TwoScaleRelation, GivesTheTrilinearHatsOfADistortedHexahedron) {
  std::mt19937_64 rng(8);
  const CellComplex complex = tests::distorted(box_lattice({}), 0.15, 9);
  const Hierarchy hierarchy(complex, 3);
  HexVertices hex;
  std::copy_n(complex.cells[0].vertices.begin(), 8, hex.begin());
  const HexCorners corners = hex_corners(complex.points, hex);
  for (int level = 0; level <= 3; ++level) {
    const LeafMesh mesh = tests::uniform_mesh(hierarchy, level);
    for (int i = 0; i < 20; ++i) {
      const HexWeights weights = trilinear_weights(tests::uniform_point(rng, 0.0, 1.0));
      Points p(1, 3);
      p.row(0) = weights.transpose() * corners;
      const Eigen::SparseMatrix<double, Eigen::RowMajor> row =
          embed(mesh, p).weights * mesh.values_from_coefficients;
      for (int k = 0; k < 8; ++k)
        EXPECT_NEAR(row.coeff(0, hex[static_cast<std::size_t>(k)]), weights[k], kRounding);
    }
  }
}

TEST(Nestedness, AFunctionOfOneLevelIsWrittenExactlyInTheNext) {
  std::mt19937_64 rng(10);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const Hierarchy hierarchy(complex, 3);
    for (int level = 1; level < 3; ++level) {
      const LeafMesh coarse = tests::uniform_mesh(hierarchy, level),
                     fine = tests::uniform_mesh(hierarchy, level + 1);
      Points all = Points::Zero(hierarchy.num_vertices(), 3);
      all.topRows(hierarchy.num_vertices(level)) = tests::random_points(hierarchy.num_vertices(level), rng);
      const Points at = tests::points_inside(coarse, 60, rng);
      const Points expected = field_at(coarse, coefficients_of(coarse, all), at);
      EXPECT_LE((field_at(fine, coefficients_of(fine, all), at) - expected).cwiseAbs().maxCoeff(), kRounding)
          << name << ", level " << level;
    }
  }
}

/// Level-0 functions and a random third of the others.
ActiveSet random_active_set(const Hierarchy& hierarchy, std::mt19937_64& rng, unsigned one_in) {
  ActiveSet active(static_cast<std::size_t>(hierarchy.num_vertices()), 1);
  for (int v = hierarchy.num_vertices(0); v < hierarchy.num_vertices(); ++v)
    active[static_cast<std::size_t>(v)] = rng() % one_in == 0;
  return active;
}

// The uniform finest mesh is conforming, so a field that agrees with one of it everywhere has no cracks at
// hanging vertices.
TEST(AdaptiveActiveSet, GivesTheFieldOfTheFinestMeshWithItsDetailsAtZero) {
  std::mt19937_64 rng(11);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const Hierarchy hierarchy(complex, 3);
    const LeafMesh finest = tests::uniform_mesh(hierarchy, 3);
    for (unsigned one_in : {3u, 30u, 300u}) {
      const ActiveSet active = random_active_set(hierarchy, rng, one_in);
      const LeafMesh mesh = leaf_mesh(hierarchy, active);
      Points all = tests::random_points(hierarchy.num_vertices(), rng);
      for (int v = 0; v < hierarchy.num_vertices(); ++v) {
        if (!active[static_cast<std::size_t>(v)]) all.row(v).setZero();
      }
      const Points at = tests::points_inside(finest, 200, rng);
      const Points expected = field_at(finest, all, at);
      EXPECT_LE((field_at(mesh, coefficients_of(mesh, all), at) - expected).cwiseAbs().maxCoeff(), kRounding)
          << name << ", one in " << one_in;
    }
  }
}

// Evaluated from both sides: corners of finer cells that lie on a coarser neighbour's face take that face's
// value.
TEST(AdaptiveActiveSet, HangingVerticesAreContinuous) {
  const Hierarchy hierarchy(box_lattice({{0, 0, 0}, {2, 1, 1}, {2, 1, 1}, CellType::Hexahedron, {}}), 3);
  ActiveSet active = uniform_active_set(hierarchy, 1, {});
  int hanging = 0;
  for (int v = 0; v < hierarchy.num_vertices(3); ++v) {
    if (hierarchy.level(v) >= 2 && hierarchy.points()(v, 0) < 0.9) active[static_cast<std::size_t>(v)] = 1;
  }
  const LeafMesh mesh = leaf_mesh(hierarchy, active);
  std::mt19937_64 rng(12);
  const Points values = mesh.values_from_coefficients * tests::random_points(mesh.num_functions(), rng);
  for (int a = 0; a < mesh.num_vertices(); ++a) {
    const Eigen::RowVector3d p = mesh.points.row(a);
    for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
      const auto& cell = mesh.cells[c];
      const LocalCoordinates local = invert_trilinear(hex_corners(mesh.points, cell), p.transpose());
      if (!local.converged || local.outside > 1e-9) continue;
      Eigen::RowVector3d value = Eigen::RowVector3d::Zero();
      const HexWeights weights = trilinear_weights(local.xi);
      for (int k = 0; k < 8; ++k) value += weights[k] * values.row(cell[static_cast<std::size_t>(k)]);
      EXPECT_LE((value - values.row(a)).cwiseAbs().maxCoeff(), kRounding);
      if (std::find(cell.begin(), cell.end(), a) == cell.end()) ++hanging;
    }
  }
  EXPECT_GT(hanging, 20);  // the mesh has hanging vertices at all
}

TEST(AdaptiveActiveSet, RefiningWithZeroCoefficientsChangesNoField) {
  std::mt19937_64 rng(13);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const Hierarchy hierarchy(complex, 3);
    const ActiveSet before = random_active_set(hierarchy, rng, 30);
    ActiveSet after = before;
    for (auto& flag : after) flag = flag || rng() % 20 == 0;
    const LeafMesh coarse = leaf_mesh(hierarchy, before), fine = leaf_mesh(hierarchy, after);
    EXPECT_GT(fine.num_functions(), coarse.num_functions());
    Points all = tests::random_points(hierarchy.num_vertices(), rng);
    for (std::size_t v = 0; v < before.size(); ++v) {
      if (!before[v]) all.row(static_cast<Eigen::Index>(v)).setZero();
    }
    const Points at = tests::points_inside(fine, 200, rng);
    const Points expected = field_at(coarse, coefficients_of(coarse, all), at);
    EXPECT_LE((field_at(fine, coefficients_of(fine, all), at) - expected).cwiseAbs().maxCoeff(), kRounding)
        << name;
  }
}

/// Whether an active function of `level` or finer lives in hexahedron `hex` of `level` - 1.
bool has_finer_function(const Hierarchy& hierarchy, const ActiveSet& active, int level, int hex) {
  int children = 8;
  for (int j = level; j <= hierarchy.num_levels(); ++j, children *= 8) {
    for (int c = children * hex; c < children * (hex + 1); ++c) {
      for (int v : hierarchy.hexes(j)[static_cast<std::size_t>(c)]) {
        if (active[static_cast<std::size_t>(v)] && hierarchy.level(v) >= level) return true;
      }
    }
  }
  return false;
}

TEST(LeafMesh, CellsAreSplitExactlyWhereAFinerFunctionIsActive) {
  std::mt19937_64 rng(14);
  const Hierarchy hierarchy(tests::lattices_of_every_kind(0.1)[3].complex, 3);
  const ActiveSet active = random_active_set(hierarchy, rng, 40);
  const LeafMesh mesh = leaf_mesh(hierarchy, active);
  std::array<double, 4> covered{};
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const int level = mesh.level[c], hex = mesh.hex[c];
    covered[static_cast<std::size_t>(level)] += std::pow(0.125, level - 1);
    EXPECT_FALSE(level < 3 && has_finer_function(hierarchy, active, level + 1, hex));
    EXPECT_TRUE(level == 1 || has_finer_function(hierarchy, active, level, hex / 8));
  }
  // Each level-1 hexahedron is covered exactly once (dyadic shares: exact).
  EXPECT_EQ(covered[1] + covered[2] + covered[3], static_cast<double>(hierarchy.hexes(1).size()));
  EXPECT_GT(covered[1], 0.0);
  EXPECT_GT(covered[3], 0.0);
}

TEST(UniformActiveSet, LeavesOutTheMidpointsOfBonePieces) {
  const Hierarchy hierarchy(box_lattice({{0, 0, 0}, {2, 1, 1}, {2, 1, 1}, CellType::Hexahedron, {}}), 2);
  const ActiveSet all = uniform_active_set(hierarchy, 2, {}),
                  with_bone = uniform_active_set(hierarchy, 2, {{0, 1, 2}});
  for (int v = 0; v < hierarchy.num_vertices(); ++v) {
    const auto p = hierarchy.points().row(v);
    // The bone runs along x from the origin; its new vertices lie at odd multiples of 1/2 and 1/4.
    const bool on_bone = hierarchy.level(v) > 0 && p[1] == 0.0 && p[2] == 0.0;
    EXPECT_EQ(with_bone[static_cast<std::size_t>(v)], all[static_cast<std::size_t>(v)] && !on_bone);
  }
}

TEST(RestrictCells, KeepsTheFieldOnTheCellsItKeeps) {
  std::mt19937_64 rng(15);
  const Hierarchy hierarchy(tests::lattices_of_every_kind(0.1)[3].complex, 2);
  const LeafMesh mesh = leaf_mesh(hierarchy, random_active_set(hierarchy, rng, 5));
  std::vector<std::uint8_t> keep(mesh.cells.size());
  for (auto& flag : keep) flag = rng() % 3 == 0;
  const LeafMesh part = restrict_cells(hierarchy, mesh, keep);
  const Points all = tests::random_points(hierarchy.num_vertices(), rng);
  const Points whole = mesh.values_from_coefficients * coefficients_of(mesh, all);
  const Points kept = part.values_from_coefficients * coefficients_of(part, all);
  EXPECT_LT(part.num_vertices(), mesh.num_vertices());
  for (int a = 0; a < part.num_vertices(); ++a) {
    const int v = part.vertices[static_cast<std::size_t>(a)];
    EXPECT_EQ(kept.row(a), whole.row(mesh.leaf_of_vertex[static_cast<std::size_t>(v)]));
  }
}

TEST(LeafMesh, RefusesAnInactiveLevelZeroFunction) {
  const Hierarchy hierarchy(box_lattice({}), 1);
  ActiveSet active = uniform_active_set(hierarchy, 1, {});
  active[3] = 0;
  EXPECT_THROW(leaf_mesh(hierarchy, active), std::invalid_argument);
  EXPECT_THROW(leaf_mesh(hierarchy, ActiveSet(8, 1)), std::invalid_argument);
}

}  // namespace
}  // namespace sinew::lattice
