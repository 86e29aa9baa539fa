#include "fem/models/rotated_stiffness.h"

#include <array>

#include <tbb/parallel_for.h>

#include "fem/detail/turned_cells.h"

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

RotatedStiffness::RotatedStiffness(const Body& body)
    : body_(body),
      cells_(std::make_shared<detail::TurnedCells>(
          detail::CellGroups(body.mesh.cells, body.mesh.num_vertices()), [&](int cell) {
            const auto c = static_cast<std::size_t>(cell);
            return cell_stiffness(lattice::hex_corners(body.mesh.points, body.mesh.cells[c]), body.fill[c],
                                  body.materials[c]);
          })) {}

CellStiffness RotatedStiffness::rotated(int cell, const Eigen::Matrix3d& rotation) const {
  const CellStiffness k = cells_->stiffness(cell);
  CellStiffness half, result;
  for (int a = 0; a < 8; ++a) half.middleRows<3>(3 * a).noalias() = rotation * k.middleRows<3>(3 * a);
  for (int b = 0; b < 8; ++b)
    result.middleCols<3>(3 * b).noalias() = half.middleCols<3>(3 * b) * rotation.transpose();
  return result;
}

CellForces RotatedStiffness::forces(const Points& x, const std::vector<Eigen::Matrix3d>& rotations) const {
  std::vector<double> corners;
  const std::array<detail::TurnedPlace, 2> displacement{{{1.0, &x, &rotations}, {-1.0, &body_.mesh.points}}};
  cells_->forces(rotations, displacement, corners);
  CellForces result;
  result.energy.resize(rotations.size());
  result.force.resize(rotations.size());
  tbb::parallel_for(std::size_t{0}, rotations.size(), [&](std::size_t c) {
    CellPoints force;
    for (int k = 0; k < 8; ++k) force.col(k) = cells_->groups().corner(static_cast<int>(c), k, corners);
    const CellPoints u = cell_points(x, body_.mesh.cells[c]) -
                         rotations[c] * cell_points(body_.mesh.points, body_.mesh.cells[c]);
    result.energy[c] = 0.5 * u.cwiseProduct(force).sum();
    result.force[c] = Eigen::Map<const CellVector>(force.data());
  });
  return result;
}

}  // namespace sinew::fem
