// Stiffness, density, Poisson's ratio, contrast and damping.

#include "fem/models/detail/free_system.h"
#include "tests/extremes/extremes.h"

namespace sinew::tests {
namespace {

/// The whip of a bar with E, rho, g, damping and step scaled so that nothing changes but the units.
Points whip(const std::string& rung, double young, double density, double size, ExtremesTable& table,
            const std::string& setting) {
  const double speed = std::sqrt(young / density / 1e3);  // of sound, over that of the base case
  const double time = size / speed;
  fem::Damping damping{0.1, 5.0 / time};
  const Body body = short_bar({young, 0.3, density}, damping, size);
  const Eigen::Vector3d gravity = Eigen::Vector3d(0.0, 0.0, -3.0) * size / (time * time);
  const Extreme run = run_extreme({body, still_base, extreme_options(rung, time / 120.0, gravity), 12, 0.0});
  table.add(setting, rung, run);
  table.at_most("growth of energy", run.growth, 1e-6);
  return (run.x - body.mesh.points) / size;
}

// What is the same in other units moves the same: the numbers differ by rounding only.
TEST(Extremes, X3X5X18StiffnessDensityAndSizeByPowersOfTen) {
  ExtremesTable table(
      "X3X5X18",
      "E of 1 to 1e15 Pa, densities of 1e-6 to 1e5 kg/m^3 and sizes of 1e-6 to 1e6 m, all else "
      "scaled: the same motion to 1e-9 of the size.");
  for (const std::string& rung : dynamic_rungs()) {
    const Points base = whip(rung, 1e6, 1e3, 1.0, table, "base");
    EXPECT_GT(largest(base), 1e-3);
    const auto same = [&](double young, double density, double size, const std::string& setting) {
      const Points scaled = whip(rung, young, density, size, table, setting);
      table.at_most("off the base", distance(scaled, base), 1e-9);
    };
    for (double young : {1.0, 1e3, 1e5, 1e9, 2.1e11, 1e15})
      same(young, 1e-3 * young, 1.0, fmt::format("E {:g} Pa", young));
    for (double density : {1e-6, 1.0, 1e5}) same(1e6, density, 1.0, fmt::format("rho {:g} kg/m^3", density));
    for (double size : {1e-6, 1e-3, 1e3, 1e6}) same(1e6, 1e3, size, fmt::format("{:g} m", size));
  }
}

// Steel and what is ten thousand times as stiff do not move by 1e-4 of the length under their weight,
// whatever the step; and what is left of the forces at rest is 1e-8 of them.
TEST(Extremes, X3StiffFleshIsRigidAndInBalance) {
  ExtremesTable table("X3", "E to infinity: rigid to 1e-4 of the length; forces balance to 1e-8.");
  table.excuse("balance of forces at rest from 2.1e11 Pa on",
               "the last digit of the places, times the stiffness, is more than 1e-8 of the weight");
  for (double young : {1e6, 1e9, 2.1e11, 1e15}) {
    const Body body = short_bar({young, 0.3, 1000.0}, kDamped);
    const fem::FreeVertices free = fem::free_vertices(body);
    const Eigen::Vector3d gravity = young > 1e6 ? Eigen::Vector3d(0.0, 0.0, -9.81) : kWeight;
    const Points weight = gravity_force(body, gravity);
    for (const std::string& rung : dynamic_rungs()) {
      const std::string setting = fmt::format("E {:g} Pa", young);
      const Extreme run = run_extreme({body, still_base, extreme_options(rung, kFrame, gravity), 60, 0.0});
      table.add(setting, rung, run);
      if (young > 1e6) table.at_most("moved", distance(run.x, body.mesh.points), 1e-4);
      table.at_most("growth of energy", run.growth, 1e-6);
      if (young > 1e9) continue;
      const Points rest = rest_of(body, rung, gravity);
      const fem::PosedFrames pose = fem::pose_frames(body.tree, still_base(0.0), 0.0);
      const auto model = fem::find_model(rung)->make(body, {});
      Points left = weight;
      const fem::CellForces forces = model->cell_forces(rest, pose);
      for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
        for (int k = 0; k < 8; ++k)
          left.row(body.mesh.cells[c][static_cast<std::size_t>(k)]) -=
              forces.force[c].segment<3>(3 * k).transpose();
      }
      table.at_most("forces out of balance", free.gather(left).norm() / free.gather(weight).norm(), 1e-8);
    }
  }
}

// A linear body's frequencies, by its stiffness and mass matrices.
TEST(Extremes, X5FrequenciesGoWithTheRootOfDensity) {
  ExtremesTable table("X5", "f proportional to rho^-1/2 to 1e-8.");
  const double base = modes_of(short_bar(kFirm, kDamped)).omega[0];
  for (double density : {1e-6, 1.0, 1e3, 1e5}) {
    Extreme run;
    run.ok = true;
    table.add(fmt::format("rho {:g} kg/m^3", density), "blended", run);
    const double omega = modes_of(short_bar({1e6, 0.3, density}, kDamped)).omega[0];
    table.at_most("off the root", std::abs(omega / base * std::sqrt(density / 1e3) - 1.0), 1e-8);
  }
}

/// Weight that moves the bar's tip by 1e-5 of its length: finite strain is linear to that, and by 1e-10 in
/// what is the same up and down.
double feather(const Body& body) {
  return 1e-5 / largest(static_displacement(body, gravity_force(body, kWeight)));
}

/// The mean of the displacements upwards and downwards under a feather's weight.
Points up_and_down(const Body& body, const std::string& rung) {
  const double g = feather(body);
  return 0.5 * (rest_of(body, rung, g * kWeight) - rest_of(body, rung, -g * kWeight));
}

// A direct solve of the linear system in long double against every rung's own way.
TEST(Extremes, X4NeighboursAThousandMillionTimesAsStiff) {
  ExtremesTable table("X4",
                      "Neighbouring cells 1e3 to 1e9 times as stiff: static energy within 1e-6 of a direct "
                      "solve in long double.");
  table.excuse("springs", "their stiffness is another one; they must find a rest");
  for (double contrast : {1e3, 1e6, 1e9}) {
    Body body = short_bar({1e5, 0.3, 1000.0}, kDamped);
    for (std::size_t c = 0; c < body.materials.size(); c += 2) body.materials[c].young *= contrast;
    body.matrices = fem::assemble(body.mesh, body.materials, body.fill);
    const FreeSystem system = free_system(body);
    const Eigen::VectorXd weight = restricted(system, gravity_force(body, feather(body) * kWeight));
    using Exact = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
    const Exact stiffness = Eigen::MatrixXd(system.stiffness).cast<long double>(),
                pull = weight.cast<long double>(), u = stiffness.llt().solve(pull);
    const double exact = static_cast<double>(pull.cwiseProduct(u).sum());
    for (const std::string& rung : dynamic_rungs()) {
      const std::clock_t start = std::clock();
      Extreme run;
      // The energy of a linear body is half the work of its load.
      const Points moved_by = up_and_down(body, rung);
      const double work = (gravity_force(body, feather(body) * kWeight)).cwiseProduct(moved_by).sum();
      run.ok = true;
      run.seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
      table.add(fmt::format("1:{:g}", contrast), rung, run);
      if (rung != "springs") table.at_most("off in energy", std::abs(work / exact - 1.0), 1e-6);
    }
  }
}

/// The bar's displacement under a force on one corner of its end, askew to all planes.
Points askew(const Body& body) {
  Points force = Points::Zero(body.mesh.num_vertices(), 3);
  force.row(vertex_at(body, {1.0, 0.2, 0.2})) << 1.0, 0.7, 0.4;
  return static_displacement(body, force);
}

/// Share of the cells' pressures that changes its sign from each cell to the next.
double checkerboard(const Body& body, const Points& u) {
  double board = 0.0, all = 0.0;
  for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
    const lattice::HexCorners rest = lattice::hex_corners(body.mesh.points, body.mesh.cells[c]),
                              posed = lattice::hex_corners(Points(body.mesh.points + u), body.mesh.cells[c]);
    double dilatation = 0.0, volume = 0.0;
    for (int q = 0; q < 8; ++q) {
      const lattice::HexGradients g = lattice::trilinear_gradients(fem::gauss_point(q));
      const Eigen::Matrix3d jacobian = rest.transpose() * g;
      const double w = jacobian.determinant();
      dilatation += w * ((posed - rest).transpose() * g * jacobian.inverse()).trace();
      volume += w;
    }
    const Eigen::RowVector3d centre = rest.colwise().mean();
    const int sum = static_cast<int>(std::floor(centre[0] / 0.25) + std::floor((centre[1] + 0.2) / 0.2) +
                                     std::floor((centre[2] + 0.2) / 0.2));
    const double pressure = dilatation / volume;
    board += (sum % 2 == 0 ? 1.0 : -1.0) * pressure;
    all += std::abs(pressure);
  }
  return std::abs(board) / all;
}

