#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "assets/rig.h"

namespace sinew::assets::detail {

/// The turn that brings the file's up axis to Y and keeps it right-handed.
Eigen::Matrix3d y_up_from(UpAxis up);

/// Metres per file unit for a character `height` units tall, that the file declares to be `declared` metres
/// each (0: nothing declared). `wanted` metres tall if > 0. Otherwise the first factor that puts the height
/// between 0.2 and 4 m: the declared one, 1, 0.01, 0.0254, 0.1, then powers of ten, nearest first. Adds a
/// finding that says what was taken and why.
double metres_per_unit(double height, double declared, double wanted, std::vector<Finding>& findings);

}  // namespace sinew::assets::detail
