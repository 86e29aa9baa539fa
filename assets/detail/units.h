#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "assets/rig.h"

namespace sinew::assets::detail {

/// The turn that brings the file's up axis to Y and keeps it right-handed.
Eigen::Matrix3d y_up_from(UpAxis up);

/// Extents of a body in units of its file.
struct BodySize {
  double height = 0.0;   ///< along the up axis.
  double longest = 0.0;  ///< the longest side: wings and fish lie.
};

/// What a file says of its unit.
struct DeclaredUnit {
  double metres = 0.0;       ///< 0: nothing.
  bool by_standard = false;  ///< the format leaves no choice (glTF); otherwise programs often write anything.
};

/// Metres per file unit. `wanted` metres tall if > 0. Otherwise what is declared, where it makes the body's
/// longest side plausible: 0.01 to 100 m where a standard says so, else 0.2 to 4 m. Otherwise the first
/// factor that makes it 0.2 to 4 m: 1, 0.01, 0.0254, 0.1, then powers of ten, nearest first. Adds a finding
/// that says what was taken and why.
double metres_per_unit(const BodySize& body, const DeclaredUnit& declared, double wanted,
                       std::vector<Finding>& findings);

}  // namespace sinew::assets::detail
