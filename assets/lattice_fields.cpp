#include "assets/lattice_files.h"
#include "lattice/basis.h"
#include "lattice/fill.h"
#include "lattice/hierarchy.h"
#include "lattice/surface_query.h"

namespace sinew::assets {

LatticeFields skin_fields(const lattice::ControlLattice& lattice, const lattice::Surface& skin) {
  const lattice::Hierarchy hierarchy(lattice.complex, 1);
  const lattice::LeafMesh mesh = lattice::leaf_mesh(
      hierarchy, lattice::ActiveSet(static_cast<std::size_t>(hierarchy.num_vertices()), 1));
  // Flesh of open sheets reaches this share of the edge length from the skin, as in the simulation.
  constexpr double kShell = 0.03;
  const std::vector<lattice::FillFractions> octants = lattice::fill_fractions(
      mesh, lattice::SurfaceQuery(skin.points, skin.triangles), kShell * lattice.edge_length);
  std::vector<double> fill(lattice.complex.cells.size(), 0.0);
  for (std::size_t h = 0; h < octants.size(); ++h) {
    const auto cell = static_cast<std::size_t>(hierarchy.coarse_cell(mesh.hex[h]));
    const double share = 1.0 / (8.0 * num_corners(lattice.complex.cells[cell].type));
    for (double octant : octants[h]) fill[cell] += share * octant;
  }
  const std::vector<std::int64_t> level(lattice.complex.cells.size(), 0);
  return {{}, {{"fill", 1, fill}, {"level", 1, level}}};
}

}  // namespace sinew::assets
