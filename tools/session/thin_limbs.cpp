#include "tools/session/thin_limbs.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace sinew::tools {
namespace {

/// Cells of limbs that are one cell thick go like the square of what divides their edges.
int cells_for(std::size_t cells, double ratio) {
  const double wanted = static_cast<double>(cells) * std::pow(lattice::kThinLimb / ratio, 2.0);
  const double step = wanted < 2000.0 ? 250.0 : 1000.0;
  return static_cast<int>(step * std::ceil(wanted / step));
}

}  // namespace

std::string ThinLimb::message() const {
  return fmt::format("limbs are {:.2f} of a cell thick ('{}')", ratio, joint);
}

std::string ThinLimb::remedy() const { return fmt::format("--cells {}", cells); }

std::optional<ThinLimb> find_thin_limb(const lattice::ControlLattice& lattice, const lattice::Surface& skin,
                                       const std::vector<std::string>& joints) {
  const std::optional<lattice::LimbThickness> limb =
      lattice::thinnest_limb(lattice::limb_thicknesses(lattice, skin));
  // Rounded down, so that no line says that 0.50 is too little.
  if (!limb || limb->ratio() >= lattice::kThinLimb - 0.005) return std::nullopt;
  return ThinLimb{joints[static_cast<std::size_t>(limb->joint)], limb->ratio(),
                  cells_for(lattice.complex.cells.size(), limb->ratio())};
}

}  // namespace sinew::tools
