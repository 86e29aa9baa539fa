// Every rung against independent answers and against the rung above it.
#include <cmath>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "fem/equilibrium.h"
#include "fem/simulation.h"
#include "tests/fem/arm.h"
#include "tests/fem/bar.h"

namespace sinew::fem {
namespace {

using lattice::Points;
using tests::kDegree;

PosePath still() { return held_pose({Eigen::Affine3d::Identity()}); }

/// The reference bar at `levels`: 10 x 2 x 2 leaf cells on level 1, twice as many each way on the next.
Body reference_bar(int levels, double young, double poisson) {
  tests::BarOptions options;
  options.levels = levels;
  options.material = {young, poisson, 1000.0};
  return tests::bar_body(options);
}

Equilibrium hanging(const Body& body, const std::string& model, double gravity = 9.81) {
  EquilibriumOptions options;
  options.model = model;
  options.gravity = {0.0, 0.0, -gravity};
  return find_equilibrium(body, still(), options);
}

// Reference values of README.md, E = 1e6 Pa, nu = 0.3, from CalculiX with quadratic elements: St.
// Venant-Kirchhoff (-0.06964, -0.34565) with a band of 3e-4, neo-Hookean (-0.0665, -0.3463) with 6e-4. Its
// neo-Hookean law splits volume and shape in another way than ours; at the strains of this bar, 10 %, the two
// differ by less than its band. 20 x 4 x 4 linear cells are 0.9 and 1.1 % too stiff, 30 x 6 x 6 within 1 %.
TEST(ReferenceBar, BendsAtFiniteStrainAsIndependentCodesSay) {
  tests::BarOptions options;
  options.box.blocks = {15, 3, 3};  // 30 x 6 x 6 cells on level 1
  options.material = {1e6, 0.3, 1000.0};
  const Body body = tests::bar_body(options);
  const int tip = tests::vertex_at(body, {1.0, 0.0, 0.0});
  const std::map<std::string, Eigen::Vector2d> exact{{"stvk", {-0.06964, -0.34565}},
                                                     {"neo-hookean", {-0.0665, -0.3463}}};
  for (const auto& [model, expected] : exact) {
    const Equilibrium rest = hanging(body, model);
    ASSERT_TRUE(rest.report.ok()) << rest.report.message;
    const Eigen::RowVector3d u = rest.x.row(tip) - body.mesh.points.row(tip);
    EXPECT_NEAR(u[2], expected[1], 0.01 * std::abs(expected[1])) << model;
    EXPECT_NEAR(u[0], expected[0], 0.02 * std::abs(expected[0])) << model;  // second order in the sag
    EXPECT_NEAR(u[1], 0.0, 1e-9) << model;  // the bar and its load are symmetric
  }
}

// Linear cells lock where flesh keeps its volume unless they share their dilatation; here the sag stays
// within what the sag itself depends on nu (converged: -3.669 and -3.636 at 0.45 and 0.49).
TEST(NeoHookean, DoesNotLockWhereFleshKeepsItsVolume) {
  std::map<double, double> sag;
  for (double poisson : {0.3, 0.45, 0.49, 0.499}) {
    const Body body = reference_bar(1, 1e6, poisson);
    const Equilibrium rest = hanging(body, "neo-hookean");
    ASSERT_TRUE(rest.report.ok()) << rest.report.message;
    const int tip = tests::vertex_at(body, {1.0, 0.0, 0.0});
    sag[poisson] = rest.x(tip, 2);
  }
  EXPECT_NEAR(sag[0.49] / sag[0.45], 1.0, 0.03);
  EXPECT_NEAR(sag[0.499] / sag[0.45], 1.0, 0.04);
}

/// An elbow held at an angle: the skin of every rung.
struct Elbow {
  tests::Arm arm = tests::make_arm();
  Body body;
  double degrees;

  explicit Elbow(double angle) : body(tests::arm_body(arm, angle * kDegree)), degrees(angle) {}

