#pragma once

#include <vector>

#include "lattice/basis.h"
#include "lattice/limb_copies.h"
#include "lattice/surface_query.h"

/// Which leaf cell a piece of skin or flesh belongs to where several coincide.
namespace sinew::lattice {

/// Answers for the leaf cells of one mesh. A vertex of the skin follows its frame of most weight; flesh
/// follows the vertex nearest to the closest point of the skin: every piece of flesh belongs to exactly one
/// of the cells in its place, so that the copies together hold the mass of the place once.
class LeafLimbs {
 public:
  /// `surface` is the skin; its weights name joints of `lattice.frame_of_joint`. All must outlive the object.
  LeafLimbs(const ControlLattice& lattice, const Hierarchy& hierarchy, const LeafMesh& mesh,
            const Surface& surface);

  /// True where other leaf cells lie in the same place.
  bool is_copy(int cell) const { return copies_.is_copy(coarse_cell(cell)); }
  bool owns_frame(int cell, int frame, const Eigen::Vector3d& p) const {
    return copies_.owns(coarse_cell(cell), frame, p);
  }
  bool owns_vertex(int cell, int skin_vertex) const;
  /// Flesh whose closest point of the surface is `skin`.
  bool owns_flesh(int cell, const SurfaceQuery::Closest& skin) const;

 private:
  int coarse_cell(int cell) const { return coarse_[static_cast<std::size_t>(cell)]; }

  LimbCopies copies_;
  const Surface& surface_;
  std::vector<int> coarse_;           ///< per leaf cell.
  std::vector<int> frame_of_vertex_;  ///< empty where the lattice has no copies.
};

}  // namespace sinew::lattice
