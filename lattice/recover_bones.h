#pragma once

#include "lattice/check_cells.h"
#include "lattice/control_lattice.h"
#include "lattice/surface.h"

namespace sinew::lattice {

/// How bones are found in the edges of cells that somebody else built.
struct RecoverOptions {
  /// How far a lattice vertex may lie from the joint or bone it stands for, as a share of the longest side of
  /// the skin's box; in (0, 0.1]. Vertices that are taken are moved onto the bone: files round coordinates,
  /// and bones are drawn by hand.
  double snap_tolerance = 1e-4;
  /// A bone without a chain of edges is held by penalty instead of being refused, and a part of the lattice
  /// that no bone reaches is tied to the joint that moves most of its skin.
  bool soft_bones = false;

  /// Throws std::invalid_argument naming the field.
  void validate() const;
};

/// Makes a control lattice of cells that somebody else built: reduces the skeleton at the cells' mean edge
/// length and takes for every bone the chain of edges that lies on it. `changes` lists what became of the
/// skeleton. The quality is measured. Throws std::invalid_argument where the skin, the joints or the cells
/// cannot be used, where a bone is no chain of edges (with its nearest edge and the distance) or where a
/// component holds no bone; `numbering` serves these messages.
ControlLattice recover_bones(const CellComplex& complex, const Surface& skin, const JointTree& joints,
                             const RecoverOptions& options = {}, const Numbering& numbering = {});

/// One line about skin vertices outside the lattice: how many, how far the farthest, the first ones; empty
/// where there are none.
std::string skin_outside(const CellComplex& complex, const Surface& skin);

/// One line about components of cells that hold no bone and no soft frame; empty where there are none.
std::string parts_without_bone(const ControlLattice& lattice, const Numbering& numbering = {});

}  // namespace sinew::lattice
