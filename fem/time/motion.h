#pragma once

#include <functional>
#include <vector>

#include <Eigen/Geometry>

/// What moves the bones.
namespace sinew::fem {

/// pose_from_rest of every joint at a time [s]; must be defined for every time.
using Motion = std::function<std::vector<Eigen::Affine3d>(double time)>;

}  // namespace sinew::fem
