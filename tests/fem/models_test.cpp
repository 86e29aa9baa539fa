#include <algorithm>
#include <random>
#include <set>
#include <stdexcept>
#include <tuple>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "fem/body/placement.h"
#include "fem/models/cell_energy.h"
#include "fem/models/detail/collapse.h"
#include "fem/time/simulation.h"
#include "tests/fem/arm.h"
#include "tests/fem/bar.h"

namespace sinew::fem {
namespace {

using lattice::Points;
using tests::kDegree;

std::vector<Eigen::Affine3d> waving(double time) {
  Eigen::Affine3d base(Eigen::AngleAxisd(0.7 * time, Eigen::Vector3d(0.0, 0.6, 0.8)));
  base.pretranslate(Eigen::Vector3d(0.3 * time, -0.2, 5.0 * time * time));
  return tests::arm_pose(60.0 * kDegree * std::sin(9.0 * time), base, 0.5 * std::sin(5.0 * time));
}

TEST(Models, HaveOneNameAndOneLineEach) {
  std::set<std::string_view> names;
  for (const ModelInfo& model : models()) {
    EXPECT_TRUE(names.insert(model.name).second) << model.name;
    EXPECT_EQ(find_model(model.name), &model);
    EXPECT_FALSE(model.description.empty());
    EXPECT_EQ(model.description.find('\n'), std::string_view::npos);
  }
  EXPECT_NE(find_model(kDefaultModel), nullptr);
  EXPECT_EQ(find_model("magic"), nullptr);
  EXPECT_EQ(find_model(""), nullptr);
}

TEST(Models, AreRefusedByTheSimulationWhereTheyAreUnknown) {
  SimulationOptions options;
  options.model = "magic";
  try {
    options.validate();
    FAIL() << "accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_EQ(std::string(error.what()).substr(0, 38), "model: got magic, expected one of skin");
  }
}

// Every model moves as a rigid body where its bones do, at any speed and far from the origin, and keeps bone
// vertices on the clip while they bend.
TEST(Models, KeepBoneVerticesOnTheClip) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 60 * kDegree);
  for (const ModelInfo& model : models()) {
    SimulationOptions options;
    options.model = model.name;
    Simulation simulation(body, waving, 0.0, options);
    ASSERT_EQ(simulation.settle().status, SimulationStatus::Ok) << model.name;
    for (double time : {0.021, 0.093}) {  // never at the end of a step
      ASSERT_EQ(simulation.advance_to(time).status, SimulationStatus::Ok) << model.name;
      // Positions are of size 1, and each is a sum of a few dozen rounded products.
      EXPECT_LE(simulation.measures_at(time).bone_residual, 1e-13) << model.name;
    }
  }
}

// A force per volume of density times g is gravity, in every model's own way of taking forces in; nothing
// else differs, so the two runs agree to rounding, over 12 steps.
TEST(Models, FeelABodyLoadAsTheyFeelGravity) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 60 * kDegree);
  for (const ModelInfo& model : models()) {
    if (!model.dynamic) continue;
    const auto positions = [&](bool as_load) -> Points {
      SimulationOptions options;
      options.model = model.name;
      if (as_load) {
        options.loads.bodies = {{1000.0 * options.gravity}};
        options.gravity.setZero();
      }
      Simulation simulation(
          body, [](double) { return tests::arm_pose(30.0 * kDegree); }, 0.0, options);
      EXPECT_EQ(simulation.advance_to(0.1).status, SimulationStatus::Ok) << model.name;
      return simulation.flesh().x;
    };
    const Points weight = positions(false), load = positions(true);
    EXPECT_GT((weight - skinned_positions(body, pose_frames(body.tree, tests::arm_pose(30.0 * kDegree), 0.0)))
                  .rowwise()
                  .norm()
                  .maxCoeff(),
              1e-3)
        << model.name;
    EXPECT_LE((weight - load).rowwise().norm().maxCoeff(), 1e-9) << model.name;
  }
}

TEST(Models, StartWithTheVelocityGiven) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 60 * kDegree);
  SimulationOptions options;
  options.gravity.setZero();
  options.model = "neo-hookean";
  Simulation simulation(
      body, [](double) { return tests::arm_pose(0.0); }, 0.0, options);
  Points v = Points::Zero(body.mesh.num_vertices(), 3);
  v.col(1).setConstant(0.2);
  simulation.set_velocity(v);
  for (const BoneVertex& bone : body.bones.vertices)
    EXPECT_EQ(simulation.flesh().v.row(bone.vertex).norm(), 0.0);
  EXPECT_NEAR(simulation.measures_at(0.0).largest_speed, 0.2, 1e-15);
}

