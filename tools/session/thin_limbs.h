#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lattice/limb_thickness.h"

namespace sinew::tools {

/// A limb that is too thin for its cells to bend about its bones and to part from what lies beside it.
struct ThinLimb {
  std::string joint;
  double ratio = 0.0;  ///< thickness over the edge of its cells [-]; below lattice::kThinLimb.
  int cells = 0;       ///< so many cells would about do.

  /// "limbs are 0.28 of a cell thick ('lower_leg.L')".
  std::string message() const;
  /// "--cells 4000".
  std::string remedy() const;
};

/// The worst, where there is one. `joints` are the names of the rig's.
std::optional<ThinLimb> find_thin_limb(const lattice::ControlLattice& lattice, const lattice::Surface& skin,
                                       const std::vector<std::string>& joints);

}  // namespace sinew::tools
