#include "fem/body/leaf_matrices.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "tests/fem/bar.h"
#include "tests/lattice/lattices.h"

namespace sinew::fem {
namespace {

using lattice::FillFractions;
using lattice::LeafMesh;
using lattice::Points;

constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr FillFractions kFull{1, 1, 1, 1, 1, 1, 1, 1};

LeafMatrices full_matrices(const LeafMesh& mesh, const Material& material) {
  const std::vector<Material> materials(mesh.cells.size(), material);
  const std::vector<FillFractions> fill(mesh.cells.size(), kFull);
  return assemble(mesh, materials, fill);
}

/// Leaf vertices with a leaf face that only one cell owns, or that hang on such a face.
std::vector<std::uint8_t> boundary_vertices(const lattice::Hierarchy& hierarchy, const LeafMesh& mesh) {
  // Faces of the finest level count; a vertex of it is on the boundary where one of its faces has one owner.
  const int finest = hierarchy.num_levels();
  std::map<std::array<int, 4>, int> owners;
  const auto faces = lattice::cell_faces(lattice::CellType::Hexahedron);
  const auto key = [](const lattice::HexVertices& hex, const std::array<int, 4>& face) {
    std::array<int, 4> k{};
    for (std::size_t i = 0; i < 4; ++i) k[i] = hex[static_cast<std::size_t>(face[i])];
    std::sort(k.begin(), k.end());
    return k;
  };
  for (const auto& hex : hierarchy.hexes(finest)) {
    for (const auto& face : faces) ++owners[key(hex, face)];
  }
  std::vector<std::uint8_t> on_boundary(static_cast<std::size_t>(mesh.num_vertices()), 0);
  for (const auto& [face, count] : owners) {
    if (count > 1) continue;
    for (int v : face) {
      const int leaf = mesh.leaf_of_vertex[static_cast<std::size_t>(v)];
      if (leaf >= 0) on_boundary[static_cast<std::size_t>(leaf)] = 1;
    }
  }
  return on_boundary;
}

/// Solves for the interior with a linear displacement on the boundary; the largest error over the leaf
/// vertices.
double patch_error(const lattice::Hierarchy& hierarchy, const LeafMesh& mesh, const tests::Affine& map,
                   int& num_interior) {
  const LeafMatrices matrices = full_matrices(mesh, {1e5, 0.45, 1000.0});
  const std::vector<std::uint8_t> on_boundary = boundary_vertices(hierarchy, mesh);
  const Points exact = map(mesh.points);
  std::vector<int> interior;
  // Boundary functions: level-0 values as given, details 0; then the leaf values there are the linear field,
  // since parents of boundary vertices lie on the boundary.
  Points coefficients = Points::Zero(mesh.num_functions(), 3);
  for (int f = 0; f < mesh.num_functions(); ++f) {
    const int v = mesh.functions[static_cast<std::size_t>(f)];
    const int leaf = mesh.leaf_of_vertex[static_cast<std::size_t>(v)];
    if (!on_boundary[static_cast<std::size_t>(leaf)])
      interior.push_back(f);
    else if (hierarchy.level(v) == 0)
      coefficients.row(f) = exact.row(leaf);
  }
  num_interior = static_cast<int>(interior.size());
  if (interior.empty()) return (mesh.values_from_coefficients * coefficients - exact).cwiseAbs().maxCoeff();
  const Eigen::SparseMatrix<double> stiffness = function_stiffness(matrices, mesh);
  const Points given = mesh.values_from_coefficients * coefficients;
  const Points force = mesh.values_from_coefficients.transpose() * apply_stiffness(matrices, given);
  Eigen::VectorXd x(3 * interior.size()), workspace;
  for (std::size_t i = 0; i < interior.size(); ++i)
    x.segment<3>(3 * static_cast<Eigen::Index>(i)) = -force.row(interior[i]).transpose();
  Factor factor;
  EXPECT_TRUE(factor.factorise(tests::picked(stiffness, interior)).ok);
  factor.solve(x, workspace);
  for (std::size_t i = 0; i < interior.size(); ++i)
    coefficients.row(interior[i]) = x.segment<3>(3 * static_cast<Eigen::Index>(i)).transpose();
  return (mesh.values_from_coefficients * coefficients - exact).cwiseAbs().maxCoeff();
}

TEST(PatchTest, LinearDisplacementsAreExactOnDistortedCellsOfEveryKindAndLevel) {
  std::mt19937_64 rng(41);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.12)) {
    const lattice::Hierarchy hierarchy(complex, 3);
    for (int level = 0; level <= 3; ++level) {
      const LeafMesh mesh = tests::uniform_mesh(hierarchy, level);
      const tests::Affine map(rng);
      int interior = 0;
      // The bound; displacements are of size 1.
      EXPECT_LE(patch_error(hierarchy, mesh, map, interior), 1e-11) << name << ", level " << level;
      EXPECT_EQ(interior > 0, level > 0 || name == "hexahedra") << name << ", level " << level;
    }
  }
}

