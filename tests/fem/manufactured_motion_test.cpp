// Manufactured motions: how the flesh moves is chosen, the forces that move it so follow from the law by
// formulas of their own, and the error of what the time loop finds must fall at the orders promised.
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "fem/time/simulation.h"
#include "tests/fem/bar.h"
#include "tests/publish.h"

namespace sinew::fem {
namespace {

using lattice::Points;

constexpr double kYoung = 1e4, kPoisson = 0.3, kDensity = 1000.0;
constexpr double kMu = kYoung / (2.0 * (1.0 + kPoisson));
constexpr double kBulk = kYoung / (3.0 * (1.0 - 2.0 * kPoisson));
constexpr double kTurn = 4.0 * M_PI;  // [rad/s] of the motion: inertia and stiffness weigh alike in the cube

std::vector<Eigen::Affine3d> still(double) { return {Eigen::Affine3d::Identity()}; }

/// First Piola-Kirchhoff stress of a model's law; the linear one where strains are tiny.
Eigen::Matrix3d stress(const std::string& model, const Eigen::Matrix3d& f) {
  if (model == "neo-hookean") {
    const double j = f.determinant();
    return kMu * f + (-kMu + (kMu / 3.0 + kBulk) * (j - 1.0)) * j * f.inverse().transpose();
  }
  const Eigen::Matrix3d e = 0.5 * (f.transpose() * f - Eigen::Matrix3d::Identity());
  return f * ((kBulk - 2.0 / 3.0 * kMu) * e.trace() * Eigen::Matrix3d::Identity() + 2.0 * kMu * e);
}

/// u = sin(w t) U(X) on the unit cube, U = amplitude (1, -0.6, 0.8) sin(pi x) sin(pi y) sin(pi z).
struct ChosenMotion {
  std::string model;
  double amplitude;

