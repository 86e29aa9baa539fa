#include "fem/models/detail/blended.h"

#include <cmath>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "fem/body/placement.h"
#include "fem/linear/anderson_mixing.h"
#include "fem/linear/repeated_factor.h"
#include "fem/models/balance.h"
#include "fem/models/detail/blended_solver.h"
#include "fem/models/detail/free_system.h"
#include "fem/models/detail/rotated_stiffness.h"

namespace sinew::fem {
namespace {

/// K + P of the whole flesh in a pose and the matrix A of a backward Euler step with it.
struct RestSystem {
  FreeVertices free;
  BlockSystem rest, step;
  RepeatedFactor factor;
  Factor::Report factor_report;
  double h;

  RestSystem(const Body& body, const PosedFrames& pose, double step_length)
      : free(free_vertices(body)), rest(body, free), step(body, free), h(step_length) {
    const RotatedStiffness cells(body);
    const std::vector<Eigen::Matrix3d> rotations = frame_rotations(body, pose);
    std::vector<CellStiffness> matrices;
    for (std::size_t c = 0; c < rotations.size(); ++c)
      matrices.push_back(cells.rotated(static_cast<int>(c), rotations[c]));
    rest.assemble({0.0, 1.0, 1.0}, matrices);
    const SystemFactors of =
        system_factors(stage_of(Integrator::BackwardEuler), h, body.damping.alpha(), body.damping.beta());
    for (CellStiffness& matrix : matrices) matrix *= of.stiffness;
    step.assemble({of.mass, of.tie, of.stiffness}, matrices);
    factor_report = factor.factorise(rest.lower());
  }

  /// K^-1 A v / h at the unknowns.
  lattice::Points correction(const lattice::Points& v) const {
    lattice::Points at_unknowns(free.num_unknowns(), 3), image;
    for (int i = 0; i < free.num_unknowns(); ++i)
      at_unknowns.row(i) = v.row(free.vertex[static_cast<std::size_t>(i)]);
    step.apply(at_unknowns, image);
    image /= h;
    factor.solve(Eigen::Map<Eigen::VectorXd>(image.data(), image.size()));
    return image;
  }
};

class Blended final : public Model {
 public:
  Blended(const Body& body, const SolverOptions& options) : body_(body), solver_(body, options) {}

  SolveReport prepare(double h, Integrator integrator) override {
    const Factor::Report factor = solver_.prepare(h, integrator);
    SolveReport report;
    report.message = factor.message;
    if (!factor.ok) report.status = SolveStatus::NotPositiveDefinite;
    return report;
  }

  SolveReport solve_stage(const StageProblem& p, lattice::Points& velocity) override {
    // Forces enter the systems as M v_h does: theta h M^-1 f more velocity is theta h f more momentum.
    if (p.force == nullptr) {
      velocity = solver_.stage_velocity(p);
      return {};
    }
    const lattice::Points pushed = *p.v_h + stage_of(p.integrator).theta * p.h * acceleration(*p.force);
    StageProblem loaded = p;
    loaded.v_h = &pushed;
    velocity = solver_.stage_velocity(loaded);
    return {};
  }

  SolveReport equilibrate(const PoseProblem& problem, lattice::Points& x) override;

  CellForces cell_forces(const lattice::Points& x, const PosedFrames& pose) override {
    const lattice::Points rest = body_.grows ? growth(body_, pose).shape : body_.mesh.points;
    return RotatedStiffness(body_).forces(x, frame_rotations(body_, pose), rest);
  }

  bool linear_in_frames() const override { return true; }

  bool may_gain_energy() const override { return body_.regions.size() > 1; }

  SolverCounts counts() const override { return solver_.counts(); }

 private:
  const lattice::Points& acceleration(const lattice::Points& force);
  lattice::Points first_velocity(const PoseProblem& problem, double h, const lattice::Points& x);

