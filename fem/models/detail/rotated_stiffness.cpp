#include "fem/models/detail/rotated_stiffness.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <tbb/parallel_for.h>

#include "fem/models/detail/collapse.h"
#include "fem/models/detail/turned_cells.h"

namespace sinew::fem {

using lattice::Points;

std::vector<Eigen::Matrix3d> frame_rotations(const Body& body, const PosedFrames& pose) {
  std::vector<Eigen::Matrix3d> rotations(body.mesh.cells.size());
  tbb::parallel_for(std::size_t{0}, rotations.size(), [&](std::size_t c) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (int a : body.mesh.cells[c]) {
      for (FrameWeights::InnerIterator it(body.weights, a); it; ++it)
        sum += it.value() * pose.frames[static_cast<std::size_t>(it.col())].rotation;
    }
    rotations[c] = sum / 8.0;
  });
  detail::polar_rotations(rotations);
  return rotations;
}

PolarRotations::PolarRotations(const Body& body) : body_(body) {
  for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
    const CellGeometry geometry =
        cell_geometry(lattice::hex_corners(body.mesh.points, body.mesh.cells[c]), body.fill[c]);
    lattice::HexGradients mean = lattice::HexGradients::Zero();
    for (std::size_t q = 0; q < 8; ++q) mean += geometry.weights[q] / geometry.volume * geometry.gradients[q];
    mean_gradient_.push_back(mean);
  }
}

std::vector<Eigen::Matrix3d> PolarRotations::operator()(const Points& x) const {
  std::vector<Eigen::Matrix3d> rotations(mean_gradient_.size());
  tbb::parallel_for(std::size_t{0}, rotations.size(), [&](std::size_t c) {
    rotations[c] = cell_points(x, body_.mesh.cells[c]) * mean_gradient_[c];
  });
  detail::polar_rotations(rotations);
  return rotations;
}

double PolarRotations::largest_change(const Points& move) const {
  double largest = 0.0;
  for (std::size_t c = 0; c < mean_gradient_.size(); ++c) {
    const Eigen::Matrix3d change = cell_points(move, body_.mesh.cells[c]) * mean_gradient_[c];
    largest = std::max(largest, change.squaredNorm());
  }
  return std::sqrt(largest);
}

namespace {

/// Energy 1/2 u^T f of cells with forces f.
CellForces with_energy(const Body& body, const detail::CellGroups& groups, const Points& x,
                       const std::vector<Eigen::Matrix3d>& rotations, const Points& rest,
                       const std::vector<double>& corners) {
  CellForces result;
  result.energy.resize(rotations.size());
  result.force.resize(rotations.size());
  tbb::parallel_for(std::size_t{0}, rotations.size(), [&](std::size_t c) {
    CellPoints force;
    for (int k = 0; k < 8; ++k) force.col(k) = groups.corner(static_cast<int>(c), k, corners);
    const CellPoints u =
        cell_points(x, body.mesh.cells[c]) - rotations[c] * cell_points(rest, body.mesh.cells[c]);
    result.energy[c] = 0.5 * u.cwiseProduct(force).sum();
    result.force[c] = Eigen::Map<const CellVector>(force.data());
  });
  return result;
}

}  // namespace

RotatedStiffness::RotatedStiffness(const Body& body)
    : body_(body),
      cells_(std::make_shared<detail::TurnedCells>(
          detail::CellGroups(body.mesh.cells, body.mesh.num_vertices()), [&](int cell) {
            const auto c = static_cast<std::size_t>(cell);
            return cell_stiffness(lattice::hex_corners(body.mesh.points, body.mesh.cells[c]), body.fill[c],
                                  body.materials[c]);
          })) {}

CellStiffness RotatedStiffness::at_rest(int cell) const { return cells_->stiffness(cell); }

CellStiffness RotatedStiffness::rotated(int cell, const Eigen::Matrix3d& rotation) const {
  const CellStiffness k = cells_->stiffness(cell);
  CellStiffness half, result;
  for (int a = 0; a < 8; ++a) half.middleRows<3>(3 * a).noalias() = rotation * k.middleRows<3>(3 * a);
  for (int b = 0; b < 8; ++b)
    result.middleCols<3>(3 * b).noalias() = half.middleCols<3>(3 * b) * rotation.transpose();
  return result;
}

CellForces RotatedStiffness::forces(const Points& x, const std::vector<Eigen::Matrix3d>& rotations,
                                    const Points& rest) const {
  std::vector<double> corners;
  const std::array<detail::TurnedPlace, 2> displacement{{{1.0, &x, &rotations}, {-1.0, &rest}}};
  cells_->forces(rotations, displacement, corners);
  return with_energy(body_, cells_->groups(), x, rotations, rest, corners);
}

PolarForces::PolarForces(const Body& body, const RotatedStiffness& stiffness)
    : body_(body),
      stiffness_(stiffness),
      rotations_(body),
      mean_gradients_(detail::packed(stiffness.cells().groups(), rotations_.mean_gradients())),
      collapse_(collapse_moduli(body)) {}

template <class Action>
bool PolarForces::each_near_collapse(const Points& x, const std::vector<char>& slim,
                                     const Action& action) const {
  bool any = false;
  for (std::size_t c = 0; c < slim.size(); ++c) {
    if (!slim[c]) continue;
    const lattice::HexGradients& mean = rotations_.mean_gradient(c);
    const PrincipalStretches f(cell_points(x, body_.mesh.cells[c]) * mean);
    if (!f.near_collapse()) continue;
    any = true;
    action(c, f, CellPoints(collapse_[c] * collapse_stress(f) * mean.transpose()));
  }
  return any;
}

bool PolarForces::operator()(std::span<const detail::TurnedPlace> places,
                             std::vector<double>& corners) const {
  std::vector<char> slim;
  stiffness_.cells().polar_forces(mean_gradients_, places, corners, slim);
  return each_near_collapse(*places[0].x, slim,
                            [&](std::size_t c, const PrincipalStretches&, const CellPoints& force) {
                              for (int k = 0; k < 8; ++k)
                                detail::CellGroups::add_at(static_cast<int>(c), k, force.col(k), corners);
                            });
}

CellForces PolarForces::operator()(const Points& x) const {
  const std::vector<Eigen::Matrix3d> rotations = rotations_(x);
  const std::array<detail::TurnedPlace, 2> displacement{{{1.0, &x, &rotations}, {-1.0, &body_.mesh.points}}};
  std::vector<double> corners;
  std::vector<char> slim;
  stiffness_.cells().polar_forces(mean_gradients_, displacement, corners, slim);
  // The forces of the turn do no work on y - X.
  CellForces result =
      with_energy(body_, stiffness_.cells().groups(), x, rotations, body_.mesh.points, corners);
  each_near_collapse(x, slim, [&](std::size_t c, const PrincipalStretches& f, const CellPoints& force) {
    result.energy[c] += collapse_[c] * collapse_energy(f);
    result.force[c] += Eigen::Map<const CellVector>(force.data());
  });
  return result;
}

}  // namespace sinew::fem
