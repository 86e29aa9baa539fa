#pragma once

#include <functional>

#include "fem/models/cell_energy.h"
#include "fem/models/model.h"

/// Linear elasticity of every leaf cell in a rotation of its own: f = R K (R^T x - X), with K of
/// fem/cell_matrices.h. What the rotations follow is the difference between models.
namespace sinew::fem {

/// R of every leaf cell for leaf positions x in a pose.
using CellRotations =
    std::function<std::vector<Eigen::Matrix3d>(const lattice::Points& x, const PosedFrames& pose)>;

/// The rotation of the cells' frames: polar part of sum_f s_f R_f, s_f summed over the corners.
std::vector<Eigen::Matrix3d> frame_rotations(const Body& body, const PosedFrames& pose);

/// Polar decomposition of the mean deformation gradient over a cell's flesh; the nearest proper rotation
/// where the cell is inverted.
class PolarRotations {
 public:
  explicit PolarRotations(const Body& body);
  std::vector<Eigen::Matrix3d> operator()(const lattice::Points& x) const;

 private:
  const Body& body_;
  std::vector<lattice::HexGradients> mean_gradient_;
};

/// K and rest corners of the leaf cells.
class RotatedStiffness {
 public:
  explicit RotatedStiffness(const Body& body);

  const CellStiffness& stiffness(int cell) const { return stiffness_[static_cast<std::size_t>(cell)]; }
  /// R^T x - X of the corners.
  CellVector displacement(int cell, const Eigen::Matrix3d& rotation, const lattice::Points& x) const;
  /// R K R^T.
  CellStiffness rotated(int cell, const Eigen::Matrix3d& rotation) const;
  /// Energy 1/2 u^T K u and forces R K u of all cells.
  CellForces forces(const lattice::Points& x, const std::vector<Eigen::Matrix3d>& rotations) const;

 private:
  const Body& body_;
  std::vector<CellStiffness> stiffness_;
  std::vector<CellPoints> rest_;
};

/// A cell vector with every corner turned by `rotation`.
CellVector turned(const Eigen::Matrix3d& rotation, const CellVector& vector);

}  // namespace sinew::fem
