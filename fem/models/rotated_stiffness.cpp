#include "fem/models/rotated_stiffness.h"

#include <cmath>

#include <tbb/parallel_for.h>

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
    rotations[c] = polar_rotation(sum);
  });
  return rotations;
}

namespace {

/// Polar rotation by Newton's iteration M <- (g M + M^-T / g) / 2 ([Higham86]), g the ratio of the norms: a
/// few products where a singular value decomposition takes hundreds. Cells near collapse take the latter.
Eigen::Matrix3d quick_polar_rotation(const Eigen::Matrix3d& matrix) {
  constexpr double kFlat = 1e-4;      // of a volume: below, the iteration wastes its first steps
  constexpr double kSettled = 1e-14;  // the next step is at rounding: convergence is quadratic
  Eigen::Matrix3d m = matrix;
  for (int k = 0; k < 30; ++k) {
    Eigen::Matrix3d inverse;  // M^-T, the cofactors over the determinant
    inverse.col(0) = m.col(1).cross(m.col(2));
    inverse.col(1) = m.col(2).cross(m.col(0));
    inverse.col(2) = m.col(0).cross(m.col(1));
    const double det = m.col(0).dot(inverse.col(0)), norm = m.norm();
    if (!(det > kFlat * norm * norm * norm)) break;
    inverse /= det;
    const double g = std::sqrt(inverse.norm() / norm);
    const Eigen::Matrix3d next = 0.5 * (g * m + inverse / g);
    const double change = (next - m).cwiseAbs().maxCoeff();
    m = next;
    if (change < kSettled) return m;
  }
  return polar_rotation(matrix);
}

}  // namespace

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
    rotations[c] = quick_polar_rotation(cell_points(x, body_.mesh.cells[c]) * mean_gradient_[c]);
  });
  return rotations;
}

CellVector turned(const Eigen::Matrix3d& rotation, const CellVector& vector) {
  const CellPoints points = rotation * Eigen::Map<const CellPoints>(vector.data());
  return Eigen::Map<const CellVector>(points.data());
}

RotatedStiffness::RotatedStiffness(const Body& body) : body_(body) {
  for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
    stiffness_.push_back(cell_stiffness(lattice::hex_corners(body.mesh.points, body.mesh.cells[c]),
                                        body.fill[c], body.materials[c]));
    rest_.push_back(cell_points(body.mesh.points, body.mesh.cells[c]));
  }
}

CellVector RotatedStiffness::displacement(int cell, const Eigen::Matrix3d& rotation, const Points& x) const {
  const auto c = static_cast<std::size_t>(cell);
  const CellPoints u = rotation.transpose() * cell_points(x, body_.mesh.cells[c]) - rest_[c];
  return Eigen::Map<const CellVector>(u.data());
}

CellStiffness RotatedStiffness::rotated(int cell, const Eigen::Matrix3d& rotation) const {
  const CellStiffness& k = stiffness(cell);
  CellStiffness half, result;
  for (int a = 0; a < 8; ++a) half.middleRows<3>(3 * a).noalias() = rotation * k.middleRows<3>(3 * a);
  for (int b = 0; b < 8; ++b)
    result.middleCols<3>(3 * b).noalias() = half.middleCols<3>(3 * b) * rotation.transpose();
  return result;
}

CellForces RotatedStiffness::forces(const Points& x, const std::vector<Eigen::Matrix3d>& rotations) const {
  CellForces result;
  result.energy.resize(stiffness_.size());
  result.force.resize(stiffness_.size());
  tbb::parallel_for(std::size_t{0}, stiffness_.size(), [&](std::size_t c) {
    const CellVector u = displacement(static_cast<int>(c), rotations[c], x);
    const CellVector local = stiffness_[c] * u;
    result.energy[c] = 0.5 * u.dot(local);
    result.force[c] = turned(rotations[c], local);
  });
  return result;
}

}  // namespace sinew::fem
