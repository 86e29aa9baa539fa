#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/SparseCore>

#include "lattice/hierarchy.h"

/// The active set and the cells on which it is integrated.
namespace sinew::lattice {

/// Which basis functions are active: one flag per vertex of the hierarchy. A plain value; may change at any
/// step.
using ActiveSet = std::vector<std::uint8_t>;

/// Every function up to and including `level` (0 .. num_levels), except those whose vertex lies on an edge
/// between two bone vertices that follow each other in a chain: their coefficient is 0 for ever, because the
/// midpoint of a bone piece moves as the mean of its ends. `chains` as in LatticeBone; finer bone midpoints
/// likewise.
ActiveSet uniform_active_set(const Hierarchy& hierarchy, int level,
                             const std::vector<std::vector<int>>& chains);

/// The integration cells of an active set, with the map from function coefficients to vertex values.
///
/// A leaf cell is the finest-level hexahedron on which a function is active, level 1 at least; every active
/// function is trilinear on it. Leaf vertices are the corners of leaf cells, in ascending order of their
/// hierarchy index.
struct LeafMesh {
  std::vector<HexVertices> cells;   ///< corners as leaf vertices, 0 .. num_vertices-1.
  std::vector<int> level;           ///< per cell, >= 1.
  std::vector<int> hex;             ///< per cell: its index among hierarchy.hexes(level).
  std::vector<int> vertices;        ///< leaf vertex -> hierarchy vertex.
  std::vector<int> leaf_of_vertex;  ///< hierarchy vertex -> leaf vertex or -1.
  std::vector<int> functions;  ///< active functions as hierarchy vertices, ascending; each is a leaf vertex.
  Points points;               ///< rest, num_vertices x 3 [m].
  /// Values at the leaf vertices from function coefficients: num_vertices x num_functions. Row a of an active
  /// level-0 vertex is a unit row; the rows sum to 1 over the level-0 functions.
  Eigen::SparseMatrix<double, Eigen::RowMajor> values_from_coefficients;

  int num_vertices() const { return static_cast<int>(vertices.size()); }
  int num_functions() const { return static_cast<int>(functions.size()); }
};

/// The cell of level 0 from which a leaf cell comes.
int coarse_cell(const Hierarchy& hierarchy, const LeafMesh& mesh, int cell);

/// Per cell of `fine` the cell of `mesh` that it is or lies in. Both are leaf meshes of one hierarchy over
/// the same cells of level 0, none of those of `mesh` finer than those of `fine`. Throws
/// std::invalid_argument where a cell lies in none.
std::vector<int> containing_cells(const LeafMesh& fine, const LeafMesh& mesh);

/// Throws std::invalid_argument where a level-0 function is inactive (they are always needed: they carry
/// affine motion) or the set has the wrong length. `kept`: one flag per cell of level 0, those whose leaf
/// cells are wanted; empty = all. What no kept cell touches stays out, as in restrict_cells.
LeafMesh leaf_mesh(const Hierarchy& hierarchy, const ActiveSet& active,
                   std::span<const std::uint8_t> kept = {});

/// The part of a leaf mesh over the cells for which keep[cell] != 0, for instance without empty cells;
/// vertices and functions that no kept cell touches leave as well. Level-0 functions of kept cells stay.
LeafMesh restrict_cells(const Hierarchy& hierarchy, const LeafMesh& mesh, std::span<const std::uint8_t> keep);

/// Leaf values on another leaf mesh of the hierarchy: shared vertices keep theirs, a vertex that is new has
/// the mean of its parents', coarse to fine. values: from.num_vertices() x 3; the result to.num_vertices()
/// x 3. Throws std::invalid_argument where `to` has a vertex of level 0 that `from` has not.
Points carried_values(const Hierarchy& hierarchy, const LeafMesh& from, const LeafMesh& to,
                      const Points& values);

}  // namespace sinew::lattice
