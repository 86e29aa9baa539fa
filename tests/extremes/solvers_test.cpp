// Tolerances, choices of solvers, threads, single precision and symmetry.

#include <stdexcept>

#include <tbb/global_control.h>

#include "assets/pc2.h"
#include "fem/body/placement.h"
#include "fem/models/detail/green_strain.h"
#include "fem/models/detail/neo_hookean.h"
#include "fem/models/detail/newton_model.h"
#include "fem/models/detail/rotated_model.h"
#include "fem/models/detail/springs.h"
#include "tests/extremes/extremes.h"

namespace sinew::tests {
namespace {

/// A model at rest to a tolerance. `stale_after`: of the rungs that have a stale preconditioner.
std::unique_ptr<fem::Model> model_with(const std::string& rung, const Body& body, double tolerance,
                                       int stale_after = 15) {
  fem::NewtonOptions newton;
  newton.rest_tolerance = tolerance;
  if (rung == "springs") return fem::make_newton_model(rung, body, fem::spring_cells(body), newton);
  if (rung == "neo-hookean") return fem::make_newton_model(rung, body, fem::neo_hookean_cells(body), newton);
  if (rung == "stvk")
    return fem::make_newton_model(rung, body, std::make_unique<fem::GreenStrainEnergy>(body, 1.0), newton);
  fem::RotatedOptions rotated;
  rotated.rest_tolerance = tolerance;
  rotated.stale_after = stale_after;
  const fem::CellRotations rotations =
      rung == "corotational"
          ? fem::CellRotations([polar = fem::PolarRotations(body)](const Points& x, const fem::PosedFrames&) {
              return polar(x);
            })
          : fem::CellRotations([&body](const Points&, const fem::PosedFrames& pose) {
              return fem::frame_rotations(body, pose);
            });
  return fem::make_rotated_model(rung, body, rotations, rotated);
}

// The looser, the farther off; where rounding rules, a tighter tolerance ends all the same and says so.
TEST(Extremes, X29TolerancesOfNewtonsMethod) {
  ExtremesTable table("X29",
                      "Tolerances of 1e-2 to 1e-14: the error falls with them until round-off, where a solve "
                      "ends well as stagnated.");
  table.excuse("blended", "it has none: one direct solve");
  const Body body = short_bar({1e5, 0.45, 1000.0}, kDamped);
  const fem::PosedFrames pose = fem::pose_frames(body.tree, still_base(0.0), 0.0);
  for (const std::string& rung : dynamic_rungs()) {
    if (rung == "blended") continue;
    const auto rest = [&](double tolerance, bool told) {
      fem::PoseProblem problem;
      problem.pose = &pose;
      problem.gravity = kWeight;
      Extreme run;
      run.x = body.mesh.points;
      const fem::SolveReport report = model_with(rung, body, tolerance)->equilibrate(problem, run.x);
      run.ok = report.ok();
      run.failure = report.message;
      if (!told) return run.x;
      table.add(fmt::format("tolerance {:g}", tolerance), rung, run);
      if (!report.message.empty()) {
        EXPECT_EQ(report.message, fem::kStagnated) << rung;
        table.note("stagnated at round-off, residual", report.residual);
      }
      return run.x;
    };
    const Points exact = rest(1e-13, false);
    double before = 1.0;
    for (double tolerance : {1e-2, 1e-4, 1e-6, 1e-8, 1e-14, 1e-17}) {
      const double error = distance(rest(tolerance, true), exact);
      table.at_most("error", error, std::max(before, 1e-12));
      before = error;
    }
  }
}

TEST(Extremes, X30ThreadsOneToSixtyFourGiveTheSameBits) {
  ExtremesTable table("X30", "1 to 64 threads: the same bits.");
  const Arm arm = small_arm();
  const Body body = small_arm_body(arm, 60 * kDegree);
  const Motion motion = [](double time) { return arm_pose(60 * kDegree * smooth_step(2.0 * time)); };
  for (const std::string& rung : dynamic_rungs()) {
    Points one;
    for (std::size_t threads : {1, 2, 4, 16, 64}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      const Extreme run = run_extreme({body, motion, extreme_options(rung, kFrame, kWeight), 15});
      table.add(fmt::format("{} threads", threads), rung, run);
      if (threads == 1) one = run.x;
      EXPECT_TRUE(one == run.x) << rung << ", " << threads << " threads";
    }
  }
}

// Every choice that a solver leaves, against the default: bases, precisions, stale and fresh preconditioners.
TEST(Extremes, X30ChoicesOfTheSolverGiveOneAnswer) {
  ExtremesTable table("X30-choices",
                      "Bases, factors in float and in 16 bits, fresh or stale preconditioners: within ten "
                      "times the tolerance (1e-10 of the forces at rest; 1e-5 and 1e-4 of the size for "
                      "float and short factors).");
  table.excuse("springs, stvk, neo-hookean", "they have no choice: a fresh factor in every iteration");
  const Arm arm = small_arm();
  const Body body = small_arm_body(arm, 60 * kDegree), bar = short_bar(kFirm, kDamped);
  const Motion motion = [](double time) { return arm_pose(60 * kDegree * smooth_step(2.0 * time)); };
  const Motion jerk = [](double time) -> std::vector<Eigen::Affine3d> {
    return {Eigen::Affine3d(Eigen::Translation3d(0.0, time > 0.1 ? 0.2 : 0.0, 0.0))};
  };
  const auto run = [&](const std::string& setting, const fem::SolverOptions& solver) {
    SimulationOptions options = extreme_options("blended", kFrame, {0.0, -9.81, 0.0});
    options.solver = solver;
    // Bases are compared on one region: the rings of several are of other functions in each.
    const bool basis = !solver.precision;
    const Extreme result =
        basis ? run_extreme({bar, jerk, options, 30}) : run_extreme({body, motion, options, 30});
    if (!setting.empty()) table.add(setting, "blended", result);
    return result.x;
  };
  fem::SolverOptions hierarchical, single, half;
  hierarchical.basis = fem::Basis::Hierarchical;
  single.precision = fem::Precision::Float;
  half.precision = fem::Precision::Short;
  const Points of_hierarchical = run("hierarchical basis", hierarchical);
  table.at_most("off the default", distance(of_hierarchical, run("", {})), 1e-9);
  const Points in_double =
      run_extreme({body, motion, extreme_options("blended", kFrame, {0.0, -9.81, 0.0}), 30}).x;
  const Points of_float = run("float factors", single);
  table.at_most("off the default", distance(of_float, in_double), 1e-5);
  const Points of_short = run("factors of 16 bits", half);
  table.at_most("off the default", distance(of_short, in_double), 1e-4);

  const fem::PosedFrames pose = fem::pose_frames(body.tree, arm_pose(60 * kDegree), 0.0);
  for (const std::string rung : {"blended-stiffness", "corotational"}) {
    const auto rest = [&](int stale_after) {
      fem::PoseProblem problem;
      problem.pose = &pose;
      problem.gravity = {0.0, -9.81, 0.0};
      Extreme result;
      result.x = fem::skinned_positions(body, pose);
      const fem::SolveReport report =
          model_with(rung, body, 1e-10, stale_after)->equilibrate(problem, result.x);
      result.ok = report.ok();
      result.failure = report.message;
      return result;
    };
    const Extreme stale = rest(15), fresh = rest(1);
    table.add("preconditioner always fresh", rung, fresh);
    table.at_most("off the stale one's", distance(fresh.x, stale.x), 1e-9);
  }
}

TEST(Extremes, X32FramesThatFloatsCannotHold) {
  ExtremesTable table(
      "X32", "Frames of values that floats cannot hold: denormals are zero, too large ones an error.");
  Points points(1, 3);
  points << 1e-40, 0.0, 1.0;
  EXPECT_LE(std::abs(assets::to_float(points)(0, 0)), 1e-38F);
  points(0, 0) = 1e39;
  Extreme run;
  try {
    assets::to_float(points);
    ADD_FAILURE() << "1e39 is no float";
  } catch (const std::domain_error& error) {
    run.failure = error.what();
  }
  EXPECT_FALSE(run.failure.empty());
  table.add("1e39", "blended", run, false);
}

/// How far a run of a body is from its own mirror image in z.
double asymmetry(const Body& body, const Points& x) {
  double worst = 0.0;
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    const Eigen::RowVector3d rest = body.mesh.points.row(a);
    const Eigen::RowVector3d y = x.row(vertex_at(body, {rest[0], rest[1], -rest[2]}));
    worst = std::max(worst, (x.row(a) - Eigen::RowVector3d(y[0], y[1], -y[2])).norm());
  }
  return worst;
}

// The arm and the bar are their own mirror images in z; one bends about z, the other's base jerks along y.
TEST(Extremes, X34AMirroredBodyMovesAsItsMirrorImage) {
  // A preconditioner in float rounds the two sides differently, and conjugate gradients leave of that what is
  // below 1e-6 of the forces, here of 500 m/s^2: 3e-8 m.
  ExtremesTable table("X34",
                      "Bodies that are their own mirror image move as such to 1e-9; all factors in double.");
  const Arm arm = small_arm();
  const Body elbow = small_arm_body(arm, 60 * kDegree), bar = short_bar(kFirm, kDamped);
  const Motion bend = [](double time) { return arm_pose(60 * kDegree * smooth_step(2.0 * time)); };
  const Motion jerk = [](double time) -> std::vector<Eigen::Affine3d> {
    return {Eigen::Affine3d(Eigen::Translation3d(0.0, time > 0.1 ? 0.2 : 0.0, 0.0))};
  };
  for (const std::string& rung : dynamic_rungs()) {
    SimulationOptions options = extreme_options(rung, kFrame, {0.0, -9.81, 0.0});
    options.solver.precision = fem::Precision::Double;
    const Extreme bent = run_extreme({elbow, bend, options, 30});
    table.add("elbow", rung, bent);
    table.at_most("asymmetry", asymmetry(elbow, bent.x), 1e-9);
    const Extreme jerked = run_extreme({bar, jerk, options, 30});
    table.add("bar", rung, jerked);
    table.at_most("asymmetry", asymmetry(bar, jerked.x), 1e-9);
  }
}

}  // namespace
}  // namespace sinew::tests
