#pragma once

#include <string>
#include <vector>

#include "lattice/build.h"
#include "lattice/detail/triangle_grid.h"
#include "lattice/detail/unit_skin.h"

namespace sinew::lattice::detail {

/// Everything the gate looks at, with the offenders by index.
struct Inspection {
  LatticeQuality quality;
  int flattest_cell = -1;     ///< of the smallest dihedral.
  int most_skewed_cell = -1;  ///< of the smallest scaled Jacobian.
  std::vector<int> inverted_cells;
  std::vector<int> vertices_outside;       ///< skin vertices.
  std::vector<int> triangles_outside;      ///< skin triangles.
  std::vector<std::string> broken_chains;  ///< names of bones.
  /// Components without bone or soft frame: the cells of each.
  std::vector<std::vector<int>> floating;
};

/// `unit` is the same skin cleaned; it serves the volume. Throws std::invalid_argument where there is no
/// cell.
Inspection inspect(const ControlLattice& lattice, const Surface& skin, const UnitSkin& unit,
                   const Poll& poll = {});

/// The gate on what was found.
std::vector<GateFailure> judge(const Inspection& inspection, const BuildOptions& options);

/// Components that hold no vertex of a hard bone and no point of a soft bone or frame.
std::vector<std::vector<int>> floating_components(const ControlLattice& lattice);

/// The triangles of faces that one cell alone has, quadrilaterals split about their mean.
std::vector<TriangleCorners> boundary_triangles(const CellComplex& complex);

/// Connected components of cells (joined by a shared vertex), each in ascending order of cells.
std::vector<std::vector<int>> components(const CellComplex& complex);

}  // namespace sinew::lattice::detail
