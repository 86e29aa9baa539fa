// Energies of single cells: derivatives, agreement at small strain, closed forms.
#include <cmath>
#include <memory>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "fem/models/detail/corotational_cells.h"
#include "fem/models/detail/green_strain.h"
#include "fem/models/detail/neo_hookean.h"
#include "fem/models/detail/springs.h"
#include "fem/models/detail/stvk.h"
#include "tests/fem/bar.h"

namespace sinew::fem {
namespace {

using lattice::Points;

constexpr double kYoung = 3e4, kPoisson = 0.4;

double unit(std::mt19937_64& rng) { return static_cast<double>(rng() >> 11) * 0x1p-52 - 1.0; }  // -1 .. 1

/// Eight leaf cells of a distorted box, filled unevenly.
Body odd_cells(bool distorted = true) {
  tests::BarOptions options;
  options.box = {{0, 0, 0}, {0.5, 0.4, 0.3}, {1, 1, 1}, lattice::CellType::Hexahedron, {}};
  options.material = {kYoung, kPoisson, 1000.0};
  if (distorted) {
    options.distort = [](const Eigen::Vector3d& x) -> Eigen::Vector3d {
      return x + Eigen::Vector3d(0.3 * x[1] * x[2], -0.2 * x[0] * x[2], 0.25 * x[0] * x[1]);
    };
    options.fill = [](const Eigen::Vector3d& x) { return x[0] > 0.3 && x[1] > 0.1 ? 0.3 : 1.0; };
  }
  return tests::bar_body(options);
}

struct Law {
  std::string name;
  std::unique_ptr<CellEnergy> cells;
};

std::vector<Law> laws(const Body& body) {
  std::vector<Law> all;
  all.push_back({"neo-hookean", neo_hookean_cells(body)});
  all.push_back({"stvk", stvk_cells(body)});
  all.push_back({"springs", spring_cells(body)});
  all.push_back({"corotational", corotational_cells(body)});
  return all;
}

Points moved(const Points& x, double amount, std::mt19937_64& rng) {
  Points y = x;
  for (Eigen::Index i = 0; i < y.size(); ++i) y.data()[i] += amount * unit(rng);
  return y;
}

/// Deformed far beyond anything linear: up to 60 % of a cell's edge.
Points crumpled(const Body& body, std::mt19937_64& rng) { return moved(body.mesh.points, 0.08, rng); }

// Central differences with steps of 1e-5 of a cell: truncation 1e-10, rounding 1e-11 of the energy over the
// step; together below 1e-7 of the largest entry.
TEST(CellEnergies, HaveGradientsThatAreTheirSlopes) {
  std::mt19937_64 rng(20031);
  const Body body = odd_cells();
  for (const Law& law : laws(body)) {
    for (bool damped : {false, true}) {
      const Points past = crumpled(body, rng), x = crumpled(body, rng);
      const std::vector<PastPlace> history{{4.0 / 3.0, &past}, {-1.0 / 3.0, &body.mesh.points}};
      law.cells->set_damping(damped ? 0.7 : 0.0, history);
      for (int c = 0; c < 8; ++c) {
        CellPoints p = cell_points(x, body.mesh.cells[static_cast<std::size_t>(c)]);
        const CellVector gradient = law.cells->gradient(c, p);
        for (Eigen::Index i = 0; i < 24; ++i) {
          const double h = 1e-6, at = p.data()[i];
          p.data()[i] = at + h;
          const double up = law.cells->energy(c, p);
          p.data()[i] = at - h;
          const double down = law.cells->energy(c, p);
          p.data()[i] = at;
          EXPECT_NEAR(gradient[i], (up - down) / (2.0 * h), 1e-7 * gradient.cwiseAbs().maxCoeff())
              << law.name << " dof " << i;
        }
      }
    }
  }
}

TEST(CellEnergies, HaveHessiansThatAreTheSlopesOfTheirGradients) {
  std::mt19937_64 rng(20032);
  const Body body = odd_cells();
  for (const Law& law : laws(body)) {
    for (bool damped : {false, true}) {
      const Points past = crumpled(body, rng), x = crumpled(body, rng);
      const std::vector<PastPlace> history{{1.0, &past}};
      law.cells->set_damping(damped ? 0.7 : 0.0, history);
      for (int c = 0; c < 8; ++c) {
        CellPoints p = cell_points(x, body.mesh.cells[static_cast<std::size_t>(c)]);
        const CellStiffness hessian = law.cells->hessian(c, p);
        const double size = hessian.cwiseAbs().maxCoeff();
        EXPECT_LE((hessian - hessian.transpose()).cwiseAbs().maxCoeff(), 1e-14 * size) << law.name;
        for (Eigen::Index i = 0; i < 24; ++i) {
          const double h = 1e-6, at = p.data()[i];
          p.data()[i] = at + h;
          const CellVector up = law.cells->gradient(c, p);
          p.data()[i] = at - h;
          const CellVector down = law.cells->gradient(c, p);
          p.data()[i] = at;
          const CellVector slope = (up - down) / (2.0 * h);
          EXPECT_LE((hessian.col(i) - slope).cwiseAbs().maxCoeff(), 1e-7 * size) << law.name << " dof " << i;
        }
      }
    }
  }
}

TEST(CellEnergies, HaveASemidefinitePartThatIsTheHessianWhereThatIsSemidefinite) {
  std::mt19937_64 rng(20033);
  const Body body = odd_cells();
  for (const Law& law : laws(body)) {
    int indefinite = 0;
    for (const auto& [scale, amount] : {std::pair{1.0, 0.0}, {1.0, 0.15}, {0.5, 0.03}}) {
      const Points x = moved(scale * body.mesh.points, amount, rng);
      for (int c = 0; c < 8; ++c) {
        const CellPoints p = cell_points(x, body.mesh.cells[static_cast<std::size_t>(c)]);
        const CellStiffness hessian = law.cells->hessian(c, p), part = law.cells->semidefinite_hessian(c, p);
        const double size = hessian.cwiseAbs().maxCoeff();
        const double least = Eigen::SelfAdjointEigenSolver<CellStiffness>(part).eigenvalues()[0];
        EXPECT_GE(least, -1e-13 * size) << law.name;
        if (amount == 0.0) {
          EXPECT_LE((part - hessian).cwiseAbs().maxCoeff(), 1e-13 * size) << law.name;
        }
        indefinite += Eigen::SelfAdjointEigenSolver<CellStiffness>(hessian).eigenvalues()[0] < -1e-6 * size;
      }
    }
    EXPECT_GT(indefinite, 4) << law.name;  // otherwise the test above says nothing
  }
}

TEST(CellEnergies, RestFreeOfForceAndOfLinearStiffness) {
  const Body body = odd_cells();
  for (const Law& law : laws(body)) {
    if (law.name == "springs") continue;  // they have a Poisson ratio of their own; see below
    for (int c = 0; c < 8; ++c) {
      const auto i = static_cast<std::size_t>(c);
      const CellPoints p = cell_points(body.mesh.points, body.mesh.cells[i]);
      const CellStiffness linear = cell_stiffness(lattice::hex_corners(body.mesh.points, body.mesh.cells[i]),
                                                  body.fill[i], body.materials[i]);
      const double size = linear.cwiseAbs().maxCoeff();
      EXPECT_NEAR(law.cells->energy(c, p), 0.0, 1e-14 * size) << law.name;
      EXPECT_LE(law.cells->gradient(c, p).cwiseAbs().maxCoeff(), 1e-14 * size) << law.name;
      // Sums of a few hundred rounded products.
      EXPECT_LE((law.cells->hessian(c, p) - linear).cwiseAbs().maxCoeff(), 1e-13 * size) << law.name;
    }
  }
}

TEST(CellEnergies, DoNotSeeRigidMotion) {
  std::mt19937_64 rng(20034);
  const Body body = odd_cells();
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(2.5, Eigen::Vector3d(0.36, 0.48, 0.8)).toRotationMatrix();
  for (const Law& law : laws(body)) {
    const Points x = moved(body.mesh.points, 0.03, rng);
    const Points turned = (x * turn.transpose()).rowwise() + Eigen::RowVector3d(3.0, -4.0, 5.0);
    const std::vector<PastPlace> history{{1.0, &x}};
    law.cells->set_damping(0.7, history);  // from x to x turned nothing strains: no viscosity
    for (int c = 0; c < 8; ++c) {
      const CellPoints p = cell_points(x, body.mesh.cells[static_cast<std::size_t>(c)]),
                       q = cell_points(turned, body.mesh.cells[static_cast<std::size_t>(c)]);
      const double energy = law.cells->energy(c, p);
      EXPECT_NEAR(law.cells->energy(c, q), energy, 1e-12 * energy) << law.name;
      const CellVector before = law.cells->gradient(c, p), after = law.cells->gradient(c, q);
      for (Eigen::Index a = 0; a < 8; ++a) {
        EXPECT_LE((after.segment<3>(3 * a) - turn * before.segment<3>(3 * a)).norm(), 1e-12 * before.norm())
            << law.name;
      }
    }
  }
}

// Two laws that agree to second order in the strain: their energies differ by a part that falls like it.
TEST(CellEnergies, AgreeAtSmallStrain) {
  std::mt19937_64 rng(20035);
  const Body body = odd_cells();
  const auto neo = neo_hookean_cells(body), stvk = stvk_cells(body);
  const Points way = moved(Points::Zero(body.mesh.num_vertices(), 3), 0.1, rng);
  const auto difference = [&](double amount) {
    const Points x = body.mesh.points + amount * way;
    double a = 0.0, b = 0.0;
    for (int c = 0; c < 8; ++c) {
      const CellPoints p = cell_points(x, body.mesh.cells[static_cast<std::size_t>(c)]);
      a += neo->energy(c, p);
      b += stvk->energy(c, p);
    }
    return std::abs(a / b - 1.0);
  };
  EXPECT_LT(difference(1e-3), 1e-2);
  EXPECT_NEAR(std::log10(difference(1e-2) / difference(1e-3)), 1.0, 0.1);
}

/// Forces of all cells on the faces of a box that is stretched to diag(stretch) times itself; per face area
/// at rest: first Piola-Kirchhoff stress.
Eigen::Matrix3d nominal_stress(const CellEnergy& cells, const Body& body, const Eigen::Vector3d& stretch) {
  const Points x = body.mesh.points * stretch.asDiagonal();
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();  // sum f X^T = P V
  for (int c = 0; c < static_cast<int>(body.mesh.cells.size()); ++c) {
    const auto& cell = body.mesh.cells[static_cast<std::size_t>(c)];
    const CellVector f = cells.gradient(c, cell_points(x, cell));
    for (int a = 0; a < 8; ++a)
      moment += f.segment<3>(3 * a) * body.mesh.points.row(cell[static_cast<std::size_t>(a)]);
  }
  return moment / body.volume;
}

// Uniaxial tension and compression against the closed forms of the implemented energies: the width follows
// from the free sides, the pull from the width. 1e-9 of E, as the issue of a closed form is its formula, not
// its digits; measured below 1e-14.
TEST(StVK, PullsAsItsClosedFormSays) {
  const Body body = odd_cells(false);
  const auto cells = stvk_cells(body);
  for (double stretch : {0.6, 0.8, 0.99, 1.0, 1.01, 1.2, 1.5}) {
    const double strain = 0.5 * (stretch * stretch - 1.0);
    const double width = std::sqrt(1.0 - 2.0 * kPoisson * strain);
    const Eigen::Matrix3d p = nominal_stress(*cells, body, {stretch, width, width});
    EXPECT_NEAR(p(0, 0), stretch * kYoung * strain, 1e-9 * kYoung) << stretch;
    EXPECT_NEAR(p(1, 1), 0.0, 1e-9 * kYoung) << stretch;
    EXPECT_NEAR(p(2, 2), 0.0, 1e-9 * kYoung) << stretch;
    EXPECT_NEAR(p(0, 1), 0.0, 1e-9 * kYoung) << stretch;
  }
}

TEST(NeoHookean, PullsAsItsClosedFormSays) {
  const Body body = odd_cells(false);
  const auto cells = neo_hookean_cells(body);
  const double mu = kYoung / (2.0 * (1.0 + kPoisson)), bulk = kYoung / (3.0 * (1.0 - 2.0 * kPoisson));
  for (double stretch : {0.3, 0.6, 0.99, 1.0, 1.01, 1.5, 3.0}) {
    // Free sides: mu t + q J / t = 0 with q = d psi / d J = -mu + (mu/3 + bulk) (J - 1) and J = stretch t^2.
    const double j = 1.0 + mu * (1.0 - 1.0 / stretch) / (bulk + mu / 3.0);
    const double width = std::sqrt(j / stretch);
    const double q = -mu / stretch;
    const Eigen::Matrix3d p = nominal_stress(*cells, body, {stretch, width, width});
    EXPECT_NEAR(p(0, 0), mu * stretch + q * width * width, 1e-9 * kYoung) << stretch;
    EXPECT_NEAR(p(1, 1), 0.0, 1e-9 * kYoung) << stretch;
    EXPECT_NEAR(p(2, 2), 0.0, 1e-9 * kYoung) << stretch;
  }
}

// The curves once more with nothing but the pull given away: the width at which the sides are free is sought.
TEST(NonlinearCells, FindTheirWidthAndPullInUniaxialTension) {
  const Body body = odd_cells(false);
  const double mu = kYoung / (2.0 * (1.0 + kPoisson)), bulk = kYoung / (3.0 * (1.0 - 2.0 * kPoisson));
  const auto pull_of = [&](const CellEnergy& cells, double stretch) {
    double low = 0.7, high = 1.3;  // the sides push outwards at the first and pull at the second
    for (int k = 0; k < 60; ++k) {
      const double width = 0.5 * (low + high);
      (nominal_stress(cells, body, {stretch, width, width})(1, 1) < 0.0 ? low : high) = width;
    }
    return nominal_stress(cells, body, {stretch, low, low})(0, 0);
  };
  for (double stretch : {0.8, 0.95, 1.05, 1.3, 1.5}) {
    const double strain = 0.5 * (stretch * stretch - 1.0);
    EXPECT_NEAR(pull_of(*stvk_cells(body), stretch), kYoung * stretch * strain, 1e-9 * kYoung) << stretch;
    const double j = 1.0 + mu * (1.0 - 1.0 / stretch) / (bulk + mu / 3.0);
    EXPECT_NEAR(pull_of(*neo_hookean_cells(body), stretch), mu * (stretch - j / (stretch * stretch)),
                1e-9 * kYoung)
        << stretch;
  }
}

TEST(NeoHookean, HasAFiniteForceInAnyShape) {
  std::mt19937_64 rng(20036);
  const Body body = odd_cells();
  const auto cells = neo_hookean_cells(body);
  for (double amount : {0.0, 1.0, 1e3}) {
    const Points x = moved(amount * body.mesh.points, amount, rng);  // the first: all in one point
    for (int c = 0; c < 8; ++c) {
      const CellPoints p = cell_points(x, body.mesh.cells[static_cast<std::size_t>(c)]);
      EXPECT_TRUE(cells->gradient(c, p).allFinite());
      EXPECT_TRUE(cells->semidefinite_hessian(c, p).allFinite());
      EXPECT_GE(cells->energy(c, p), 0.0);
    }
  }
}

TEST(Springs, MatchTheModulusInCubesExactly) {
  CellPoints cube;
  for (int a = 0; a < 8; ++a) {
    for (int c = 0; c < 3; ++c)
      cube(c, a) = 0.1 * lattice::kCorners[static_cast<std::size_t>(a)][static_cast<std::size_t>(c)];
  }
  const std::vector<Spring> springs = matched_springs(cube, 1e-3, kYoung);
  EXPECT_EQ(springs.size(), 24u);
  for (const Spring& s : springs) {
    // A quarter of 2/5 E a on an edge, half of it on a face diagonal.
    const bool edge = s.length < 0.11;
    EXPECT_NEAR(s.stiffness, (edge ? 0.1 : 0.2) * kYoung * 0.1, 1e-9 * kYoung) << s.a << " " << s.b;
  }
}

// nu = 1/4: pulled by 1e-6 and narrowed by a quarter of that, the sides must be free and the pull E.
TEST(Springs, StretchWithTheModulusWhateverTheMaterialsPoissonRatio) {
  for (bool cubes : {true, false}) {
    tests::BarOptions options;
    // Cells of 1 : 1 : 1, and of 1.25 : 1 : 0.8.
    const Eigen::Vector3d size = cubes ? Eigen::Vector3d(1, 1, 1) : Eigen::Vector3d(1.25, 1.0, 0.8);
    options.box = {{0, 0, 0}, size, {1, 1, 1}, lattice::CellType::Hexahedron, {}};
    options.material = {kYoung, kPoisson, 1000.0};
    const Body body = tests::bar_body(options);
    const auto cells = spring_cells(body);
    for (int axis = 0; axis < 3; ++axis) {
      const double pull = 1e-6;
      Eigen::Vector3d stretch = Eigen::Vector3d::Constant(1.0 - kSpringPoisson * pull);
      stretch[axis] = 1.0 + pull;
      const Eigen::Matrix3d p = nominal_stress(*cells, body, stretch) / (kYoung * pull);
      Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
      expected(axis, axis) = 1.0;
      // A second order of 1e-6 in the stretch, and the fit's own millionth.
      EXPECT_LE((p - expected).cwiseAbs().maxCoeff(), cubes ? 2e-6 : 2e-5) << axis << "\n" << p;
    }
  }
}

}  // namespace
}  // namespace sinew::fem
