#include "fem/body/orientation.h"

#include <stdexcept>
#include <string>

#include "fem/body/cell_matrices.h"

namespace sinew::fem {

void check_orientation(const lattice::LeafMesh& mesh) {
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const auto corners = lattice::hex_corners(mesh.points, mesh.cells[c]);
    for (int q = 0; q < 8; ++q) {
      if (!(lattice::trilinear_jacobian(corners, gauss_point(q)).determinant() > 0.0)) {
        throw std::invalid_argument("leaf cell " + std::to_string(c) + " is inverted at rest");
      }
    }
  }
}

}  // namespace sinew::fem
