#pragma once

#include <optional>
#include <vector>

#include "lattice/control_lattice.h"
#include "lattice/surface.h"

/// How thick limbs are against the cells that they lie in. A limb thinner than half an edge is a sheet with
/// its neighbours: it neither bends about its bones nor parts from what lies beside it.
namespace sinew::lattice {

struct LimbThickness {
  int joint = -1;          ///< frame of the lattice.
  double thickness = 0.0;  ///< twice the median distance, by area, of its skin to its bones [m].
  double edge = 0.0;       ///< mean edge of the cells that hold its skin, by area [m].
  double area = 0.0;       ///< of its skin [m^2].

  double ratio() const { return thickness / edge; }
};

/// Of every frame that skin follows, ascending by joint. Skin outside the lattice does not count.
std::vector<LimbThickness> limb_thicknesses(const ControlLattice& lattice, const Surface& skin);

/// The limb with the smallest ratio; details (frames with less than a hundredth of the skin, or of less than
/// three tenths of the mean frame's where that is less) are left out. None where there is no limb.
std::optional<LimbThickness> thinnest_limb(const std::vector<LimbThickness>& limbs);

/// Below this ratio limbs are worth a word.
inline constexpr double kThinLimb = 0.5;

}  // namespace sinew::lattice