// s_f T_f X, summed here by hand from the weights.
TEST(Skin, PutsTheLatticeWhereTheWeightsSay) {
  const tests::Arm arm = tests::make_arm(lattice::CellType::Wedge);
  const Body body = tests::arm_body(arm, 60 * kDegree);
  SimulationOptions options;
  options.model = "skin";
  Simulation simulation(body, waving, 0.0, options);
  EXPECT_EQ(simulation.settle().steps, 0);
  for (double time : {0.0, 0.05, 0.3123, 0.5}) {
    ASSERT_EQ(simulation.advance_to(time).status, SimulationStatus::Ok);
    const Points x = simulation.positions_at(time);
    const auto pose = waving(time);
    int checked = 0;
    for (int a = 0; a < body.mesh.num_vertices(); ++a) {
      // Inside a lattice edge a vertex stands at the mean of its ends, which is the same where both have the
      // same weights; level-0 vertices have weights of their own.
      if (body.hierarchy.level(body.mesh.vertices[static_cast<std::size_t>(a)]) > 0) continue;
      if (body.bones.is_bone[static_cast<std::size_t>(a)]) continue;
      Eigen::Vector3d expected = Eigen::Vector3d::Zero();
      for (FrameWeights::InnerIterator it(body.weights, a); it; ++it) {
        const auto joint =
            static_cast<std::size_t>(body.tree.frames[static_cast<std::size_t>(it.col())].joint);
        expected += it.value() * (pose[joint] * body.mesh.points.row(a).transpose());
      }
      EXPECT_LE((x.row(a).transpose() - expected).norm(), 1e-13);
      ++checked;
    }
    EXPECT_GT(checked, 50);
  }
}

TEST(Skin, StandsWhereThePoseIsWhateverCameBefore) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 60 * kDegree);
  SimulationOptions coarse, fine;
  coarse.model = fine.model = "skin";
  coarse.step = 1.0 / 7.0;
  Simulation a(body, waving, 0.0, coarse), b(body, waving, 0.4, fine);
  for (double time : {0.5, 0.61}) {
    ASSERT_EQ(a.advance_to(time).status, SimulationStatus::Ok);
    ASSERT_EQ(b.advance_to(time).status, SimulationStatus::Ok);
    EXPECT_LE((a.positions_at(time) - b.positions_at(time)).rowwise().norm().maxCoeff(), 1e-14);
  }
}

/// Rotation of the polar decomposition of the mean of F over a cell, by singular values.
Eigen::Matrix3d cell_rotation(const Body& body, const Points& x, std::size_t cell) {
  const CellGeometry geometry =
      cell_geometry(lattice::hex_corners(body.mesh.points, body.mesh.cells[cell]), body.fill[cell]);
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  for (std::size_t q = 0; q < 8; ++q)
    mean += geometry.weights[q] * lattice::hex_corners(x, body.mesh.cells[cell]).transpose() *
            geometry.gradients[q];
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(mean, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * svd.matrixV().transpose();
}

/// G: mean of the gradients over the flesh of a cell, one row per corner.
lattice::HexGradients mean_gradient(const Body& body, std::size_t cell) {
  const CellGeometry geometry =
      cell_geometry(lattice::hex_corners(body.mesh.points, body.mesh.cells[cell]), body.fill[cell]);
  lattice::HexGradients mean = lattice::HexGradients::Zero();
  for (std::size_t q = 0; q < 8; ++q) mean += geometry.weights[q] / geometry.volume * geometry.gradients[q];
  return mean;
}

const Eigen::Vector3d kGravity(0.0, 0.0, -9.81);

/// A step of backward Euler on flesh whose frame stands still, solved whole: with R of x + h v and R' of x in
/// every cell,
///   [(1 / h + alpha) / h M + (1 + beta / h) sum R K R^T] x+ =
///       M [(x + h v) / h^2 + alpha / h x + g] + sum R K (X + beta / h R'^T x) + sum R (p x G),
/// p the spin that takes the torque from the forces at x + h v; dense, from the cells' own matrices.
Points direct_step(const Body& body, const State& state, double h) {
  const double alpha = body.damping.alpha(), damping = body.damping.beta() / h;
  const Eigen::Index n = body.mesh.num_vertices();
  const Points &rest = body.mesh.points, ahead = state.x + h * state.v;
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(3 * n);
  for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
    const lattice::HexVertices& cell = body.mesh.cells[c];
    const lattice::HexCorners corners = lattice::hex_corners(rest, cell);
    const CellStiffness stiffness = cell_stiffness(corners, body.fill[c], body.materials[c]);
    const CellMass mass = cell_mass(corners, body.fill[c], body.materials[c].density);
    const Eigen::Matrix3d r = cell_rotation(body, ahead, c), past = cell_rotation(body, state.x, c);
    CellVector u;
    Eigen::Matrix<double, 8, 3> y;
    for (int a = 0; a < 8; ++a) {
      const Eigen::Index i = cell[static_cast<std::size_t>(a)];
      y.row(a) = ahead.row(i) * r;
      u.segment<3>(3 * a) =
          ((1.0 + damping) * y.row(a) - rest.row(i) - damping * state.x.row(i) * past).transpose();
    }
    const CellVector force = stiffness * u;
    const lattice::HexGradients mean = mean_gradient(body, c);
    const Eigen::Matrix3d stretch = y.transpose() * mean;
    Eigen::Vector3d torque = Eigen::Vector3d::Zero();
    for (int a = 0; a < 8; ++a)
      torque += y.row(a).transpose().cross(Eigen::Vector3d(force.segment<3>(3 * a)));
    const Eigen::Vector3d spin =
        (stretch.trace() * Eigen::Matrix3d::Identity() - stretch).fullPivLu().solve(torque);
    for (int a = 0; a < 8; ++a) {
      right.segment<3>(3 * Eigen::Index{cell[static_cast<std::size_t>(a)]}) +=
          r * spin.cross(Eigen::Vector3d(mean.row(a).transpose()));
      for (int b = 0; b < 8; ++b) {
        const Eigen::Index i = cell[static_cast<std::size_t>(a)], j = cell[static_cast<std::size_t>(b)];
        const Eigen::Vector3d x = state.x.row(j).transpose(), x_ahead = ahead.row(j).transpose();
        const Eigen::Matrix3d r_k = r * stiffness.block<3, 3>(3 * a, 3 * b);
        system.block<3, 3>(3 * i, 3 * j) += (1.0 + damping) * r_k * r.transpose() +
                                            (1.0 / h + alpha) / h * mass(a, b) * Eigen::Matrix3d::Identity();
        right.segment<3>(3 * i) += r_k * (rest.row(j).transpose() + damping * past.transpose() * x) +
                                   mass(a, b) * (x_ahead / (h * h) + alpha / h * x + kGravity);
      }
    }
  }
  const Eigen::VectorXd solution = system.ldlt().solve(right);
  return Eigen::Map<const Points>(solution.data(), n, 3);
}

