#include "fem/models/balance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "fem/body/placement.h"

namespace sinew::fem {

using lattice::Points;

namespace {

template <class Action>
void over_vertices(const Body& body, const Action& action) {
  tbb::parallel_for(tbb::blocked_range<int>(0, body.mesh.num_vertices(), 128),
                    [&](const tbb::blocked_range<int>& range) {
                      for (int a = range.begin(); a != range.end(); ++a) action(a);
                    });
}

/// Force of the ties on flesh at x.
Points tie_pull(const Body& body, const PosedFrames& posed, const Points& x,
                const std::optional<Growth>& growth) {
  Points target = Points::Zero(body.mesh.num_vertices(), 3);
  for (const Tie& tie : body.ties) {
    const Eigen::Affine3d map = tie_target(body, tie, posed, growth ? &*growth : nullptr);
    const Eigen::Vector3d centre = map * tie.centre_rest;
    for (std::size_t k = 0; k < tie.vertices.size(); ++k)
      target.row(tie.vertices[k]) += (map.linear() * tie.first[k] + tie.zeroth[k] * centre).transpose();
  }
  return target - apply_tie(body.matrices, x);
}

Points weights(const Body& body, const Eigen::Vector3d& gravity, const Points* force) {
  Points load(body.mesh.num_vertices(), 3);
  for (int a = 0; a < body.mesh.num_vertices(); ++a)
    load.row(a) = body.vertex_mass[static_cast<std::size_t>(a)] * gravity.transpose();
  if (force != nullptr) load += *force;
  return load;
}

/// Velocity of the flesh over `elapsed` seconds if it moves with its frames and keeps its velocity relative
/// to them.
Points predicted_velocity(const Body& body, const State& state, const StagePoses& poses, double elapsed) {
  const std::size_t num_frames = body.tree.frames.size();
  std::vector<Eigen::Affine3d> forward(num_frames), backward(num_frames);
  std::vector<Eigen::Matrix3d> turn(num_frames);
  const double past_h = poses.before != nullptr ? poses.now->time - poses.before->time : 0.0;
  for (std::size_t f = 0; f < num_frames; ++f) {
    const FrameTransform& now = poses.now->frames[f];
    forward[f] = poses.stage->frames[f].from_rest * now.to_rest;
    turn[f] = poses.stage->frames[f].rotation * now.rotation.transpose();
    if (poses.before != nullptr) backward[f] = poses.before->frames[f].from_rest * now.to_rest;
  }
  Points v(body.mesh.num_vertices(), 3);
  over_vertices(body, [&](int a) {
    const Eigen::Vector3d x = state.x.row(a).transpose();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (FrameWeights::InnerIterator it(body.weights, a); it; ++it) {
      const auto f = static_cast<std::size_t>(it.col());
      Eigen::Vector3d velocity = (forward[f] * x - x) / elapsed;
      if (poses.before != nullptr)
        velocity += turn[f] * (state.v.row(a).transpose() - (x - backward[f] * x) / past_h);
      sum += it.value() * velocity;
    }
    v.row(a) = sum.transpose();
  });
  return v;
}

}  // namespace

Balance stage_balance(const Body& body, const StageProblem& p, Grows grows) {
  const Stage stage = stage_of(p.integrator);
  const double eta_h = stage.eta * p.h, kappa_h = stage.kappa * p.h, alpha = body.damping.alpha();
  const State& state = *p.state;
  Balance b;
  b.pose = p.poses.stage;
  b.past = p.past;
  b.damping = body.damping.beta() / kappa_h;

  // M (v+ - v_h) = theta h F and mass damping alpha M (v+ - v_frame), with v+ = (x+ - x_h) / (eta h) and
  // v_frame the integrator's own difference of the flesh's place among its frames.
  Points carried_past = Points::Zero(state.x.rows(), 3);
  for (const PastPlace& past : b.past)
    carried_past += past.share * carried(body, *past.x, *past.pose, *p.poses.stage);
  const double of_velocity = 1.0 / (stage.theta * p.h);
  b.inertia = (of_velocity + alpha) / eta_h;
  b.origin = *p.x_h;
  b.target = (of_velocity * *p.v_h + (alpha / kappa_h) * (carried_past - b.origin)) / b.inertia;
  if (grows == Grows::WithItsJoints && body.grows) b.growth = growth(body, *p.poses.stage);
  Points kinked = (1.0 + b.damping) * b.origin - b.damping * carried_past;
  if (b.growth) kinked -= grown_places(body, *p.poses.stage, *b.growth);
  b.pull = tie_pull(body, *p.poses.stage, b.origin, b.growth) - apply_ghost(body.matrices, kinked);
  b.load = weights(body, p.gravity, p.force);

  Points place = state.x + p.elapsed * predicted_velocity(body, state, p.poses, p.elapsed);
  place_bones(body, *p.poses.stage, place);
  fill_inactive_leaves(body, place);
  b.guess = place - b.origin;
  return b;
}

Balance rest_balance(const Body& body, const PoseProblem& problem, const Points& guess, Grows grows) {
  Balance b;
  b.pose = problem.pose;
  b.origin = guess;
  place_bones(body, *problem.pose, b.origin);
  fill_inactive_leaves(body, b.origin);
  if (grows == Grows::WithItsJoints && body.grows) b.growth = growth(body, *problem.pose);
  Points kinked = b.origin;
  if (b.growth) kinked -= grown_places(body, *problem.pose, *b.growth);
  b.pull = tie_pull(body, *problem.pose, b.origin, b.growth) - apply_ghost(body.matrices, kinked);
  b.load = weights(body, problem.gravity, problem.force);
  b.guess = Points::Zero(guess.rows(), 3);
  return b;
}

OuterForces outer_forces(const Body& body, const Balance& b, const Points& move) {
  const LeafMatrices& m = body.matrices;
  Points sum = b.load + b.pull, ties = b.pull, inertia = Points::Zero(move.rows(), 3);
  const bool moving = b.inertia > 0.0;
  over_vertices(body, [&](int a) {
    const auto i = static_cast<std::size_t>(a);
    Eigen::RowVector3d both = Eigen::RowVector3d::Zero(), tied = both, carried = both;
    for (auto e = static_cast<std::size_t>(m.row_start[i]); e < static_cast<std::size_t>(m.row_start[i + 1]);
         ++e) {
      const Eigen::RowVector3d tie = (m.tie[e] + (1.0 + b.damping) * m.ghost[e]) * move.row(m.column[e]);
      both -= tie;
      tied += tie;
      if (!moving) continue;
      const Eigen::RowVector3d mass =
          (b.inertia * m.mass[e]) * (b.target.row(m.column[e]) - move.row(m.column[e]));
      both += mass;
      carried += mass;
    }
    sum.row(a) += both;
    ties.row(a) -= tied;
    inertia.row(a) = carried;
  });
  const double scale = b.load.norm() + ties.norm() + inertia.norm();
  return {std::move(sum), scale};
}

CellSum::CellSum(const Body& body) {
  std::vector<std::vector<int>> corners(static_cast<std::size_t>(body.mesh.num_vertices()));
  for (int c = 0; c < static_cast<int>(body.mesh.cells.size()); ++c) {
    for (int k = 0; k < 8; ++k)
      corners[static_cast<std::size_t>(
                  body.mesh.cells[static_cast<std::size_t>(c)][static_cast<std::size_t>(k)])]
          .push_back(8 * c + k);
  }
  row_start_.push_back(0);
  for (const auto& row : corners) {
    corner_.insert(corner_.end(), row.begin(), row.end());
    row_start_.push_back(static_cast<int>(corner_.size()));
  }
}

Points CellSum::operator()(const std::vector<CellVector>& cells) const {
  const auto n = static_cast<int>(row_start_.size()) - 1;
  Points sums(n, 3);
  tbb::parallel_for(tbb::blocked_range<int>(0, n, 256), [&](const tbb::blocked_range<int>& range) {
    for (int a = range.begin(); a != range.end(); ++a) {
      Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
      const auto i = static_cast<std::size_t>(a);
      for (auto e = static_cast<std::size_t>(row_start_[i]); e < static_cast<std::size_t>(row_start_[i + 1]);
           ++e)
        sum += cells[static_cast<std::size_t>(corner_[e] / 8)].segment<3>(3 * (corner_[e] % 8)).transpose();
      sums.row(a) = sum;
    }
  });
  return sums;
}

std::string place_of(const Body& body, int cell) {
  const int vertex = body.mesh.cells[static_cast<std::size_t>(cell)][0];
  const int frame = dominant_frames(body.weights)[static_cast<std::size_t>(vertex)];
  return fmt::format("leaf cell {} of '{}'", cell, body.tree.frames[static_cast<std::size_t>(frame)].name);
}

LeastStretch least_stretch(const Body& body, const Points& x) {
  std::vector<double> least(body.mesh.cells.size(), std::numeric_limits<double>::infinity());
  tbb::parallel_for(std::size_t{0}, least.size(), [&](std::size_t c) {
    const CellGeometry geometry =
        cell_geometry(lattice::hex_corners(body.mesh.points, body.mesh.cells[c]), body.fill[c]);
    const CellPoints points = cell_points(x, body.mesh.cells[c]);
    for (std::size_t q = 0; q < 8; ++q) {
      if (body.fill[c][q] < 0.5) continue;  // hardly any flesh
      const Eigen::Matrix3d f = points * geometry.gradients[q];
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> squares;
      squares.computeDirect(f.transpose() * f, Eigen::EigenvaluesOnly);
      const double stretch = std::sqrt(std::max(0.0, squares.eigenvalues()[0]));
      least[c] = std::min(least[c], f.determinant() > 0.0 ? stretch : -stretch);
    }
  });
  const auto found = std::min_element(least.begin(), least.end());
  return {*found, static_cast<int>(found - least.begin())};
}

void name_worst_cell(const Body& body, const Points& x, const Points& residual, SolveReport& report) {
  double least = std::numeric_limits<double>::infinity(), largest = -1.0;
  int most_inverted = -1, most_unbalanced = -1;
  for (int c = 0; c < static_cast<int>(body.mesh.cells.size()); ++c) {
    const lattice::HexVertices& cell = body.mesh.cells[static_cast<std::size_t>(c)];
    const lattice::HexCorners rest = lattice::hex_corners(body.mesh.points, cell),
                              posed = lattice::hex_corners(x, cell);
    double unbalanced = 0.0;
    for (int k = 0; k < 8; ++k) {
      const Eigen::Vector3d xi = gauss_point(k);
      const double det = lattice::trilinear_jacobian(posed, xi).determinant() /
                         lattice::trilinear_jacobian(rest, xi).determinant();
      if (det < least) {
        least = det;
        most_inverted = c;
      }
      unbalanced += residual.row(cell[static_cast<std::size_t>(k)]).squaredNorm();
    }
    if (unbalanced > largest) {
      largest = unbalanced;
      most_unbalanced = c;
    }
  }
  report.cell = least <= 0.0 ? most_inverted : most_unbalanced;
  report.message += fmt::format("; worst is {} (smallest det F {:.3g})", place_of(body, report.cell), least);
}

}  // namespace sinew::fem
