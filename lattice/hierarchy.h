#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lattice/control_lattice.h"
#include "lattice/trilinear.h"

/// Subdivision of the control lattice and the vertices that carry the hierarchical (lazy wavelet) basis
/// ([Capell02, sec. 4.2]).
namespace sinew::lattice {

/// The lattice subdivided `num_levels` times. Vertices keep their index for ever: those of level 0 come
/// first, then those new on level 1, and so on, so that a vertex is also the name of its basis function: the
/// level-0 hat, or the hat of the level on which the vertex is new.
///
/// Invariants: points.row(v) is the mean of the points of parents(v) for every v new on a level >= 1; from
/// level 1 on every cell is a hexahedron in VTK's order with the isoparametric trilinear map; the children of
/// hexahedron h are 8h .. 8h+7, child k at its corner k.
class Hierarchy {
 public:
  /// Subdivides `complex`; num_levels in [1, 6]. Throws std::invalid_argument for a cell of no volume, an
  /// index out of range or a number of levels out of range.
  Hierarchy(const CellComplex& complex, int num_levels);

  int num_levels() const { return static_cast<int>(hexes_.size()); }
  /// Vertices that exist on `level`, 0 .. num_levels().
  int num_vertices(int level) const { return num_vertices_[static_cast<std::size_t>(level)]; }
  int num_vertices() const { return num_vertices_.back(); }
  /// Level on which vertex v is new.
  int level(int vertex) const { return level_[static_cast<std::size_t>(vertex)]; }
  /// The 2, 3, 4, 6 or 8 vertices whose mean v is; none on level 0.
  std::span<const int> parents(int vertex) const {
    const auto v = static_cast<std::size_t>(vertex);
    return {parents_.data() + parent_offsets_[v], parents_.data() + parent_offsets_[v + 1]};
  }
  /// Rest positions of all vertices, num_vertices() x 3 [m].
  const Points& points() const { return points_; }
  const CellComplex& coarse() const { return coarse_; }
  /// Hexahedra of a level in 1 .. num_levels().
  const std::vector<HexVertices>& hexes(int level) const {
    return hexes_[static_cast<std::size_t>(level - 1)];
  }
  /// First level-1 hexahedron of a coarse cell; it has num_corners(type), in the cell's corner order.
  int first_hex(int coarse_cell) const { return first_hex_[static_cast<std::size_t>(coarse_cell)]; }
  /// Coarse cell of a level-1 hexahedron.
  int coarse_cell(int hex) const { return coarse_cell_[static_cast<std::size_t>(hex)]; }

 private:
  void subdivide_coarse();
  void subdivide_hexes();
  int add_vertex(std::span<const int> parents);

  CellComplex coarse_;
  Points points_;
  std::vector<double> coordinates_;  ///< points while growing.
  std::vector<int> num_vertices_;
  std::vector<std::uint8_t> level_;
  std::vector<int> parent_offsets_{0};
  std::vector<int> parents_;
  std::vector<std::vector<HexVertices>> hexes_;
  std::vector<int> first_hex_;
  std::vector<int> coarse_cell_;
};

/// The three neighbours of each corner, ordered so that the corner's hexahedron is positively oriented.
std::span<const std::array<int, 3>> corner_neighbours(CellType type);

/// Local coordinates in a hexahedron of the point that has `xi` in its child `child` (0 .. 7): the child's
/// axes go from the hexahedron's corner along that corner's edges, and the trilinear map of both is the same.
Eigen::Vector3d in_parent(int child, const Eigen::Vector3d& xi);

/// Value transform, synthesis: overwrites the rows of inactive vertices (`is_active[v]` == 0) with the mean
/// of their parents' rows, coarse to fine because a parent may itself be inactive. values: num_vertices x 3.
void fill_inactive(const Hierarchy& hierarchy, std::span<const std::uint8_t> is_active, Points& values);

/// Coefficients of the hierarchical basis from vertex values: the value on level 0, value minus mean of the
/// parents' values on finer levels. num_vertices x 3 each.
Points analyse(const Hierarchy& hierarchy, const Points& values);
/// The inverse of analyse.
Points synthesise(const Hierarchy& hierarchy, const Points& coefficients);

}  // namespace sinew::lattice
