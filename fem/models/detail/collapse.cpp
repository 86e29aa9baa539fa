#include "fem/models/detail/collapse.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace sinew::fem {
namespace {

/// b and its derivatives.
struct Barrier {
  double value = 0.0, slope = 0.0, curvature = 0.0;

  explicit Barrier(double sum) {
    if (sum >= kCollapse) return;
    const double s = std::max(sum, 1e-9 * kCollapse);  // a shape without a turn is given a large energy
    const double d = s - kCollapse, log = std::log(s / kCollapse);
    value = -d * d * log;
    slope = -2.0 * d * log - d * d / s;
    curvature = -2.0 * log - 4.0 * d / s + d * d / (s * s);
  }
};

/// b of l_j + l_k at i, the third of them.
std::array<Barrier, 3> barriers(const Eigen::Vector3d& l) {
  return {Barrier(l[1] + l[2]), Barrier(l[2] + l[0]), Barrier(l[0] + l[1])};
}

}  // namespace

PrincipalStretches::PrincipalStretches(const Eigen::Matrix3d& f) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(f, Eigen::ComputeFullU | Eigen::ComputeFullV);
  u = svd.matrixU();
  v = svd.matrixV();
  if (u.determinant() < 0.0) u.col(2) *= -1.0;  // the smallest stretch comes last
  if (v.determinant() < 0.0) v.col(2) *= -1.0;
  stretch = (u.transpose() * f * v).diagonal();
}

Eigen::Matrix3d turn_compliance(const Eigen::Matrix3d& stretch) {
  const Eigen::Matrix3d a = stretch.trace() * Eigen::Matrix3d::Identity() - stretch;
  Eigen::Matrix3d cofactor;
  for (int i = 0; i < 3; ++i) cofactor.col(i) = a.col((i + 1) % 3).cross(a.col((i + 2) % 3));
  const double det = a.col(0).dot(cofactor.col(0)), size = a.squaredNorm(),
               least = kLeastTurn * size * std::sqrt(size);
  return det / (det * det + least * least) * cofactor.transpose();
}

std::vector<double> collapse_moduli(const Body& body) {
  std::vector<double> moduli;
  for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
    double volume = 0.0;
    for (double w : gauss_weights(lattice::hex_corners(body.mesh.points, body.mesh.cells[c]), body.fill[c]))
      volume += w;
    moduli.push_back(volume * body.materials[c].bulk());
  }
  return moduli;
}

double collapse_energy(const PrincipalStretches& at) {
  double sum = 0.0;
  for (const Barrier& b : barriers(at.stretch)) sum += b.value;
  return sum;
}

Eigen::Matrix3d collapse_stress(const PrincipalStretches& at) {
  const std::array<Barrier, 3> b = barriers(at.stretch);
  const Eigen::Vector3d slope(b[1].slope + b[2].slope, b[2].slope + b[0].slope, b[0].slope + b[1].slope);
  return at.u * slope.asDiagonal() * at.v.transpose();
}

/// In the axes of U and V: the diagonal couples by W's own second derivatives; off it the parts that turn the
/// cell and those that shear it, each pair of entries for itself.
Eigen::Matrix<double, 9, 9> collapse_hessian(const PrincipalStretches& at) {
  const Eigen::Vector3d& l = at.stretch;
  const std::array<Barrier, 3> b = barriers(l);
  Eigen::Matrix<double, 9, 9> local = Eigen::Matrix<double, 9, 9>::Zero();
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3, ii = 4 * i, jj = 4 * j, ij = i + 3 * j, ji = j + 3 * i;
    const auto at_k = static_cast<std::size_t>(k), at_i = static_cast<std::size_t>(i),
               at_j = static_cast<std::size_t>(j);
    for (int p : {ii, jj})
      for (int q : {ii, jj}) local(p, q) += b[at_k].curvature;
    // W_i = b_k' + b_j', W_j = b_k' + b_i'.
    const double sum = std::max(l[i] + l[j], 1e-9 * kCollapse), apart = l[i] - l[j];
    const double turn = (2.0 * b[at_k].slope + b[at_j].slope + b[at_i].slope) / sum;
    const double shear = std::abs(apart) > 1e-6 ? (b[at_j].slope - b[at_i].slope) / apart
                                                : 0.5 * (b[at_j].curvature + b[at_i].curvature);
    local(ij, ij) += 0.5 * (shear + turn);
    local(ji, ji) += 0.5 * (shear + turn);
    local(ij, ji) += 0.5 * (shear - turn);
    local(ji, ij) += 0.5 * (shear - turn);
  }
  // U^T dF V stacked by columns.
  Eigen::Matrix<double, 9, 9> axes;
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) axes.block<3, 3>(3 * c, 3 * r) = at.v(r, c) * at.u.transpose();
  }
  return axes.transpose() * local * axes;
}

}  // namespace sinew::fem