/// A free soft block that has been thrown with a tumble, `time` after.
State tumbled(const Body& body, double h, double time) {
  Points v(body.mesh.num_vertices(), 3);
  for (Eigen::Index a = 0; a < v.rows(); ++a) {
    const Eigen::RowVector3d x = body.mesh.points.row(a);
    v.row(a) << 3.0 * x[1] + x[0] * x[0], 4.0 * x[0] * x[2], 5.0 * x[0] * x[0] - 1.0;
  }
  SimulationOptions options;
  options.model = "corotational";
  options.integrator = Integrator::BackwardEuler;
  options.step = h;
  options.gravity = kGravity;
  Simulation simulation(
      body, [](double) { return std::vector<Eigen::Affine3d>{Eigen::Affine3d::Identity()}; }, 0.0, options);
  simulation.set_velocity(v);
  EXPECT_EQ(simulation.advance_to(time - 0.25 * h).status, SimulationStatus::Ok);
  return simulation.flesh();
}

// The conjugate gradients stop at a thousandth of (w0 h)^2 of the forces they start from, w0 the frequency of
// the damping: here 1e-4, and for a tenth of that frequency at 1e-6 of all forces. It leaves less than a
// hundredth of what the step itself errs by.
TEST(Corotational, StepsAsADirectSolveOfItsSystemDoes) {
  tests::BarOptions bar;
  bar.material = {2e4, 0.45, 1000.0};
  bar.clamped = false;
  const double h = 1.0 / 60.0;
  for (const auto& [frequency, tolerance] : {std::pair{3.0, 1e-4}, {0.3, 1e-6}}) {
    bar.damping = {0.1, frequency};
    const Body body = tests::bar_body(bar);
    const State before = tumbled(body, h, 4 * h), after = tumbled(body, h, 5 * h);
    const Points expected = direct_step(body, before, h);
    const double moved = (expected - before.x).cwiseAbs().maxCoeff();
    EXPECT_GT((expected - before.x - h * before.v).cwiseAbs().maxCoeff(), 0.05 * moved);  // forces matter
    const double left = (after.x - expected).cwiseAbs().maxCoeff();
    EXPECT_LE(left, tolerance * moved) << frequency;
    const Points finer = tumbled(body, 0.5 * h, 5 * h).x;
    EXPECT_LE(5.0 * left, 0.01 * (after.x - finer).cwiseAbs().maxCoeff()) << frequency;
  }
}