  Eigen::Vector3d direction() const { return amplitude * Eigen::Vector3d(1.0, -0.6, 0.8); }
  Eigen::Vector3d shape(const Eigen::Vector3d& x) const {
    return direction() * std::sin(M_PI * x[0]) * std::sin(M_PI * x[1]) * std::sin(M_PI * x[2]);
  }
  Eigen::Matrix3d gradient(const Eigen::Vector3d& x) const {
    const Eigen::Array3d s = (M_PI * x.array()).sin(), c = M_PI * (M_PI * x.array()).cos();
    return direction() * Eigen::RowVector3d(c[0] * s[1] * s[2], s[0] * c[1] * s[2], s[0] * s[1] * c[2]);
  }
  /// Force per volume, rho u'' - Div P(I + grad u); Div by central differences: truncation 1e-7.
  Eigen::Vector3d force(const Eigen::Vector3d& x, double time) const {
    const double a = std::sin(kTurn * time), h = 1e-4;
    Eigen::Vector3d sum = -kDensity * kTurn * kTurn * a * shape(x);
    for (int j = 0; j < 3; ++j) {
      Eigen::Vector3d up = x, down = x;
      up[j] += h;
      down[j] -= h;
      const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
      sum -= (stress(model, one + a * gradient(up)) - stress(model, one + a * gradient(down))).col(j) /
             (2.0 * h);
    }
    return sum;
  }
};

template <class Action>
void each_gauss_point(const Body& body, const Action& action) {
  for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
    const lattice::HexCorners corners = lattice::hex_corners(body.mesh.points, body.mesh.cells[c]);
    const CellGeometry geometry = cell_geometry(corners, body.fill[c]);
    for (int q = 0; q < 8; ++q) {
      const lattice::HexWeights phi = lattice::trilinear_weights(gauss_point(q));
      action(body.mesh.cells[c], geometry.weights[static_cast<std::size_t>(q)], phi,
             Eigen::Vector3d(corners.transpose() * phi));
    }
  }
}

struct Error {
  double l2 = 0.0, energy = 0.0;
};

/// At time 0.1 s, on (2 blocks)^3 cells of the unit cube.
Error error_of(const ChosenMotion& motion, Integrator integrator, int blocks, double step) {
  constexpr double kTime = 0.1;
  tests::BarOptions bar;
  bar.box = {{0, 0, 0}, {1, 1, 1}, {blocks, blocks, blocks}, lattice::CellType::Hexahedron, {}};
  bar.material = {kYoung, kPoisson, kDensity};
  bar.held = [](const Eigen::Vector3d& x) {
    return (x.array() < 1e-9).any() || (x.array() > 1.0 - 1e-9).any();
  };
  const Body body = tests::bar_body(bar);
  SimulationOptions options;
  options.model = motion.model;
  options.integrator = integrator;
  options.step = step;
  options.gravity.setZero();
  options.force = [&](double time) -> Points {
    Points force = Points::Zero(body.mesh.num_vertices(), 3);
    each_gauss_point(body, [&](const lattice::HexVertices& cell, double weight,
                               const lattice::HexWeights& phi, const Eigen::Vector3d& x) {
      const Eigen::Vector3d f = weight * motion.force(x, time);
      for (int a = 0; a < 8; ++a) force.row(cell[static_cast<std::size_t>(a)]) += phi[a] * f.transpose();
    });
    return force;
  };
  Simulation simulation(body, still, 0.0, options);
  Points v(body.mesh.num_vertices(), 3);
  for (Eigen::Index a = 0; a < v.rows(); ++a)
    v.row(a) = kTurn * motion.shape(body.mesh.points.row(a).transpose()).transpose();
  simulation.set_velocity(v);
  const SimulationReport report = simulation.advance_to(kTime - 1e-9);  // whole steps
  EXPECT_EQ(report.status, SimulationStatus::Ok) << report.message;
  EXPECT_NEAR(simulation.flesh().time, kTime, 1e-9);

  const double a = std::sin(kTurn * kTime);
  const Points u = simulation.flesh().x - body.mesh.points;
  Error error;
  each_gauss_point(body, [&](const lattice::HexVertices& cell, double weight, const lattice::HexWeights& phi,
                             const Eigen::Vector3d& at) {
    error.l2 +=
        weight * (lattice::hex_corners(u, cell).transpose() * phi - a * motion.shape(at)).squaredNorm();
  });
  // At Gauss points gradients of linear elements are of second order; at corners they show their own.
  for (const auto& cell : body.mesh.cells) {
    const lattice::HexCorners corners = lattice::hex_corners(body.mesh.points, cell);
    const lattice::HexCorners moved = lattice::hex_corners(u, cell);
    for (int k = 0; k < 8; ++k) {
      Eigen::Vector3d xi;
      for (int c = 0; c < 3; ++c)
        xi[c] = lattice::kCorners[static_cast<std::size_t>(k)][static_cast<std::size_t>(c)];
      const Eigen::Matrix3d jacobian = lattice::trilinear_jacobian(corners, xi);
      const Eigen::Matrix3d slope = lattice::trilinear_jacobian(moved, xi) * jacobian.inverse() -
                                    a * motion.gradient(corners.row(k).transpose());
      const Eigen::Matrix3d strain = 0.5 * (slope + slope.transpose());
      error.energy +=
          jacobian.determinant() / 8.0 *
          (2.0 * kMu * strain.squaredNorm() + (kBulk - 2.0 / 3.0 * kMu) * strain.trace() * strain.trace());
    }
  }
  return {std::sqrt(error.l2), std::sqrt(error.energy)};
}

/// From cells of 1/4 to cells of 1/8, the step shortened so that its own error falls by four. Not yet in the
/// range where the order is sharp: measured 1.85 to 1.92 and 0.98 to 1.00.
void expect_orders(const ChosenMotion& motion, Integrator integrator, tests::Range& l2_orders,
                   tests::Range& energy_orders) {
  const double shorter = integrator == Integrator::BackwardEuler ? 0.25 : 0.5, step = 1.0 / 80.0;
  const Error coarse = error_of(motion, integrator, 2, step),
              fine = error_of(motion, integrator, 4, shorter * step);
  const double l2 = std::log2(coarse.l2 / fine.l2), energy = std::log2(coarse.energy / fine.energy);
  l2_orders.add(l2);
  energy_orders.add(energy);
  EXPECT_GT(l2, 1.8) << motion.model;
  EXPECT_LT(l2, 2.3) << motion.model;
  EXPECT_GT(energy, 0.9) << motion.model;
  EXPECT_LT(energy, 1.3) << motion.model;
}

// Linear elements: displacements of second order, energies of first, also where they move.
TEST(ManufacturedMotions, ConvergeAtTheOrderOfLinearElementsAtFiniteStrain) {
  tests::Range l2, energy;
  expect_orders({"stvk", 0.1}, Integrator::Bdf2, l2, energy);
  expect_orders({"neo-hookean", 0.1}, Integrator::Bdf2, l2, energy);
  l2.publish("finite_l2", "%.2f");
  energy.publish("finite_energy", "%.2f");
}

// So small that every law is the linear one.
TEST(ManufacturedMotions, ConvergeAtTheOrderOfLinearElementsAtSmallStrain) {
  tests::Range l2, energy;
  for (const std::string model : {"blended", "blended-stiffness", "corotational"})
    expect_orders({model, 1e-6}, Integrator::Bdf2, l2, energy);
  expect_orders({"blended", 1e-6}, Integrator::BackwardEuler, l2, energy);
  l2.publish("small_l2", "%.2f");
  energy.publish("small_energy", "%.2f");
}

/// rms distance at 0.5 s from x = X + sin(w t) U, U a field of the elements themselves: what is left is the
/// error of the time steps.
double time_error(const Body& body, const std::string& model, Integrator integrator, double step) {
  constexpr double kTime = 0.5, kRate = 8.0;
  Points shape(body.mesh.num_vertices(), 3);
  for (Eigen::Index a = 0; a < shape.rows(); ++a) {
    const Eigen::RowVector3d x = body.mesh.points.row(a);
    shape.row(a) = 0.1 * x[0] * x[0] * Eigen::RowVector3d(0.3 * x[2], 0.5 + x[2], 1.0 - x[1]);
  }
  const std::unique_ptr<Model> law = find_model(model)->make(body, {});
  const PosedFrames pose = pose_frames(body.tree, still(0.0), 0.0);
  SimulationOptions options;
  options.model = model;
  options.integrator = integrator;
  options.step = step;
  options.gravity.setZero();
  options.force = [&](double time) -> Points {
    const double a = std::sin(kRate * time);
    Points force = apply_mass(body.matrices, -kRate * kRate * a * shape);
    const CellForces cells = law->cell_forces(body.mesh.points + a * shape, pose);
    for (std::size_t c = 0; c < cells.force.size(); ++c) {
      for (int k = 0; k < 8; ++k)
        force.row(body.mesh.cells[c][static_cast<std::size_t>(k)]) +=
            cells.force[c].segment<3>(3 * k).transpose();
    }
    return force;
  };
  Simulation simulation(body, still, 0.0, options);
  simulation.set_velocity(kRate * shape);
  const SimulationReport report = simulation.advance_to(kTime - 1e-9);
  EXPECT_EQ(report.status, SimulationStatus::Ok) << model << ": " << report.message;
  const Points error = simulation.flesh().x - body.mesh.points - std::sin(kRate * kTime) * shape;
  return std::sqrt(error.squaredNorm() / static_cast<double>(error.rows()));
}

// Measured within 0.1 of the order from steps of 1/80 to steps of 1/160 s.
TEST(ManufacturedMotions, ConvergeAtTheOrderOfTheIntegratorOnEveryRung) {
  tests::BarOptions bar;
  bar.box = {{0.0, -0.2, -0.2}, {1.0, 0.2, 0.2}, {2, 1, 1}, lattice::CellType::Hexahedron, {}};
  bar.material = {4e3, 0.3, 1000.0};
  const Body body = tests::bar_body(bar);
  tests::Range first, second;
  for (const ModelInfo& info : models()) {
    if (!info.dynamic) continue;
    const std::string model(info.name);
    for (const auto& [integrator, order] : {std::pair{Integrator::BackwardEuler, 1.0},
                                            {Integrator::Bdf2, 2.0},
                                            {Integrator::TrBdf2, 2.0},
                                            {Integrator::ImplicitMidpoint, 2.0}}) {
      const double coarse = time_error(body, model, integrator, 1.0 / 80.0),
                   fine = time_error(body, model, integrator, 1.0 / 160.0);
      (order < 1.5 ? first : second).add(std::log2(coarse / fine));
      EXPECT_NEAR(std::log2(coarse / fine), order, 0.1) << model << " " << static_cast<int>(integrator);
    }
  }
  first.publish("first_order", "%.2f");
  second.publish("second_order", "%.2f");
}

}  // namespace
}  // namespace sinew::fem
