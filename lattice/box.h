#pragma once

#include <optional>
#include <vector>

#include "lattice/control_lattice.h"

/// Boxes of cells: the lattice of tests, bars and plain scenes.
namespace sinew::lattice {

/// A box cut into equal blocks, each block into cells of one type.
struct BoxOptions {
  Eigen::Vector3d min{0, 0, 0};     ///< lower corner [m].
  Eigen::Vector3d max{1, 1, 1};     ///< upper corner [m]; above `min` on every axis.
  Eigen::Vector3i blocks{1, 1, 1};  ///< number of blocks along x, y, z; >= 1.
  /// What a block becomes: one hexahedron, two wedges (cut along the plane x = y of the block, axis z) or the
  /// six tetrahedra round the block's diagonal ([Kuhn60]).
  CellType type = CellType::Hexahedron;
  /// The type of every block instead, x fastest; a block without one is left out. Empty or one per block.
  /// Hexahedra go beside wedges in x and y, tetrahedra above and below wedges; anything else would need
  /// pyramids and is refused.
  std::vector<std::optional<CellType>> types;

  /// Throws std::invalid_argument naming the field, its value and the rule it breaks.
  void validate() const;
};

/// The cells of the box, block by block (x fastest). Vertices are the grid's, x fastest, less those that no
/// block uses: without holes vertex (i, j, k) is i + (nx + 1) (j + (ny + 1) k). Throws std::invalid_argument
/// where the options are out of range or two blocks do not meet in whole faces.
CellComplex box_lattice(const BoxOptions& options);

}  // namespace sinew::lattice
