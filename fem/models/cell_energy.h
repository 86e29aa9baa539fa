#pragma once

#include <span>

#include "fem/body/body.h"
#include "fem/models/stage_problem.h"

/// What a nonlinear model is: the energy of one leaf cell and its derivatives. The solver
/// (fem/models/detail/newton_model.h) knows no materials, and an energy knows no system.
namespace sinew::fem {

/// Corners of a leaf cell as columns, relative to its first corner, so that far positions stay accurate.
inline CellPoints cell_points(const lattice::Points& x, const lattice::HexVertices& cell) {
  CellPoints points;
  const Eigen::RowVector3d first = x.row(cell[0]);
  for (int a = 0; a < 8; ++a) points.col(a) = (x.row(cell[static_cast<std::size_t>(a)]) - first).transpose();
  return points;
}

class CellEnergy {
 public:
  virtual ~CellEnergy() = default;

  /// Until the next call energies hold the viscosity of a stage as well: rate [-] times the elastic energy
  /// (at small strain) of the change since the past. rate is beta / (kappa h); 0 switches it off.
  virtual void set_damping(double rate, std::span<const PastPlace> past) = 0;

  /// [J], of leaf cell `cell` with corners x. Thread-safe, as are the derivatives.
  virtual double energy(int cell, const CellPoints& x) const = 0;
  /// d energy / d x [N].
  virtual CellVector gradient(int cell, const CellPoints& x) const = 0;
  /// d^2 energy / d x^2 [N/m]; symmetric.
  virtual CellStiffness hessian(int cell, const CellPoints& x) const = 0;
  /// A positive semidefinite stand-in for it; by default its own positive part (negative eigenvalues become
  /// 0).
  virtual CellStiffness semidefinite_hessian(int cell, const CellPoints& x) const;

  /// Least principal stretch [-] down to which the law resists being squeezed: a balance found beyond it is
  /// no answer. 0 for a law that always resists.
  virtual double least_stretch() const { return 0.0; }
};

}  // namespace sinew::fem
