#pragma once

#include "fem/models/model.h"

/// Strain, stress and energy of every leaf cell, as its model's law has them: what is written beside a pose.
namespace sinew::fem {

struct CellReport {
  /// Green strain of the mean deformation gradient over the cell's flesh [-].
  Eigen::Matrix3d strain = Eigen::Matrix3d::Zero();
  /// Mean Cauchy stress over the cell's flesh [Pa]: (sum_a f_a x_a^T) / posed volume, f_a the cell's elastic
  /// forces at its corners; zero where the posed cell has no volume left.
  Eigen::Matrix3d stress = Eigen::Matrix3d::Zero();
  double von_mises = 0.0;  ///< of that stress [Pa].
  double energy = 0.0;     ///< elastic [J].
  double volume = 0.0;     ///< posed, of the flesh [m^3].
};

/// One per leaf cell of body.mesh. x: leaf positions, num_vertices x 3 [m].
std::vector<CellReport> report_cells(const Body& body, Model& model, const lattice::Points& x,
                                     const PosedFrames& pose);

/// sqrt(3/2 |dev stress|^2) [Pa].
double von_mises(const Eigen::Matrix3d& stress);

}  // namespace sinew::fem
