// A bar in a lattice that does not know it, turned and offset: most of its cells are cut, many hardly filled.
#include <cmath>
#include <ostream>
#include <set>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lattice/box.h"
#include "lattice/fill.h"
#include "tests/fem/bar.h"

namespace sinew::fem {
namespace {

using Eigen::Vector3d;
using lattice::Points;

/// The free bar of ../shared/reference: 1 x 0.2 x 0.2 m, E = 1e5 Pa, nu = 0.3, 1000 kg/m^3; two independent
/// codes agree on these to four digits [Hz].
constexpr double kBending = 1.822907, kTorsion = 2.847535, kSecondBending = 4.275193;
constexpr double kMass = 40.0;  ///< [kg].

lattice::Surface turned_bar(const Eigen::Affine3d& place) {
  lattice::Surface bar;
  bar.points.resize(8, 3);
  for (int k = 0; k < 8; ++k)
    bar.points.row(k) =
        (place * Vector3d(k & 1 ? 0.5 : -0.5, k & 2 ? 0.1 : -0.1, k & 4 ? 0.1 : -0.1)).transpose();
  bar.triangles.resize(12, 3);
  bar.triangles << 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2,
      1, 3, 7, 1, 7, 5;
  return bar;
}

struct Immersed {
  tests::FreeSystem system;
  double mass = 0.0;
  double more_entries = 0.0;  ///< of a factor, times those without the ghost penalty.
};

/// Cells of 0.2 m / `across`, each of eight leaf cells.
Immersed immersed(int across, const Eigen::Affine3d& place) {
  const lattice::Surface bar = turned_bar(place);
  const double block = 0.2 / across;
  lattice::BoxOptions box;
  box.min = bar.points.colwise().minCoeff().transpose() - Vector3d::Constant(0.37 * block);
  const Vector3d size = bar.points.colwise().maxCoeff().transpose() - box.min;
  for (int c = 0; c < 3; ++c) box.blocks[c] = static_cast<int>(std::ceil(size[c] / block + 0.1));
  box.max = box.min + block * box.blocks.cast<double>();
  const lattice::Hierarchy hierarchy(lattice::box_lattice(box), 1);
  lattice::LeafMesh mesh = leaf_mesh(hierarchy, uniform_active_set(hierarchy, 1, {}));
  std::vector<lattice::FillFractions> fill =
      lattice::fill_fractions(mesh, lattice::SurfaceQuery(bar.points, bar.triangles), 0.0);
  const Points samples = lattice::sample_triangles(bar.points, bar.triangles, 0.1 * block).points;
  lattice::fill_grazed_octants(mesh, samples, fill);
  // Cells of the lattice stay whole, as in every body.
  std::vector<std::uint8_t> keep = lattice::filled_cells(fill, lattice::embed(mesh, samples).cell);
  std::set<int> coarse;
  for (std::size_t c = 0; c < keep.size(); ++c)
    if (keep[c]) coarse.insert(coarse_cell(hierarchy, mesh, static_cast<int>(c)));
  for (std::size_t c = 0; c < keep.size(); ++c)
    keep[c] = coarse.contains(coarse_cell(hierarchy, mesh, static_cast<int>(c)));
  std::vector<lattice::FillFractions> kept;
  for (std::size_t c = 0; c < fill.size(); ++c)
    if (keep[c]) kept.push_back(fill[c]);
  mesh = restrict_cells(hierarchy, mesh, keep);
  const std::vector<Material> materials(mesh.cells.size(), {1e5, 0.3, 1000.0});
  const LeafMatrices matrices = assemble(mesh, materials, kept);
  Immersed result;
  const auto entries = [](const LeafMatrices& of) {
    std::vector<Eigen::Triplet<double>> pattern;
    for (int row = 0; row < of.num_vertices(); ++row)
      for (int e = of.row_start[row]; e < of.row_start[row + 1]; ++e)
        pattern.emplace_back(row, of.column[e], row == of.column[e] ? 1e3 : -1.0);
    Eigen::SparseMatrix<double> matrix(of.num_vertices(), of.num_vertices());
    matrix.setFromTriplets(pattern.begin(), pattern.end());
    Factor factor;
    EXPECT_TRUE(factor.factorise(matrix).ok);
    return static_cast<double>(factor.num_nonzeros());
  };
  result.more_entries = entries(matrices) / entries(assemble(mesh, materials, kept, {0.0, 0.0}));
  result.system = tests::nodal_system(matrices, std::vector<std::uint8_t>(matrices.num_vertices(), 0));
  result.mass = apply_mass(matrices, Points::Ones(mesh.num_vertices(), 3)).col(0).sum();
  return result;
}

struct Bounds {
  int across;
  double bending, torsion;  ///< of the first frequency, relative.

  friend void PrintTo(const Bounds& bounds, std::ostream* out) { *out << bounds.across; }
};

class ImmersedBar : public testing::TestWithParam<Bounds> {};

/// A place without symmetry to the grid; another one for every seed.
Eigen::Affine3d place(int seed) {
  const Vector3d axis = Vector3d(1.0, 0.4 * seed - 0.7, 0.5 - 0.3 * seed).normalized();
  return Eigen::Affine3d(Eigen::Translation3d(0.013 * seed, 0.031, -0.017 * seed) *
                         Eigen::AngleAxisd(0.35 + 0.4 * seed, axis));
}

TEST_P(ImmersedBar, SwingsLikeTheFreeBar) {
  const auto& [across, bending, torsion] = GetParam();
  for (int seed = 0; seed < 3; ++seed) {
    SCOPED_TRACE(seed);
    const Immersed bar = immersed(across, place(seed));
    // Six rigid motions, then bending twice, torsion, second bending twice; shifted near those sought.
    const std::vector<double> f = tests::natural_frequencies(bar.system, 11, 100.0);
    EXPECT_NEAR(bar.mass, kMass, 0.01 * kMass);
    EXPECT_LE(bar.more_entries, 1.7);  // measured up to 1.66
    for (int k = 0; k < 6; ++k) EXPECT_LT(f[k], 1e-3 * kBending);
    EXPECT_NEAR(f[6], kBending, bending * kBending);
    EXPECT_NEAR(f[8], kTorsion, torsion * kTorsion);
    // What lies above bends more in a cell; it bounds that no mode of loose vertices comes between.
    EXPECT_NEAR(f[9], kSecondBending, 2.0 * bending * kSecondBending);
  }
}

// Measured: bending 6.4, 1.6 and 0.7 %, torsion 8.0, 2.8 and 1.3 %; without the ghost penalty 4.6, 1.4 and
// 0.5 %, 5.6, 2.3 and 1.2 %. A penalty of three tenths would give half of that back, for steps of
// `blended-stiffness` that take up to 1.4 times as long as without any (with this one up to 1.2 times).
INSTANTIATE_TEST_SUITE_P(CellsAcross, ImmersedBar,
                         testing::Values(Bounds{1, 0.065, 0.09}, Bounds{2, 0.02, 0.03},
                                         Bounds{3, 0.01, 0.015}));

}  // namespace
}  // namespace sinew::fem
