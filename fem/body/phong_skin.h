#pragma once

#include <Eigen/SparseCore>

#include "lattice/embedding.h"
#include "lattice/fill.h"
#include "lattice/surface.h"

/// A smooth skin on coarse cells.
namespace sinew::fem {

/// How leaf values move the skin ([James20], Phong deformation): num_points x mesh.num_vertices(),
///   x(X) = sum_a phi_a [x_a + s F_a (X - X_a)],
/// F_a the mean of the gradients of the cells round leaf vertex a that hang together, weighted with their
/// flesh. Trilinear cells
/// alone kink where they meet, which a skin of finer triangles shows as facets. Exact for every affine
/// motion, as the trilinear rows are; s = `share` where the triangles round a point are at most half as long
/// as its cell, 0 where they are as long (there the wider stencil hurts), linear between. Points outside of
/// the lattice keep their trilinear rows. `skin`: of surface.points; `fill`: one per leaf cell.
Eigen::SparseMatrix<double, Eigen::RowMajor> phong_rows(const lattice::LeafMesh& mesh,
                                                        const std::vector<lattice::FillFractions>& fill,
                                                        const lattice::Embedding& skin,
                                                        const lattice::Surface& surface, double share);

}  // namespace sinew::fem