/// Condition number of K scaled to a unit diagonal.
double condition(const Body& body) {
  const Eigen::MatrixXd k(free_system(body).stiffness);
  const Eigen::VectorXd scale = k.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * k * scale.asDiagonal(),
                                                             Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().tail(1)[0] / eigen.eigenvalues()[0];
}

TEST(Extremes, X6PoissonsRatioFromNearMinusOneToNearOneHalf) {
  ExtremesTable table("X6",
                      "Poisson's ratio of -0.9 to 0.49999: all rungs one linear body, no locking (tip over "
                      "that of eight times the cells: the same for all to 5 %), no checkerboard.");
  double locking_usual = 0.0, board_usual = 0.0;
  for (double poisson : {-0.9, -0.5, 0.0, 0.3, 0.45, 0.49, 0.499, 0.4999, 0.49999}) {
    const Body body = short_bar({1e5, poisson, 1000.0}, kDamped);
    BarOptions finer = short_bar_options(body.materials[0], kDamped);
    finer.levels = 2;
    const double sag = largest(static_displacement(body, gravity_force(body, kWeight)));
    const Body fine = bar_body(finer);
    const double locking = largest(static_displacement(fine, gravity_force(fine, kWeight))) / sag;
    const Points linear = static_displacement(body, gravity_force(body, feather(body) * kWeight));
    for (const std::string& rung : dynamic_rungs()) {
      const std::string setting = fmt::format("nu {:g}", poisson);
      const Extreme run = run_extreme({body, still_base, extreme_options(rung, kFrame, kWeight), 20, 0.0});
      table.add(setting, rung, run);
      table.note("growth of energy", run.growth);
      if (rung == "springs") continue;
      table.at_most("off the linear answer", distance(up_and_down(body, rung), linear) / largest(linear),
                    1e-6);
      if (rung != "blended") continue;
      table.note("condition", condition(body));
      if (poisson == 0.3) locking_usual = locking;
      if (poisson > 0.3) {
        table.at_most("tip, finer over this, off that of nu 0.3", std::abs(locking / locking_usual - 1.0),
                      0.05);
      } else {
        table.note("tip, finer over this", locking);
      }
      const double board = checkerboard(body, askew(body));
      if (poisson == 0.3) board_usual = board;
      if (poisson > 0.3) {
        table.at_most("checkerboard's share of the pressure over that at nu 0.3", board / board_usual, 1.5);
      } else {
        table.note("checkerboard's share of the pressure", board);
      }
    }
  }
}