/// Sixteen leaf cells of a bar, moved by `amount` of an edge and more where that is given: stretched to
/// `along` in x and to `across` in y and z.
struct Crumpled {
  Body body;
  Points x;

  Crumpled(double amount, double along, double across, std::mt19937_64& rng)
      : body(tests::bar_body(options())) {
    x = body.mesh.points;
    for (Eigen::Index i = 0; i < x.rows(); ++i) {
      for (int c = 0; c < 3; ++c) {
        const double unit = static_cast<double>(rng() >> 11) * 0x1p-52 - 1.0;
        x(i, c) = (c == 0 ? along : across) * (x(i, c) + amount * 0.25 * unit);
      }
    }
  }
  static tests::BarOptions options() {
    tests::BarOptions bar;
    bar.box = {{0, 0, 0}, {1.0, 0.5, 0.5}, {2, 1, 1}, lattice::CellType::Hexahedron, {}};
    bar.material = {2e4, 0.4, 1000.0};
    return bar;
  }
  CellForces forces() const {
    return find_model("corotational")->make(body, {})->cell_forces(x, PosedFrames());
  }
};

/// Gently bent, crumpled so that cells are inside out, and drawn out to strings that keep off collapse.
std::vector<Crumpled> crumpled_bars() {
  std::mt19937_64 rng(20037);
  std::vector<Crumpled> bars;
  for (const auto& [amount, along, across] : {std::tuple{0.1, 1.0, 1.0}, {1.6, 1.0, 1.0}, {0.3, 4.0, 0.08}})
    bars.emplace_back(amount, along, across, rng);
  return bars;
}

// A cell has no hold on anything but its corners. R K (R^T x - X) alone leaves 4e-3, 0.2 and 0.1 of the
// moments of its forces; here eight products of a few dozen rounded sums each, where the turns' matrix is not
// bad.
TEST(Corotational, LeavesNoTorqueInAnyCell) {
  for (const Crumpled& bar : crumpled_bars()) {
    const CellForces forces = bar.forces();
    for (std::size_t c = 0; c < forces.force.size(); ++c) {
      const CellPoints x = cell_points(bar.x, bar.body.mesh.cells[c]);
      Eigen::Vector3d torque = Eigen::Vector3d::Zero(), sum = Eigen::Vector3d::Zero();
      double moments = 0.0;
      for (int a = 0; a < 8; ++a) {
        const Eigen::Vector3d force = forces.force[c].segment<3>(3 * a);
        torque += x.col(a).cross(force);
        sum += force;
        moments += x.col(a).norm() * force.norm();
      }
      EXPECT_LE(torque.norm(), 1e-12 * moments) << c;
      EXPECT_LE(sum.norm() * x.norm(), 1e-12 * moments) << c;
    }
  }
}

// Central differences with steps of 1e-5 of an edge: truncation 1e-10 where cells are sound and 1e-8 near
// collapse, rounding 1e-16 of the energy over the step.
TEST(Corotational, HasForcesThatAreTheSlopeOfItsEnergy) {
  int near = 0, inverted = 0;
  for (Crumpled& bar : crumpled_bars()) {
    const CellForces forces = bar.forces();
    const auto energy_at = [&](int vertex, int axis, double by) {
      const double keep = bar.x(vertex, axis);
      bar.x(vertex, axis) += by;
      const std::vector<double> energies = bar.forces().energy;
      bar.x(vertex, axis) = keep;
      return energies;
    };
    double largest = 0.0;
    for (const CellVector& force : forces.force) largest = std::max(largest, force.cwiseAbs().maxCoeff());
    for (std::size_t c = 0; c < forces.force.size(); ++c) {
      const PrincipalStretches stretches(cell_points(bar.x, bar.body.mesh.cells[c]) *
                                         mean_gradient(bar.body, c));
      near += stretches.near_collapse();
      inverted += stretches.stretch[2] < 0.0;
    }
    for (int a = 0; a < bar.body.mesh.num_vertices(); a += 3) {
      for (int i = 0; i < 3; ++i) {
        const double h = 2.5e-6;
        const std::vector<double> up = energy_at(a, i, h), down = energy_at(a, i, -h);
        for (std::size_t c = 0; c < forces.force.size(); ++c) {
          const lattice::HexVertices& cell = bar.body.mesh.cells[c];
          const auto corner = std::find(cell.begin(), cell.end(), a) - cell.begin();
          if (corner == 8) continue;
          EXPECT_NEAR(forces.force[c][3 * corner + i], (up[c] - down[c]) / (2.0 * h), 1e-7 * largest);
        }
      }
    }
  }
  EXPECT_GT(near, 4);
  EXPECT_GT(inverted, 1);
}

}  // namespace
}  // namespace sinew::fem
