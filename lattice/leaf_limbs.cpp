#include "lattice/leaf_limbs.h"

#include <limits>

namespace sinew::lattice {

LeafLimbs::LeafLimbs(const ControlLattice& lattice, const Hierarchy& hierarchy, const LeafMesh& mesh,
                     const Surface& surface)
    : copies_(lattice), surface_(surface) {
  for (int c = 0; c < static_cast<int>(mesh.cells.size()); ++c)
    coarse_.push_back(sinew::lattice::coarse_cell(hierarchy, mesh, c));
  if (lattice.copies.empty()) return;
  for (const std::vector<Influence>& influences : surface.weights)
    frame_of_vertex_.push_back(skin_frame(influences, lattice.frame_of_joint));
}

bool LeafLimbs::owns_vertex(int cell, int skin_vertex) const {
  if (!is_copy(cell)) return true;
  return owns_frame(cell, frame_of_vertex_[static_cast<std::size_t>(skin_vertex)],
                    surface_.points.row(skin_vertex).transpose());
}

bool LeafLimbs::owns_flesh(int cell, const SurfaceQuery::Closest& skin) const {
  if (!is_copy(cell)) return true;
  int nearest = -1;
  double smallest = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const int v = surface_.triangles(skin.triangle, k);
    const double distance_squared = (surface_.points.row(v).transpose() - skin.point).squaredNorm();
    if (distance_squared < smallest) smallest = distance_squared, nearest = v;
  }
  return owns_vertex(cell, nearest);
}

}  // namespace sinew::lattice
