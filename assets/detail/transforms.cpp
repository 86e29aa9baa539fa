#include "assets/detail/transforms.h"

#include <Eigen/SVD>

namespace sinew::assets::detail {

Eigen::Matrix3d nearest_orthogonal(const Eigen::Matrix3d& a) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * svd.matrixV().transpose();
}

skeleton::LocalTransform decompose(const Eigen::Affine3d& map) {
  skeleton::LocalTransform parts;
  parts.translation = map.translation();
  Eigen::Matrix3d a = map.linear();
  const double sign = a.determinant() < 0.0 ? -1.0 : 1.0;
  parts.scale = sign * a.colwise().norm().transpose();
  // Columns of a zero scale have no direction; the polar factor below fills them in.
  for (int c = 0; c < 3; ++c) {
    if (parts.scale[c] != 0.0) a.col(c) /= parts.scale[c];
  }
  Eigen::Matrix3d rotation = nearest_orthogonal(a);
  // A singular map leaves the sign of the missing axis open.
  if (rotation.determinant() < 0.0) {
    for (int c = 0; c < 3; ++c) {
      if (parts.scale[c] == 0.0) {
        rotation.col(c) *= -1.0;
        break;
      }
    }
  }
  parts.rotation = Eigen::Quaterniond(rotation).normalized();
  return parts;
}

}  // namespace sinew::assets::detail