  Points skin(const std::string& model) const {
    EquilibriumOptions options;
    options.model = model;
    options.gravity.setZero();
    options.steps = 6;
    const Equilibrium rest = find_equilibrium(
        body, [&](double factor) { return tests::arm_pose(factor * degrees * kDegree); }, options);
    EXPECT_TRUE(rest.report.ok()) << model << ": " << rest.report.message;
    return body.skin.weights * rest.x;
  }
};

double rms_percent(const Points& a, const Points& b) {  // the arm is 1 m long
  return 100.0 * std::sqrt((a - b).squaredNorm() / static_cast<double>(a.rows()));
}

// Distance of a held elbow's skin from neo-Hookean flesh on the same lattice, rms in % of the arm's length.
// Measured at 60 and 120 degrees: skin 1.14 and 1.47 (it has the bones' shape, not the flesh's), springs 1.28
// at 60, blended 0.55 and 4.13, blended-stiffness 0.17 and 2.12, corotational 0.17 and 0.33. Bounds a tenth
// above.
TEST(Ladder, EachRungIsAsCloseToNeoHookeanAsPublished) {
  struct Bound {
    std::string model;
    double at_60, at_120;
  };
  const std::vector<Bound> bounds{{"skin", 1.3, 1.7},
                                  {"blended", 0.61, 4.6},
                                  {"blended-stiffness", 0.19, 2.4},
                                  {"corotational", 0.19, 0.37}};
  for (double degrees : {60.0, 120.0}) {
    const Elbow elbow(degrees);
    const Points exact = elbow.skin("neo-hookean");
    for (const Bound& bound : bounds) {
      const double error = rms_percent(elbow.skin(bound.model), exact);
      EXPECT_LT(error, degrees < 90.0 ? bound.at_60 : bound.at_120) << bound.model << " at " << degrees;
    }
    // Springs have a Poisson ratio of their own, and at 120 degrees the inside of the elbow folds.
    if (degrees < 90.0) {
      EXPECT_LT(rms_percent(elbow.skin("springs"), exact), 1.5);
    }
  }
}

// A bar whose ends are turned against each other, in opposite directions: it is its own mirror image in the
// plane between the ends, and its centre moves along the bisector.
TEST(Ladder, ABentBarIsItsOwnMirrorImage) {
  tests::BarOptions bar;
  bar.box.min = {0.0, -0.1, -0.1};
  bar.box.blocks = {6, 1, 1};
  bar.held = [](const Eigen::Vector3d& x) { return x[0] < 1e-9 || x[0] > 1.0 - 1e-9; };
  Body body = tests::bar_body(bar);
  for (BoneVertex& vertex : body.bones.vertices) {  // the far end on a joint of its own
    if (vertex.x_a[0] > 0.5) vertex.joint_a = vertex.joint_b = 1;
  }
  const PosePath path = [](double factor) {
    const Eigen::Vector3d far(1.0, 0.0, 0.0), axis = Eigen::Vector3d::UnitZ();
    const double angle = 30.0 * kDegree * factor;
    return std::vector<Eigen::Affine3d>{
        Eigen::Affine3d(Eigen::AngleAxisd(angle, axis)),
        Eigen::Translation3d(far) * Eigen::AngleAxisd(-angle, axis) * Eigen::Translation3d(-far)};
  };
  for (const std::string model : {"springs", "corotational", "stvk", "neo-hookean"}) {
    EquilibriumOptions options;
    options.model = model;
    options.gravity.setZero();
    const Equilibrium rest = find_equilibrium(body, path, options);
    ASSERT_TRUE(rest.report.ok()) << rest.report.message;
    // The rest tolerance of 1e-10 of the forces, on positions of size 1.
    for (int a = 0; a < body.mesh.num_vertices(); ++a) {
      const Eigen::RowVector3d x = body.mesh.points.row(a);
      const Eigen::RowVector3d across = rest.x.row(tests::vertex_at(body, {1.0 - x[0], x[1], x[2]})),
                               below = rest.x.row(tests::vertex_at(body, {x[0], x[1], -x[2]}));
      EXPECT_LE((rest.x.row(a) - Eigen::RowVector3d(1.0 - across[0], across[1], across[2])).norm(), 1e-9)
          << model;
      EXPECT_LE((rest.x.row(a) - Eigen::RowVector3d(below[0], below[1], -below[2])).norm(), 1e-9) << model;
    }
    const Eigen::RowVector3d centre = rest.x.row(tests::vertex_at(body, {0.5, 0.0, 0.0}));
    EXPECT_NEAR(centre[0], 0.5, 1e-9) << model;
    EXPECT_NEAR(centre[2], 0.0, 1e-9) << model;
    EXPECT_GT(centre[1], 0.05) << model;
  }
}

// A jolt that Newton's method cannot follow in one step: the step is halved until it can, and the run goes
// on.
TEST(Ladder, HalvesAStepThatFailsAndRecovers) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 90 * kDegree);
  SimulationOptions options;
  options.model = "neo-hookean";
  options.largest_turn = 10.0;  // rad: no sub-steps for fast frames
  options.step = 1.0 / 30.0;
  const Motion motion = [](double time) {
    return tests::arm_pose(90.0 * kDegree * tests::smooth_step(10.0 * time));
  };
  Simulation simulation(body, motion, 0.0, options);
  const SimulationReport report = simulation.advance_to(0.3);
  EXPECT_EQ(report.status, SimulationStatus::Ok) << report.message;
  EXPECT_TRUE(simulation.state().x.allFinite());
  EXPECT_EQ(simulation.measures_at(0.3).inverted_cells, 0);
}

}  // namespace
}  // namespace sinew::fem
