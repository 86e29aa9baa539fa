// Statics of every model: patch tests, rigid motion, closed forms through the solver, loads, failure.
#include "fem/time/equilibrium.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fem/models/balance.h"
#include "fem/models/detail/springs.h"
#include "fem/report/cell_report.h"
#include "fem/time/simulation.h"
#include "tests/fem/arm.h"
#include "tests/fem/bar.h"

namespace sinew::fem {
namespace {

using lattice::Points;
using tests::kDegree;

const std::vector<std::string> kElastic{"springs",      "blended", "blended-stiffness",
                                        "corotational", "stvk",    "neo-hookean"};

double largest_distance(const Points& a, const Points& b) { return (a - b).rowwise().norm().maxCoeff(); }

EquilibriumOptions without_gravity(const std::string& model) {
  EquilibriumOptions options;
  options.model = model;
  options.gravity.setZero();
  return options;
}

/// From rest to `end`, linear in the map: fine where nothing turns.
PosePath straight(const Eigen::Affine3d& end) {
  return [end](double factor) {
    Eigen::Affine3d map = Eigen::Affine3d::Identity();
    map.matrix() += factor * (end.matrix() - map.matrix());
    return std::vector<Eigen::Affine3d>{map};
  };
}

/// A box whose whole boundary is held, inside vertices moved off the grid.
Body patch(const std::string& model) {
  tests::BarOptions options;
  options.box = {{0, 0, 0}, {1.0, 0.8, 0.6}, {2, 2, 2}, lattice::CellType::Hexahedron, {}};
  options.material = {2e4, 0.45, 1000.0};
  const Eigen::Vector3d size = options.box.max;
  const auto inside = [size](const Eigen::Vector3d& x) {
    return (x.array() > 1e-9).all() && (x.array() < size.array() - 1e-9).all();
  };
  options.held = [inside](const Eigen::Vector3d& x) { return !inside(x); };
  // Springs carry a constant strain between cells of one shape only.
  if (model != "springs") {
    options.distort = [inside](const Eigen::Vector3d& x) -> Eigen::Vector3d {
      return inside(x) ? x + Eigen::Vector3d(0.1, -0.07, 0.05) : x;
    };
  }
  return tests::bar_body(options);
}

// A constant deformation of the boundary must go through the inside: a stretch of 5 % and a shear of 3 %, at
// the size that small strain in a rotated frame still means.
TEST(EveryModel, PassesThePatchTest) {
  Eigen::Affine3d map = Eigen::Affine3d::Identity();
  map.linear() << 1.05, 0.03, 0.0, 0.03, 0.98, 0.01, 0.0, 0.01, 1.02;
  map.translation() << 0.3, -0.2, 0.1;
  for (const std::string& model : kElastic) {
    const Body body = patch(model);
    const Equilibrium rest = find_equilibrium(body, straight(map), without_gravity(model));
    ASSERT_TRUE(rest.report.ok()) << model << ": " << rest.report.message;
    EXPECT_EQ(rest.load_factor, 1.0);
    const Points expected =
        (body.mesh.points * map.linear().transpose()).rowwise() + map.translation().transpose();
    EXPECT_LE(largest_distance(rest.x, expected), 1e-10) << model;  // rest tolerance of 1e-10
  }
}

// A body that turns as a whole by any angle keeps its shape and has no energy.
TEST(EveryModel, TurnsAsARigidBody) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 60 * kDegree);
  for (const ModelInfo& info : models()) {
    const std::string model(info.name);
    const PosePath path = [](double factor) {
      Eigen::Affine3d base(Eigen::AngleAxisd(3.0 * factor, Eigen::Vector3d(0.36, 0.48, 0.8)));
      base.pretranslate(factor * Eigen::Vector3d(30.0, -20.0, 10.0));
      return tests::arm_pose(0.0, base);
    };
    const Equilibrium rest = find_equilibrium(body, path, without_gravity(model));
    ASSERT_TRUE(rest.report.ok()) << model << ": " << rest.report.message;
    const Eigen::Affine3d base = path(1.0)[0];
    const Points expected =
        (body.mesh.points * base.linear().transpose()).rowwise() + base.translation().transpose();
    // Rounding of positions of size 40, amplified by what stiffness and ties divide.
    EXPECT_LE(largest_distance(rest.x, expected), 1e-11) << model;
    const std::unique_ptr<Model> instance = info.make(body, {});
    const CellForces forces = instance->cell_forces(rest.x, rest.pose);
    for (double energy : forces.energy) EXPECT_LE(energy, 1e-12) << model;
  }
}

