#include "lattice/trilinear.h"

#include <algorithm>
#include <cmath>

namespace sinew::lattice {

LocalCoordinates invert_trilinear(const HexCorners& corners, const Eigen::Vector3d& p) {
  constexpr int kMaxIterations = 30;
  LocalCoordinates local;
  const double size = (corners.colwise().maxCoeff() - corners.colwise().minCoeff()).maxCoeff();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const Eigen::Vector3d residual = p - corners.transpose() * trilinear_weights(local.xi);
    // Quadratic convergence: once the residual is at rounding level of the corners another step cannot help.
    if (residual.norm() <= 4e-16 * (size + p.norm())) {
      local.converged = true;
      break;
    }
    const Eigen::Matrix3d jacobian = trilinear_jacobian(corners, local.xi);
    Eigen::Vector3d update = jacobian.partialPivLu().solve(residual);
    if (!update.allFinite()) break;
    // Far points of a distorted cell: keep the iterate where the map is still one to one.
    const double length = update.cwiseAbs().maxCoeff();
    if (length > 1.0) update *= 1.0 / length;
    local.xi += update;
    if (update.cwiseAbs().maxCoeff() < 1e-15) {
      local.converged = true;
      break;
    }
  }
  if (!local.converged) {
    const Eigen::Vector3d residual = p - corners.transpose() * trilinear_weights(local.xi);
    local.converged = residual.norm() <= 1e-12 * (size + p.norm());
  }
  for (int c = 0; c < 3; ++c) {
    local.outside = std::max({local.outside, -local.xi[c], local.xi[c] - 1.0});
  }
  return local;
}

}  // namespace sinew::lattice
