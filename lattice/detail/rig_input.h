#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lattice/build.h"
#include "lattice/detail/cell_sizes.h"
#include "lattice/detail/skeleton_reduction.h"
#include "lattice/detail/symmetry.h"
#include "lattice/detail/unit_skin.h"
#include "lattice/surface.h"

namespace sinew::lattice::detail {

/// What a lattice is made for, checked and brought to unit coordinates. Refers to the caller's skin and
/// joints.
struct RigInput {
  const Surface& skin;      ///< rest coordinates [m].
  const JointTree& joints;  ///< rest coordinates [m].
  UnitSkin unit_skin;
  /// In unit coordinates; children of an excluded joint hang on the joint above it.
  JointTree unit_joints;
  JointWeights weights;
  /// Per joint the one that its skin weight counts for: itself unless it is excluded.
  std::vector<int> stand_in;
  CellSizes sizes;
  std::vector<int> idle_sizes;  ///< joints of size_factors that no skin hangs on.
  Poll poll;
  /// Found and wanted: unit coordinates have their plane at x = 0, and unit_joints are exact mirror images.
  std::optional<RigMirror> mirror;
  std::string no_mirror;  ///< why there is none.

  const std::vector<int>* mirror_joint() const { return mirror ? &mirror->joint : nullptr; }
};

/// Throws std::invalid_argument where there is no triangle, no joint or no weight, an index does not exist or
/// a coordinate is not finite, or where the options name such a joint or exclude all. `skin` and `joints`
/// must outlive the result.
RigInput make_rig_input(const Surface& skin, const JointTree& joints, const BuildOptions& options = {});

}  // namespace sinew::lattice::detail