// Both ends of a bar held at the closed form's width: the inside must find the homogeneous solution, and the
// ends' reactions are the closed form's pull.
TEST(NonlinearModels, StretchABarAsTheirClosedFormsSay) {
  constexpr double kYoung = 1e5, kNu = 0.3, kMu = kYoung / 2.6, kBulk = kYoung / 1.2;
  struct Form {
    double width, pull;
  };
  const auto stvk = [](double s) -> Form {
    const double strain = 0.5 * (s * s - 1.0);
    return {std::sqrt(1.0 - 2.0 * kNu * strain), s * kYoung * strain};
  };
  const auto neo = [](double s) -> Form {
    const double j = 1.0 + kMu * (1.0 - 1.0 / s) / (kBulk + kMu / 3.0), width = std::sqrt(j / s);
    return {width, kMu * s - kMu / s * width * width};
  };
  tests::BarOptions options;
  options.box.min = {0.0, 0.0, 0.0};
  options.box.max = {1.0, 0.2, 0.2};
  options.held = [](const Eigen::Vector3d& x) { return x[0] < 1e-9 || x[0] > 1.0 - 1e-9; };
  const Body body = tests::bar_body(options);
  for (const std::string& model : {std::string("stvk"), std::string("neo-hookean")}) {
    for (double stretch : {0.9, 0.95, 1.1, 1.5}) {
      const Form form = model == "stvk" ? stvk(stretch) : neo(stretch);
      Eigen::Affine3d map = Eigen::Affine3d::Identity();
      map.linear().diagonal() << stretch, form.width, form.width;
      const Equilibrium rest = find_equilibrium(body, straight(map), without_gravity(model));
      ASSERT_TRUE(rest.report.ok()) << model << " " << stretch << ": " << rest.report.message;
      EXPECT_LE(largest_distance(rest.x, body.mesh.points * map.linear()), 1e-9) << model << " " << stretch;
      const std::unique_ptr<Model> instance = find_model(model)->make(body, {});
      const auto cells = report_cells(body, *instance, rest.x, rest.pose);
      const double area = form.width * form.width;
      for (const CellReport& cell : cells) {
        EXPECT_NEAR(cell.stress(0, 0), form.pull / area, 1e-9 * kYoung) << model << " " << stretch;
        EXPECT_NEAR(cell.stress(1, 1), 0.0, 1e-9 * kYoung);
        EXPECT_NEAR(cell.von_mises, std::abs(form.pull) / area, 1e-9 * kYoung);
        EXPECT_NEAR(cell.strain(0, 0), 0.5 * (stretch * stretch - 1.0), 1e-9);
      }
    }
  }
}

/// The clamped bar of reference/, loaded at its tip.
Body short_bar() {
  tests::BarOptions options;
  options.material = {1e6, 0.3, 1000.0};
  return tests::bar_body(options);
}

// Loads with one resultant, told in four ways, and small: linear elasticity does not ask how.
TEST(Loads, AddUpToTheirResultants) {
  const Body body = short_bar();
  Loads loads;
  loads.points = {{{1.0, 0.03, -0.02}, {0.0, 0.0, -2.0}}, {{0.5, 0.0, 0.0}, {1.0, 0.0, 0.0}}};
  loads.bodies = {{{0.0, 50.0, 0.0}}};
  loads.tractions = {{{{1.0, -0.1, -0.1}, {1.0, 0.1, 0.1}}, {0.0, 0.0, 100.0}}};
  loads.pressures = {{{{0.0, -0.1, 0.1}, {1.0, 0.1, 0.1}}, 10.0}};
  const LoadForces forces(body, loads);
  EXPECT_TRUE(forces.follow());
  const Points f = forces.at(body.mesh.points);
  // 1 N along x; 50 N/m^3 times 0.04 m^3; -2 N, 100 Pa times 0.04 m^2 and -10 Pa times 0.2 m^2.
  EXPECT_LE((f.colwise().sum() - Eigen::RowVector3d(1.0, 2.0, -2.0 + 4.0 - 2.0)).norm(), 1e-12);
  // The point load's moment is its own, not the nearest vertex's: trilinear weights reproduce its place.
  Loads point;
  point.points = {loads.points[0]};
  const Points g = LoadForces(body, point).at(body.mesh.points);
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (Eigen::Index a = 0; a < g.rows(); ++a)
    moment += Eigen::Vector3d(body.mesh.points.row(a)).cross(Eigen::Vector3d(g.row(a)));
  EXPECT_LE((moment - Eigen::Vector3d(1.0, 0.03, -0.02).cross(Eigen::Vector3d(0, 0, -2.0))).norm(), 1e-12);
}

