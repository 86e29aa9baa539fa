#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "fem/models/cell_energy.h"
#include "fem/models/model.h"

/// Linear elasticity of every leaf cell in a rotation of its own: f = R K (R^T x - X), with K of
/// fem/body/cell_matrices.h. What the rotations follow is the difference between models.
namespace sinew::fem {
namespace detail {
class TurnedCells;
struct TurnedPlace;
}  // namespace detail

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

  /// Largest change of a cell's F, as the root of the sum of squares, for a move of the leaf vertices [-].
  double largest_change(const lattice::Points& move) const;

  /// G, one row per corner: F = sum_i x_i G_i^T [1/m].
  const lattice::HexGradients& mean_gradient(std::size_t cell) const { return mean_gradient_[cell]; }
  std::span<const lattice::HexGradients> mean_gradients() const { return mean_gradient_; }

 private:
  const Body& body_;
  std::vector<lattice::HexGradients> mean_gradient_;
};

/// K and rest corners of the leaf cells; copies share them.
class RotatedStiffness {
 public:
  explicit RotatedStiffness(const Body& body);

  /// K.
  CellStiffness at_rest(int cell) const;
  /// R K R^T.
  CellStiffness rotated(int cell, const Eigen::Matrix3d& rotation) const;
  /// Energy 1/2 u^T K u and forces R K u of all cells, u = R^T x - rest; `rest`: the shape free of strain,
  /// num_vertices x 3 [m].
  CellForces forces(const lattice::Points& x, const std::vector<Eigen::Matrix3d>& rotations,
                    const lattice::Points& rest) const;

  /// K as it is packed for products with all cells at once.
  const detail::TurnedCells& cells() const { return *cells_; }

 private:
  const Body& body_;
  std::shared_ptr<const detail::TurnedCells> cells_;
};

/// Forces of cells that are linear in their polar rotations, as the slope of a potential
/// (fem/models/detail/corotational_cells.h).
class PolarForces {
 public:
  PolarForces(const Body& body, const RotatedStiffness& stiffness);

  const PolarRotations& rotations() const { return rotations_; }
  /// Of displacements that are the sum of `places`, as detail::CellGroups has vectors; the first place, with
  /// its polar rotations, is where the flesh is. Returns whether a cell is near collapse there.
  bool operator()(std::span<const detail::TurnedPlace> places, std::vector<double>& corners) const;
  /// Energy and forces without viscosity.
  CellForces operator()(const lattice::Points& x) const;

 private:
  template <class Action>
  bool each_near_collapse(const lattice::Points& x, const std::vector<char>& slim,
                          const Action& action) const;

  const Body& body_;
  RotatedStiffness stiffness_;
  PolarRotations rotations_;
  std::vector<double> mean_gradients_, collapse_;
};

}  // namespace sinew::fem