// Overdamped flesh creeps to its rest and never past it; undamped flesh under the midpoint rule keeps its
// energy; alpha and beta alone do as well as both.
TEST(Extremes, X7DampingFromNoneToAThousandTimesCritical) {
  ExtremesTable table("X7",
                      "Damping ratios of 0 to 1e3, alpha or beta alone: overdamped flesh creeps down without "
                      "turning back, not past its rest by 1e-6 of the sag.");
  const double w0 = 4.0 * M_PI;
  std::vector<std::pair<std::string, fem::Damping>> dampings;
  for (double ratio : {0.0, 1e-6, 0.01, 1.0, 10.0, 1e3}) {
    dampings.emplace_back(fmt::format("both, zeta {:g}", ratio), fem::Damping{ratio, 2.0});
    if (ratio == 0.0) continue;
    // The ratio of the lowest mode is alpha / (2 w0) + beta w0 / 2.
    dampings.emplace_back(fmt::format("alpha alone, zeta {:g}", ratio), rayleigh(2.0 * ratio * w0, 1e-30));
    dampings.emplace_back(fmt::format("beta alone, zeta {:g}", ratio), rayleigh(1e-30, 2.0 * ratio / w0));
  }
  for (const auto& [setting, damping] : dampings) {
    const Body body = short_bar(kFirm, damping);
    const int tip = vertex_at(body, {1.0, 0.0, 0.0});
    for (const std::string& rung : dynamic_rungs()) {
      const double rest = rest_of(body, rung, kWeight)(tip, 2);
      double before = 0.0, back = 0.0;
      const auto look = [&](const Simulation& simulation) {
        const double z = simulation.flesh().x(tip, 2);
        back = std::max(back, (z - before) / -rest);
        before = z;
      };
      const SimulationOptions options = extreme_options(rung, kFrame, kWeight);
      const Extreme run = run_extreme({body, still_base, options, 60, 0.0}, look);
      table.add(setting, rung, run);
      table.note("growth of energy", run.growth);
      const double ratio = 0.5 * (damping.alpha() / w0 + damping.beta() * w0);
      if (ratio < 5.0) continue;
      table.at_most("past the rest", (run.x(tip, 2) - rest) / rest, 1e-6);
      table.at_most("back in a step", back, 1e-6);
    }
  }
}

