#include "lattice/detail/mirror_planes.h"

#include <Eigen/Eigenvalues>

namespace sinew::lattice::detail {

MirrorPlane middle_plane(const Points& points, const Eigen::Vector3d& normal) {
  const Eigen::VectorXd along = points * normal;
  return {normal, 0.5 * (along.minCoeff() + along.maxCoeff())};
}

std::vector<MirrorPlane> principal_planes(const Points& points) {
  const Eigen::RowVector3d mean = points.colwise().mean();
  const Points centred = points.rowwise() - mean;
  const Eigen::Matrix3d covariance = centred.transpose() * centred;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(covariance);
  std::vector<MirrorPlane> planes;
  for (int k = 0; k < 3; ++k) planes.push_back(middle_plane(points, principal.eigenvectors().col(k)));
  return planes;
}

}  // namespace sinew::lattice::detail
