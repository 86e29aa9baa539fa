#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lattice/build.h"
#include "lattice/detail/inspection.h"
#include "lattice/detail/lattice_points.h"
#include "lattice/detail/skeleton_reduction.h"

namespace sinew::lattice::detail {

/// What one attempt is made with.
struct Attempt {
  std::string name;              ///< what differs from the first attempt, for reports.
  bool moves_grid_only = false;  ///< the bones stay as in the first attempt.
  double h_factor = 1.0;
  ReductionOptions reduction;
  PointOptions points;
};

/// The attempts in order, cheapest change first; at most max_retries + 1.
std::vector<Attempt> planned_attempts(const BuildOptions& options);

/// The first attempt with the grid elsewhere: other cells of the same size, some better shaped than others.
std::vector<Attempt> moved_grids(const BuildOptions& options);

/// True where a refused cell has three pieces of bones at one corner: its shape there is given, whatever the
/// grid.
bool is_shaped_by_bones(const ControlLattice& lattice, const Inspection& found, const BuildOptions& options);

/// The bone to be held by penalty instead of by edges, so that the cells that the gate refused get room: one
/// with a piece in them before one with a vertex only, a leaf before others, then the shortest. Nothing where
/// no hard bone is near them.
std::optional<SoftBone> offending_bone(const ControlLattice& lattice, const Inspection& found,
                                       const BuildOptions& options);

}  // namespace sinew::lattice::detail