// A small swing in the lowest mode: what two periods leave of it is exp(-4 pi zeta), by both kinds of damping
// and each alone.
TEST(Extremes, X7LogarithmicDecrement) {
  ExtremesTable table("X7-decrement",
                      "The logarithmic decrement within 1 %, by alpha and beta, and by each alone.");
  table.excuse("springs", "their stiffness and so their lowest mode are others");
  table.excuse("zeta 1e-6",
               "a period takes 6e-6 of the swing there, far less than BDF2 takes itself; the midpoint rule "
               "keeps it, which X7-energy asks");
  const double zeta = 0.01;
  const Modes modes = modes_of(short_bar(kFirm, kDamped));
  const double w = modes.omega[0], period = 2.0 * M_PI / w;
  const Points mode = modes.at_leaves(0) / largest(modes.at_leaves(0));
  const int per_period = 400;
  const std::vector<std::pair<std::string, fem::Damping>> dampings{
      {"both", {zeta, w / (2.0 * M_PI)}},
      {"alpha alone", rayleigh(2.0 * zeta * w, 1e-30)},
      {"beta alone", rayleigh(1e-30, 2.0 * zeta / w)}};
  for (const auto& [setting, damping] : dampings) {
    const Body body = short_bar(kFirm, damping);
    const Points shape = fem::apply_mass(body.matrices, mode);
    const double mass = shape.cwiseProduct(mode).sum();
    for (const std::string& rung : element_rungs()) {
      // Amplitude of the mode: its displacement and velocity make one circle.
      std::vector<double> amplitude;
      const auto look = [&](const Simulation& simulation) {
        const Points u = simulation.flesh().x - body.mesh.points;
        const double q = shape.cwiseProduct(u).sum() / mass,
                     v = shape.cwiseProduct(simulation.flesh().v).sum() / mass + zeta * w * q;
        amplitude.push_back(std::hypot(q, v / (w * std::sqrt(1.0 - zeta * zeta))));
      };
      const SimulationOptions options =
          extreme_options(rung, period / per_period, kNoWeight, Integrator::TrBdf2);
      const Extreme run =
          run_extreme({body, still_base, options, 3 * per_period, 0.0, 1e-3 * w * mode}, look);
      table.add(setting, rung, run);
      const double decrement = std::log(amplitude[per_period] / amplitude.back()) / 2.0,
                   expected = 2.0 * M_PI * zeta / std::sqrt(1.0 - zeta * zeta);
      table.at_most("off the closed form", std::abs(decrement / expected - 1.0), 0.01);
    }
  }
}

TEST(Extremes, X7UndampedFleshKeepsItsEnergyUnderTheMidpointRule) {
  ExtremesTable table("X7-energy",
                      "Without damping, by the midpoint rule: the amplitude to 1e-9 in 1e3 steps; with "
                      "a ratio of 1e-6 what that takes, to 1 %.");
  table.excuse(
      "springs, blended-stiffness, stvk, neo-hookean",
      "the rule keeps the energy of linear flesh exactly, and theirs as well as their solves do (noted)");
  const Modes modes = modes_of(short_bar(kFirm, kDamped));
  const double w = modes.omega[0];
  const Points mode = modes.at_leaves(0) / largest(modes.at_leaves(0));
  for (double zeta : {0.0, 1e-6}) {
    const Body body = short_bar(kFirm, {zeta, w / (2.0 * M_PI)});
    for (const std::string& rung : dynamic_rungs()) {
      std::vector<double> energy;
      const auto look = [&](const Simulation& simulation) {
        const fem::Measures m = simulation.measures_at(simulation.flesh().time);
        energy.push_back(m.kinetic + m.elastic);
      };
      const double step = 2.0 * M_PI / w / 40.0;
      const SimulationOptions options = extreme_options(rung, step, kNoWeight, Integrator::ImplicitMidpoint);
      const Extreme run = run_extreme({body, still_base, options, 1001, 0.0, 1e-3 * w * mode}, look);
      table.add(fmt::format("zeta {:g}", zeta), rung, run);
      const double lost = 1.0 - std::sqrt(energy.back() / energy.front());
      if (rung != "blended") {
        table.note("amplitude lost", lost);
      } else if (zeta == 0.0) {
        table.at_most("amplitude lost or won", std::abs(lost), 1e-9);
      } else {
        // Damping sees the mean velocity of a step, 1 / sqrt(1 + (w h / 2)^2) of the swing's.
        const double seen = 1.0 / (1.0 + 0.25 * w * w * step * step);
        table.at_most("off what damping takes", std::abs(lost / (zeta * w * seen * 1000.0 * step) - 1.0),
                      0.01);
      }
    }
  }
}

}  // namespace
}  // namespace sinew::tests
