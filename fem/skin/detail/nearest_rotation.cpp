#include "fem/skin/detail/nearest_rotation.h"

#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "fem/body/frames.h"

namespace sinew::fem::detail {
namespace {

/// Eigenvector of the symmetric N for its eigenvalue: a row of the cofactors of N - lambda, that of the
/// largest diagonal entry, as every row is the eigenvector times one of its own components.
Eigen::Vector4d eigenvector(Eigen::Matrix4d n, double lambda) {
  n.diagonal().array() -= lambda;
  // 2 x 2 minors of the upper and of the lower two rows; columns ab.
  const auto minor = [&](int row, int a, int b) {
    return n(row, a) * n(row + 1, b) - n(row, b) * n(row + 1, a);
  };
  const double u01 = minor(0, 0, 1), u02 = minor(0, 0, 2), u03 = minor(0, 0, 3), u12 = minor(0, 1, 2),
               u13 = minor(0, 1, 3);
  const double l01 = minor(2, 0, 1), l02 = minor(2, 0, 2), l03 = minor(2, 0, 3), l12 = minor(2, 1, 2),
               l13 = minor(2, 1, 3), l23 = minor(2, 2, 3);
  Eigen::Matrix4d cofactor;  // symmetric, as N is
  cofactor << n(1, 1) * l23 - n(1, 2) * l13 + n(1, 3) * l12, -(n(1, 0) * l23 - n(1, 2) * l03 + n(1, 3) * l02),
      n(1, 0) * l13 - n(1, 1) * l03 + n(1, 3) * l01, -(n(1, 0) * l12 - n(1, 1) * l02 + n(1, 2) * l01),  //
      0.0, n(0, 0) * l23 - n(0, 2) * l03 + n(0, 3) * l02, -(n(0, 0) * l13 - n(0, 1) * l03 + n(0, 3) * l01),
      n(0, 0) * l12 - n(0, 1) * l02 + n(0, 2) * l01,  //
      0.0, 0.0, n(3, 0) * u13 - n(3, 1) * u03 + n(3, 3) * u01,
      -(n(3, 0) * u12 - n(3, 1) * u02 + n(3, 2) * u01),  //
      0.0, 0.0, 0.0, n(2, 0) * u12 - n(2, 1) * u02 + n(2, 2) * u01;
  int best = 0;
  for (int i = 1; i < 4; ++i) {
    if (std::abs(cofactor(i, i)) > std::abs(cofactor(best, best))) best = i;
  }
  Eigen::Vector4d row;
  for (int i = 0; i < 4; ++i) row[i] = i < best ? cofactor(i, best) : cofactor(best, i);
  return row;
}

}  // namespace

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix) {
  const double norm = matrix.norm();
  if (!(norm > 0.0)) return Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d m = matrix / norm;
  Eigen::Matrix4d n;  // tr(R^T M) = q^T N q
  n << m(0, 0) + m(1, 1) + m(2, 2), m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1),  //
      m(2, 1) - m(1, 2), m(0, 0) - m(1, 1) - m(2, 2), m(0, 1) + m(1, 0), m(0, 2) + m(2, 0),   //
      m(0, 2) - m(2, 0), m(0, 1) + m(1, 0), m(1, 1) - m(0, 0) - m(2, 2), m(1, 2) + m(2, 1),   //
      m(1, 0) - m(0, 1), m(0, 2) + m(2, 0), m(1, 2) + m(2, 1), m(2, 2) - m(0, 0) - m(1, 1);
  // det(N - lambda) = lambda^4 - 2 |M|^2 lambda^2 - 8 det M lambda + det N. From above all roots, Newton's
  // method falls onto the largest; no sum of singular values exceeds sqrt(3) |M|.
  const double c1 = -8.0 * m.determinant(), c0 = n.determinant();
  double lambda = std::sqrt(3.0), slope = 0.0;
  for (int i = 0; i < 30; ++i) {
    const double square = lambda * lambda;
    slope = 4.0 * lambda * square - 4.0 * lambda + c1;
    const double value = square * square - 2.0 * square + c1 * lambda + c0;
    if (!(slope > 0.0)) break;
    const double step = value / slope;
    lambda -= step;
    if (std::abs(step) < 1e-15) break;
  }
  // The slope is the product of the distances to the other eigenvalues: near 0 there is no clear winner, and
  // the eigenvector has lost its digits.
  if (!(slope > 1e-3)) return polar_rotation(matrix);
  const Eigen::Vector4d q = eigenvector(n, lambda).normalized();
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
}

}  // namespace sinew::fem::detail
