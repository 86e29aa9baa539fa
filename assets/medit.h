#pragma once

#include <string>
#include <utility>
#include <vector>

#include "lattice/control_lattice.h"

/// Medit's ASCII .mesh [Frey01]. (MFEM uses the same suffix for another format, which is refused by name.)
namespace sinew::assets {

struct MeditMesh {
  lattice::CellComplex complex;
  /// Edges with a number each; the writer numbers the bones from 1.
  std::vector<std::pair<std::array<int, 2>, int>> edges;
};

/// The text of a .mesh file; 17 digits, so that every double keeps its bits.
std::string format_medit(const MeditMesh& mesh);

/// Tetrahedra, Prisms and Hexahedra; other sections are skipped, Pyramids refused. `text` is the content,
/// `file` its name for messages. Throws InputError with line and section.
MeditMesh parse_medit(const std::string& file, const std::string& text);

}  // namespace sinew::assets
