#pragma once

#include <functional>
#include <memory>

#include "fem/models/cell_energy.h"
#include "fem/models/model.h"

/// Linear elasticity of every leaf cell in a rotation of its own: f = R K (R^T x - X), with K of
/// fem/cell_matrices.h. What the rotations follow is the difference between models.
namespace sinew::fem {
namespace detail {
class TurnedCells;
}

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

/// K and rest corners of the leaf cells; copies share them.
class RotatedStiffness {
 public:
  explicit RotatedStiffness(const Body& body);

  /// R K R^T.
  CellStiffness rotated(int cell, const Eigen::Matrix3d& rotation) const;
  /// Energy 1/2 u^T K u and forces R K u of all cells.
  CellForces forces(const lattice::Points& x, const std::vector<Eigen::Matrix3d>& rotations) const;

  /// K as it is packed for products with all cells at once.
  const detail::TurnedCells& cells() const { return *cells_; }

 private:
  const Body& body_;
  std::shared_ptr<const detail::TurnedCells> cells_;
};

}  // namespace sinew::fem
