#pragma once

#include "lattice/detail/skeleton_reduction.h"
#include "lattice/detail/unit_skin.h"
#include "lattice/surface.h"

namespace sinew::lattice::detail {

/// What a lattice is made for, checked and brought to unit coordinates. Refers to the caller's skin and
/// joints.
struct RigInput {
  const Surface& skin;      ///< rest coordinates [m].
  const JointTree& joints;  ///< rest coordinates [m].
  UnitSkin unit_skin;
  JointTree unit_joints;
  JointWeights weights;
};

/// Throws std::invalid_argument where there is no triangle, no joint or no weight, an index does not exist or
/// a coordinate is not finite. `skin` and `joints` must outlive the result.
RigInput make_rig_input(const Surface& skin, const JointTree& joints);

}  // namespace sinew::lattice::detail
