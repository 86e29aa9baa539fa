#pragma once

#include <array>

#include "fem/material/material.h"
#include "lattice/fill.h"
#include "lattice/trilinear.h"

/// What a hexahedron has of its eight children, child k at its corner k: it holds as much flesh, and as much
/// mass, as they do together.
namespace sinew::fem {

/// Fill of each child's octant in the mean, then all of the cell's octants scaled alike until the cell holds
/// the flesh of its children to rounding: in a cell that is no box an octant's Gauss weight is not quite the
/// volume of the child there. Full stays full and empty stays empty. `children`: their corners.
lattice::FillFractions coarser_fill(const lattice::HexCorners& corners,
                                    const std::array<lattice::HexCorners, 8>& children,
                                    const std::array<lattice::FillFractions, 8>& fill);

/// Shear modulus, bulk modulus and density in the mean, weighted with the children's `volumes` of flesh
/// [m^3]; the children's own where all have the same.
Material coarser_material(const std::array<Material, 8>& materials, const std::array<double, 8>& volumes);

}  // namespace sinew::fem
