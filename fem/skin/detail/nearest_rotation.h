#pragma once

#include <Eigen/Core>

namespace sinew::fem::detail {

/// The rotation R with the largest tr(R^T M): that of the polar decomposition, or for a mirroring M the
/// nearest proper rotation, as polar_rotation gives it. Horn's quaternion [Horn87]: its largest eigenvalue by
/// Newton's method and its eigenvector from cofactors, some ten times as fast as a singular value
/// decomposition; where two rotations are nearly as good, that decomposition is asked. Within 1e-9.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix);

}  // namespace sinew::fem::detail
