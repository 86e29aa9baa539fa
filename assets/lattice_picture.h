#pragma once

#include <string>
#include <vector>

#include "assets/image.h"
#include "lattice/control_lattice.h"
#include "lattice/surface.h"

namespace sinew::assets {

struct LatticePictureOptions {
  /// Width and height of each of the two views [pixels]; >= 64.
  int tile = 640;
  /// Printed at the top left.
  std::string caption = {};
  /// How many of the worst cells are marked; >= 0.
  int worst = 5;

  /// Throws std::invalid_argument naming the field.
  void validate() const;
};

/// The `count` cells of the smallest dihedral angles, the worst first; fewer where there are fewer cells.
std::vector<int> worst_cells(const lattice::ControlLattice& lattice, int count);

/// A lattice from the front and from behind (rig space, Y up): the skin translucent, the edges of the outer
/// cells, the bones in one colour per frame (soft ones thin, soft frames as discs), the worst cells in red.
/// The same input gives the same pixels, for any number of threads. Throws std::invalid_argument where there
/// is no cell or no triangle.
Image render_lattice(const lattice::ControlLattice& lattice, const lattice::Surface& skin,
                     const LatticePictureOptions& options = {});

}  // namespace sinew::assets