TEST(Loads, PressTheSameAllRoundWithoutAnyResultant) {
  const Body body = short_bar();
  Loads loads;
  loads.pressures = {{{{0.0, -0.1, -0.1}, {1.0, 0.1, 0.1}}, 1e3}};
  const LoadForces forces(body, loads);
  Points x = body.mesh.points;
  for (Eigen::Index a = 0; a < x.rows(); ++a) {  // any shape of a closed surface
    x(a, 2) += 0.3 * x(a, 0) * x(a, 0) + 0.1 * x(a, 1);
  }
  const Points f = forces.at(x);
  EXPECT_GT(f.norm(), 1.0);
  EXPECT_LE(f.colwise().sum().norm(), 1e-12 * f.norm());
  // The work of a small blow-up by d is -p times the change of volume.
  const double work = f.cwiseProduct(x).sum();  // d x = x: dV = 3 V
  double volume = 0.0;
  for (const auto& cell : body.mesh.cells) {
    for (int q = 0; q < 8; ++q)
      volume +=
          lattice::trilinear_jacobian(lattice::hex_corners(x, cell), gauss_point(q)).determinant() / 8.0;
  }
  EXPECT_NEAR(work, -1e3 * 3.0 * volume, 1e-9 * std::abs(work));
}

TEST(Loads, NameWhatIsNotThere) {
  const Body body = short_bar();
  const auto refusal = [&](const Loads& loads) -> std::string {
    try {
      LoadForces forces(body, loads);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "accepted";
  };
  Loads outside, nowhere, broken;
  outside.points = {{{0.5, 0.0, 0.0}, {1, 0, 0}}, {{2.0, 0.0, 0.0}, {1, 0, 0}}};
  nowhere.pressures = {{{{0.01, 0, 0}, {0.02, 0, 0}}, 1.0}};
  broken.bodies = {{{0.0, std::nan(""), 0.0}}};
  EXPECT_EQ(refusal(outside), "point load 2: (2, 0, 0) lies outside the lattice");
  EXPECT_EQ(refusal(nowhere), "pressure: no face of the lattice's boundary lies in its box");
  EXPECT_THAT(refusal(broken), testing::HasSubstr("body load: got nan"));
}

// A millionth of the load that bends visibly: all models must give the linear answer (springs at their own
// Poisson ratio, which is the material's here).
TEST(EveryModel, SagsLinearlyUnderASmallWeight) {
  tests::BarOptions bar;
  bar.material = {1e6, kSpringPoisson, 1000.0};
  const Body body = tests::bar_body(bar);
  const Eigen::Vector3d gravity(0.0, 0.0, -9.81e-6);
  const Points linear = tests::static_displacement(body, tests::gravity_force(body, gravity));
  const int tip = tests::vertex_at(body, {1.0, 0.0, 0.0});
  for (const std::string& model : kElastic) {
    EquilibriumOptions options = without_gravity(model);
    options.gravity = gravity;
    const Equilibrium rest = find_equilibrium(body, held_pose({Eigen::Affine3d::Identity()}), options);
    ASSERT_TRUE(rest.report.ok()) << model << ": " << rest.report.message;
    const double sag = rest.x(tip, 2), expected = linear(tip, 2);
    // Springs bend as their own lattice does: measured 18 % less than finite elements on two cells across.
    const double share = model == "springs" ? 0.2 : 1e-5;
    EXPECT_NEAR(sag, expected, share * std::abs(expected)) << model;
  }
}

// One region is a linear body whatever its stiffness: the bar's own deflection, of up to 40 lengths.
TEST(Blended, RestsWhereTheLinearBodyDoesHoweverSoft) {
  for (double young : {1e4, 1e5, 1e9}) {
    tests::BarOptions bar;
    bar.material = {young, 0.3, 1000.0};
    const Body body = tests::bar_body(bar);
    EquilibriumOptions options = without_gravity("blended");
    options.gravity = {0.0, 0.0, -9.81};
    const Equilibrium rest = find_equilibrium(body, held_pose({Eigen::Affine3d::Identity()}), options);
    ASSERT_TRUE(rest.report.ok()) << rest.report.message;
    const Points u = tests::static_displacement(body, tests::gravity_force(body, options.gravity));
    // Rounding times the condition of K, 1e5.
    EXPECT_LE(largest_distance(rest.x, body.mesh.points + u), 1e-9 * u.norm()) << young;
  }
}

// Several regions rest where a run comes to rest by itself, with the steps that the search assumes.
TEST(Blended, RestsWhereARunSettles) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 90 * kDegree);
  SimulationOptions run;
  run.model = "blended";
  run.integrator = Integrator::BackwardEuler;
  run.settle_limit = 20.0;
  run.settle_speed = 1e-10;
  Simulation simulation(
      body, [](double) { return tests::arm_pose(90 * kDegree); }, 0.0, run);
  ASSERT_EQ(simulation.settle().status, SimulationStatus::Ok);
  EquilibriumOptions options;
  options.model = "blended";
  const Equilibrium rest = find_equilibrium(
      body, [](double factor) { return tests::arm_pose(90 * kDegree * factor); }, options);
  ASSERT_TRUE(rest.report.ok()) << rest.report.message;
  // Settled at 1e-10 m/s, at rates of some 10 per second.
  EXPECT_LE(largest_distance(rest.x, simulation.flesh().x), 1e-9);
}