  const Body& body_;
  BlendedSolver solver_;
  Factor mass_;                           ///< of M over the leaf vertices; empty until a force comes.
  lattice::Points force_, acceleration_;  ///< the last one asked for.
};

/// M^-1 force over the leaf vertices.
const lattice::Points& Blended::acceleration(const lattice::Points& force) {
  if (force_.rows() == force.rows() && force_ == force) return acceleration_;
  const LeafMatrices& m = body_.matrices;
  if (mass_.size() == 0) {
    std::vector<Eigen::Triplet<double>> triplets;
    for (int a = 0; a < m.num_vertices(); ++a) {
      for (int e = m.row_start[static_cast<std::size_t>(a)]; e < m.row_start[static_cast<std::size_t>(a) + 1];
           ++e)
        triplets.emplace_back(a, m.column[static_cast<std::size_t>(e)], m.mass[static_cast<std::size_t>(e)]);
    }
    Eigen::SparseMatrix<double> mass(m.num_vertices(), m.num_vertices());
    mass.setFromTriplets(triplets.begin(), triplets.end());
    // A sum of positive definite cell masses, scaled to unit diagonal: it has a factor.
    if (const Factor::Report report = mass_.factorise(mass); !report.ok)
      throw std::logic_error("the mass matrix of the leaf vertices: " + report.message);
  }
  acceleration_.resize(force.rows(), 3);
  Eigen::VectorXd workspace;
  for (Eigen::Index c = 0; c < 3; ++c) {
    Eigen::VectorXd column = force.col(c);
    mass_.solve(column, workspace);
    acceleration_.col(c) = column;
  }
  force_ = force;
  return acceleration_;
}

/// One backward Euler step of `h` from flesh at x without velocity, in a pose that stands still.
lattice::Points Blended::first_velocity(const PoseProblem& problem, double h, const lattice::Points& x) {
  PosedFrames earlier = *problem.pose, now = *problem.pose, later = *problem.pose;
  earlier.time = -h;
  now.time = 0.0;
  later.time = h;
  State state;
  state.x = x;
  state.v = lattice::Points::Zero(x.rows(), 3);
  StageProblem stage;
  stage.state = &state;
  stage.x_h = &state.x;
  stage.v_h = &state.v;
  stage.poses = {&earlier, &now, &later};
  stage.past = {{1.0, &state.x, &now}};
  stage.elapsed = stage.h = h;
  stage.integrator = Integrator::BackwardEuler;
  stage.gravity = problem.gravity;
  stage.force = problem.force;
  lattice::Points v;
  // Direct solves with factors that are there.
  if (const SolveReport report = solve_stage(stage, v); !report.ok()) throw std::logic_error(report.message);
  return v;
}

/// The blend of the regions' answers is no one system's solution: flesh is at rest where a step of a run, of
/// the default length as the held pose depends slightly on it, leaves it without velocity. That velocity v is
/// an affine function of x. With A the matrix of the step and K that of the whole flesh, every cell turned
/// with its frames, the correction K^-1 A v / h is exact for one region; for several, Anderson's mixing
/// ([Anderson65]) of such corrections finds the zero.
SolveReport Blended::equilibrate(const PoseProblem& problem, lattice::Points& x) {
  constexpr double kStep = 1.0 / 120.0;  // s
  constexpr double kRest = 1e-10;        // share of the size
  constexpr int kMostIterations = 300;
  SolveReport report = prepare(kStep, Integrator::BackwardEuler);
  if (!report.ok()) return report;
  const RestSystem system(body_, *problem.pose, kStep);
  if (!system.factor_report.ok) {
    report.status = SolveStatus::NotPositiveDefinite;
    report.message = "blended: the flesh can move without being held: " + system.factor_report.message;
    return report;
  }
  lattice::Points place = x;
  place_bones(body_, *problem.pose, place);
  fill_inactive_leaves(body_, place);
  detail::AndersonMixing mixing(10);
  lattice::Points v;
  for (; report.iterations < kMostIterations; ++report.iterations) {
    v = first_velocity(problem, kStep, place);
    const lattice::Points correction = system.correction(v);
    report.residual = correction.rowwise().norm().maxCoeff() / body_.size;
    if (!std::isfinite(report.residual)) break;
    if (report.residual <= kRest) {
      x = place;
      return report;
    }
    place += system.free.spread(mixing.step(correction));
  }
  report.status = SolveStatus::NoConvergence;
  report.message =
      fmt::format("blended: not at rest after {} iterations, the next would move it by {:.2g} of its size",
                  report.iterations, report.residual);
  name_worst_cell(body_, place, v, report);
  return report;
}

}  // namespace

std::unique_ptr<Model> make_blended(const Body& body, const SolverOptions& options) {
  return std::make_unique<Blended>(body, options);
}

}  // namespace sinew::fem
