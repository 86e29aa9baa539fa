#pragma once

#include <Eigen/Geometry>

#include "skeleton/skeleton.h"

namespace sinew::assets::detail {

/// The orthogonal matrix nearest to `a` (polar factor); a reflection where det a < 0.
Eigen::Matrix3d nearest_orthogonal(const Eigen::Matrix3d& a);

/// Translation, rotation and scale closest to an affine map: exact without shear; a mirror image is put into
/// the scale (all three factors negative).
skeleton::LocalTransform decompose(const Eigen::Affine3d& map);

}  // namespace sinew::assets::detail