TEST(Equilibrium, TellsWhatItReachesAndStopsWhereItIsToldTo) {
  const Body body = tests::bar_body({});
  EquilibriumOptions options;
  options.model = "neo-hookean";
  options.steps = 8;
  std::vector<double> reached;
  options.before_step = [&](double factor) { reached.push_back(factor); };
  const PosePath still = held_pose({Eigen::Affine3d::Identity()});
  const Equilibrium whole = find_equilibrium(body, still, options);
  ASSERT_TRUE(whole.report.ok()) << whole.report.message;
  ASSERT_EQ(static_cast<int>(reached.size()), whole.load_steps);
  EXPECT_EQ(reached.front(), 0.0);
  EXPECT_EQ(reached[1], 0.125);
  EXPECT_TRUE(std::is_sorted(reached.begin(), reached.end()));
  options.before_step = [](double factor) {
    if (factor > 0.0) throw std::runtime_error("enough");
  };
  EXPECT_THROW(static_cast<void>(find_equilibrium(body, still, options)), std::runtime_error);
}

// The lower bone pushed along the arm through its own joint, and drawn to nine times its length: in both,
// cells turn inside out, where their rotations jump from one place to the next. The forces balance
// nevertheless.
TEST(Corotational, ComesToRestWithCellsTurnedInsideOut) {
  const tests::Arm arm = tests::make_arm(lattice::CellType::Hexahedron, 0, 2);
  fem::BodyOptions body_options;
  body_options.levels = 0;
  const Body body = tests::arm_body(arm, 0.0, body_options);
  for (double along : {-0.7, 4.0}) {
    const PosePath path = [along](double factor) {
      std::vector<Eigen::Affine3d> pose = tests::arm_pose(0.0);
      for (std::size_t joint : {1, 2}) pose[joint].pretranslate(factor * along * Eigen::Vector3d::UnitX());
      return pose;
    };
    const EquilibriumOptions options = without_gravity("corotational");
    const Equilibrium rest = find_equilibrium(body, path, options);
    ASSERT_TRUE(rest.report.ok()) << along << ": " << rest.report.message;
    EXPECT_EQ(rest.load_factor, 1.0);
    EXPECT_LE(rest.report.residual, 1e-10);
    EXPECT_LT(least_stretch(body, rest.x).stretch, 0.0) << "no cell is inside out";
  }
}

// The soft bar of the reference under its full weight: St. Venant-Kirchhoff has no answer beyond 0.465 g.
TEST(StVK, SaysWhereASoftBarCollapses) {
  tests::BarOptions bar;
  bar.material = {1e5, 0.3, 1000.0};
  const Body body = tests::bar_body(bar);
  EquilibriumOptions options = without_gravity("stvk");
  options.gravity = {0.0, 0.0, -9.81};
  options.max_halvings = 5;
  const Equilibrium rest = find_equilibrium(body, held_pose({Eigen::Affine3d::Identity()}), options);
  EXPECT_EQ(rest.report.status, SolveStatus::NoConvergence);
  EXPECT_GT(rest.load_factor, 0.3);
  EXPECT_LT(rest.load_factor, 0.6);
  EXPECT_GE(rest.report.cell, 0);
  EXPECT_THAT(
      rest.report.message,
      testing::MatchesRegex("stvk: .*leaf cell [0-9]+ of 'base' .*; no rest beyond load factor 0\\..*"));
  EXPECT_TRUE(rest.x.allFinite());
}

}  // namespace
}  // namespace sinew::fem