TEST(PatchTest, HoldsOnAdaptiveMeshesWithHangingVertices) {
  std::mt19937_64 rng(42);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.12)) {
    const lattice::Hierarchy hierarchy(complex, 3);
    lattice::ActiveSet active = lattice::uniform_active_set(hierarchy, 1, {});
    for (int v = hierarchy.num_vertices(1); v < hierarchy.num_vertices(); ++v)
      active[static_cast<std::size_t>(v)] = rng() % 50 == 0;
    const LeafMesh mesh = lattice::leaf_mesh(hierarchy, active);
    int interior = 0;
    EXPECT_LE(patch_error(hierarchy, mesh, tests::Affine(rng), interior), 1e-11) << name;
    EXPECT_GT(interior, 0) << name;
  }
}

TEST(LeafMatrices, HaveExactlySixModesWithoutEnergy) {
  std::mt19937_64 rng(43);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const lattice::Hierarchy hierarchy(complex, 2);
    lattice::ActiveSet active = lattice::uniform_active_set(hierarchy, 1, {});
    for (int v = hierarchy.num_vertices(1); v < hierarchy.num_vertices(); v += 40)
      active[static_cast<std::size_t>(v)] = 1;
    const LeafMesh mesh = lattice::leaf_mesh(hierarchy, active);
    const Eigen::MatrixXd k = function_stiffness(full_matrices(mesh, {1e5, 0.45, 1000.0}), mesh);
    EXPECT_LE((k - k.transpose()).cwiseAbs().maxCoeff(), 1e3 * kEps * k.cwiseAbs().maxCoeff()) << name;
    const Eigen::VectorXd values =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(k, Eigen::EigenvaluesOnly).eigenvalues();
    const double largest = values[values.size() - 1];
    // Rounding of a dense eigenvalue: n eps times the largest one.
    const double rounding = static_cast<double>(values.size()) * kEps * largest;
    EXPECT_LE(values.head(6).cwiseAbs().maxCoeff(), rounding) << name;
    EXPECT_GT(values[6], 1e5 * rounding) << name;
  }
}

TEST(LeafMatrices, RigidMotionsAndOnlyStrainsCost) {
  std::mt19937_64 rng(44);
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    const lattice::Hierarchy hierarchy(complex, 2);
    const LeafMesh mesh = tests::uniform_mesh(hierarchy, 2);
    const Material material{1e5, 0.45, 1000.0};
    const LeafMatrices matrices = full_matrices(mesh, material);
    const double volume =
        apply_mass(matrices, Points::Ones(mesh.num_vertices(), 3)).col(0).sum() / material.density;
    tests::Affine map(rng);
    const Eigen::Matrix3d g = map.linear;
    const Points u = map(mesh.points);
    // A constant gradient costs V (mu eps:eps + lambda/2 tr^2), closed form; its antisymmetric part costs
    // nothing.
    const Eigen::Matrix3d strain = 0.5 * (g + g.transpose());
    const double expected = volume * (material.mu() * strain.squaredNorm() +
                                      0.5 * material.lambda() * std::pow(strain.trace(), 2));
    const double energy = 0.5 * u.cwiseProduct(apply_stiffness(matrices, u)).sum();
    EXPECT_NEAR(energy, expected, 1e4 * kEps * expected) << name;
    map.linear = g - g.transpose();
    const Points rigid = map(mesh.points);
    // Products of K's rows cancel: sums of about 81 terms of size K.
    const double stiffest = matrices.stiffness[0].cwiseAbs().maxCoeff();
    EXPECT_LE(apply_stiffness(matrices, rigid).cwiseAbs().maxCoeff(), 1e4 * kEps * stiffest) << name;
  }
}

// Mass, its centre and its moments are exact: the hats reproduce 1 and x, and on the box's affine cells 2 x 2
// x 2 Gauss points integrate their products. Integral of x^2 over [0,1]: 1/3.
TEST(LeafMatrices, MassAndItsMomentsAreThoseOfTheBox) {
  for (const lattice::CellType type :
       {lattice::CellType::Hexahedron, lattice::CellType::Wedge, lattice::CellType::Tetrahedron}) {
    tests::BarOptions options;
    options.box.type = type;
    const Body body = tests::bar_body(options);
    const Points& x = body.mesh.points;
    const Points mx = apply_mass(body.matrices, x), m1 = apply_mass(body.matrices, Points::Ones(x.rows(), 3));
    const double mass = 1000.0 * 0.04;
    EXPECT_NEAR(m1.col(0).sum(), mass, 1e3 * kEps * mass);
    EXPECT_NEAR(mx.col(0).sum(), 0.5 * mass, 1e3 * kEps * mass);
    EXPECT_NEAR(mx.col(1).sum(), 0.0, 1e3 * kEps * mass);
    if (type != lattice::CellType::Hexahedron) continue;
    EXPECT_NEAR(x.col(0).dot(mx.col(0)), mass / 3.0, 1e3 * kEps * mass);
  }
}

