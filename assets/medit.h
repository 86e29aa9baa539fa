#pragma once

#include <string>

#include "assets/volume_mesh.h"

/// Medit's ASCII .mesh [Frey01]. (MFEM uses the same suffix for another format, which is refused by name.)
namespace sinew::assets {

/// The text of a .mesh file; shortest decimals that keep every bit. Regions are the references of the cells,
/// lines become edges, the annotation a comment behind the end.
std::string format_medit(const VolumeMesh& mesh);

/// Tetrahedra, Prisms and Hexahedra; other sections are skipped, Pyramids refused. `text` is the content,
/// `file` its name for messages. Cells are numbered from 1 within their section. Throws InputError with line
/// and section.
VolumeMesh parse_medit(const std::string& file, const std::string& text);

}  // namespace sinew::assets
