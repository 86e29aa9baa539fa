#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "lattice/control_lattice.h"

/// Judges cells that somebody else built.
namespace sinew::lattice {

/// The numbers that a file gives its cells and vertices; empty: 0, 1, 2, ...
struct Numbering {
  std::vector<std::int64_t> cells;
  std::vector<std::int64_t> vertices;

  std::int64_t cell(std::size_t c) const {
    return cells.empty() ? static_cast<std::int64_t>(c) : cells.at(c);
  }
  std::int64_t vertex(std::size_t v) const {
    return vertices.empty() ? static_cast<std::int64_t>(v) : vertices.at(v);
  }
};

/// Whether cells and vertices may lie at the same place without being joined: in lattices of the builder,
/// where limbs that are closer than a cell have copies of it.
enum class Coincidence { Refused, Allowed };

/// Two vertices nearer than this share of the longest side of the lattice's box count as one place, and a
/// vertex nearer to a face as lying on it: files round coordinates to six or seven digits.
inline constexpr double kSamePlace = 1e-6;

/// Programs disagree on the order of a cell's corners: turns every cell that is right but inside out. Cells
/// of no volume or with corners of both signs stay as they are.
void orient_cells(CellComplex& complex);

/// What is wrong with the cells, one line for each kind of fault, the gravest first, with the numbers of the
/// cells (at most 20); empty where they are a proper complex:
/// - a cell that names a vertex twice, or two cells of the same vertices;
/// - a cell that is inverted, flat or not convex: a corner of it, or of its level-1 hexahedra, with a
///   Jacobian that is not positive;
/// - two vertices at one place;
/// - a face of three cells, or of two on the same side of it;
/// - faces that do not match: a quadrilateral against triangles, a vertex inside somebody's face or edge;
/// - two cells that have a volume in common, more than what kSamePlace explains.
/// Indices must be in range.
std::vector<std::string> cell_faults(const CellComplex& complex, const Numbering& numbering = {},
                                     Coincidence coincidence = Coincidence::Refused);

/// "3, 5, 7", or "3, 5, ... and 12 more" with at most 20 numbers.
std::string number_list(const std::vector<std::int64_t>& numbers);

}  // namespace sinew::lattice
