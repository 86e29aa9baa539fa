#pragma once

#include <functional>
#include <vector>

#include <Eigen/SparseCore>

#include "lattice/basis.h"

/// Points embedded in the lattice: where they are and how the basis moves them.
namespace sinew::lattice {

/// One point per row of the input.
struct Embedding {
  std::vector<int> cell;  ///< leaf cell that holds the point, or the nearest one.
  Points xi;              ///< local coordinates in that cell, num_points x 3 [-].
  /// Row of the leaf-vertex values: num_points x mesh.num_vertices(), eight weights a row, summing to 1.
  Eigen::SparseMatrix<double, Eigen::RowMajor> weights;
  /// Points that lie in no cell (farther than 1e-9 in local coordinates), ascending; they are extrapolated
  /// from the nearest cell.
  std::vector<int> outside;
};

/// Whether a point (row of the input) may lie in a leaf cell.
using CellFilter = std::function<bool(int point, int cell)>;

/// Embeds `points` (num_points x 3 [m]) in the leaf cells. Reproduces each point to 1e-12 of the lattice's
/// size where Newton's method converges. A point on a shared face goes to the cell with the smaller index;
/// where cells coincide, `may_hold` chooses between them. Throws std::invalid_argument where a point is not
/// finite or the lattice has no cells.
Embedding embed(const LeafMesh& mesh, const Points& points, const CellFilter& may_hold = {});

/// The embedding of the same points in a leaf mesh `to` over the same cells of level 0, none of its cells
/// finer than those of `from`. A cell's trilinear map is that of its children, so local coordinates change by
/// an affine map and no point is looked for again: each stays in the cell that it was in, or in the one that
/// is made of it. `leaf_of`: per cell of `from` the cell of `to` (containing_cells).
Embedding carried_embedding(const LeafMesh& from, const Embedding& embedding, const LeafMesh& to,
                            const std::vector<int>& leaf_of);

}  // namespace sinew::lattice
