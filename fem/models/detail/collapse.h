#pragma once

#include <vector>

#include <Eigen/Core>

#include "fem/body/body.h"

/// What keeps a cell off the shapes that have no rotation: squeezed to a line, or mirrored with two equal
/// stretches. With principal stretches l_i (negative the least of them where it is mirrored) the turn of a
/// cell divides by the sums l_i + l_j, and
///   W(F) = sum_(i<j) b(l_i + l_j),  b(s) = -(s - s0)^2 log(s / s0) below s0, else 0,
/// grows without limit where one of them goes to zero; at 2 in flesh at rest and 0.2 where a cell is squeezed
/// to a tenth in two directions, they are out of its reach in ordinary motion.
namespace sinew::fem {

inline constexpr double kCollapse = 0.2;  ///< s0 [-].

/// A turn divides by det^2 + (kLeastTurn size^3)^2 over det of the matrix that gives it, and stays finite
/// where that is singular.
inline constexpr double kLeastTurn = 1e-8;

/// (tr(S) I - S)^-1 for a symmetric S: the turn of F = R S for the axial vector of R^T dF - dF^T R.
Eigen::Matrix3d turn_compliance(const Eigen::Matrix3d& stretch);

/// W's arguments, F = U diag(l) V^T with proper rotations U and V.
struct PrincipalStretches {
  explicit PrincipalStretches(const Eigen::Matrix3d& f);

  Eigen::Vector3d stretch;  ///< l, descending; the last may be negative [-].
  Eigen::Matrix3d u, v;

  Eigen::Matrix3d rotation() const { return u * v.transpose(); }
  bool near_collapse() const { return stretch[1] + stretch[2] < kCollapse; }
};

/// What W is multiplied by in every leaf cell: its bulk modulus times its flesh [J].
std::vector<double> collapse_moduli(const Body& body);

double collapse_energy(const PrincipalStretches& at);
/// dW / dF.
Eigen::Matrix3d collapse_stress(const PrincipalStretches& at);
/// d^2 W / dF^2, 9 x 9, F stacked by columns.
Eigen::Matrix<double, 9, 9> collapse_hessian(const PrincipalStretches& at);

}  // namespace sinew::fem