TEST(LeafMatrices, InFunctionsAreThoseOfTheLeafValues) {
  std::mt19937_64 rng(45);
  const lattice::Hierarchy hierarchy(tests::lattices_of_every_kind(0.1)[3].complex, 2);
  const LeafMesh mesh = tests::uniform_mesh(hierarchy, 2);
  const LeafMatrices matrices = full_matrices(mesh, {1e5, 0.3, 1000.0});
  const Points p = tests::random_points(mesh.num_functions(), rng),
               q = tests::random_points(mesh.num_functions(), rng);
  const Points u = mesh.values_from_coefficients * p, v = mesh.values_from_coefficients * q;
  const Eigen::Map<const Eigen::VectorXd> p_flat(p.data(), p.size()), q_flat(q.data(), q.size());
  const double stiffness = u.cwiseProduct(apply_stiffness(matrices, v)).sum();
  const double mass = u.cwiseProduct(apply_mass(matrices, v)).sum();
  const Eigen::SparseMatrix<double> k = function_stiffness(matrices, mesh), m = function_mass(matrices, mesh);
  // Bounded by the norms, since random vectors give sums that cancel.
  EXPECT_NEAR(p_flat.dot(k * q_flat), stiffness, 100 * kEps * k.norm() * p.norm() * q.norm());
  EXPECT_NEAR(p_flat.dot(m * q_flat), mass, 100 * kEps * m.norm() * p.norm() * q.norm());
}

/// A bar whose upper half is filled by f at every Gauss point.
Body layered_bar(double f) {
  tests::BarOptions options;
  options.box.blocks = {5, 1, 2};
  options.fill = [f](const Eigen::Vector3d& x) { return x[2] > 0.0 ? f : 1.0; };
  return tests::bar_body(options);
}

/// Condition number after scaling to unit diagonal.
double scaled_condition(const Eigen::MatrixXd& matrix) {
  const Eigen::VectorXd scale = matrix.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
  const Eigen::VectorXd values =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scaled, Eigen::EigenvaluesOnly).eigenvalues();
  return values[values.size() - 1] / values[0];
}

TEST(PartialFill, KeepsSystemsDefiniteAndWellScaledDownToNothing) {
  const auto system = [](double f) { return tests::free_system(layered_bar(f)); };
  const auto step_matrix = [](const tests::FreeSystem& s) -> Eigen::MatrixXd {
    return Eigen::MatrixXd(s.mass) + Eigen::MatrixXd(s.stiffness) / (120.0 * 120.0);
  };
  const tests::FreeSystem full = system(1.0);
  const double full_statics = scaled_condition(full.stiffness),
               full_step = scaled_condition(step_matrix(full));
  for (double f : {0.3, 1e-1, 1e-2, 1e-4, 1e-8, 0.0}) {
    const tests::FreeSystem part = system(f);
    Factor factor;
    EXPECT_TRUE(factor.factorise(part.stiffness).ok) << f;
    // Bad scaling, not bad conditioning. The bar of half the height is four times as soft in bending, and so
    // is the ratio of K's extreme eigenvalues (measured 3.4); mass hides that from a step's matrix (measured
    // 144 to 161).
    EXPECT_LT(scaled_condition(part.stiffness), 4.0 * full_statics) << f;
    EXPECT_LT(scaled_condition(step_matrix(part)), 1.25 * full_step) << f;
  }
}

TEST(PartialFill, ChangesTheSolutionContinuously) {
  const Eigen::Vector3d gravity(0.0, 0.0, -9.81);
  const auto sag = [&](double f) {
    const Body body = layered_bar(f);
    const Points u = tests::static_displacement(body, tests::gravity_force(body, gravity));
    return -u(tests::vertex_at(body, {1.0, 0.0, 0.0}), 2);
  };
  // Sag of a bar goes with 1/height^2 (weight / second moment): between 1 and 4 times; each decade of fill
  // moves it monotonically, and ever less as the fill vanishes.
  double previous = sag(1.0);
  for (double f : {0.9, 0.5, 0.2, 0.1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8}) {
    const double now = sag(f);
    EXPECT_GE(now, previous * (1.0 - 1e-12)) << f;
    EXPECT_LT(now, 2.0 * previous) << f;
    // No jump at any fill: a change of 1 % of the fill changes the sag by at most 1 %.
    EXPECT_NEAR(sag(1.01 * std::min(f, 0.99)), sag(std::min(f, 0.99)), 0.01 * now) << f;
    previous = now;
  }
  // Vanishing fill gives the bar of the lower layer alone; kEmptyShare adds less than the 0.2 % that a nearly
  // empty layer may cost.
  tests::BarOptions lower;
  lower.box.max[2] = 0.0;
  const Body body = tests::bar_body(lower);
  const Points u = tests::static_displacement(body, tests::gravity_force(body, gravity));
  const double alone = -u(tests::vertex_at(body, {1.0, 0.0, 0.0}), 2);
  EXPECT_NEAR(sag(0.0), alone, 2e-3 * alone);
}

}  // namespace
}  // namespace sinew::fem
