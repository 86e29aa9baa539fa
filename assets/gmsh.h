#pragma once

#include <string>

#include "assets/volume_mesh.h"

/// Gmsh's .msh files [Geuzaine09], versions 2.2 and 4.1, ASCII and binary (little-endian).
namespace sinew::assets {

enum class GmshVersion { V22, V41 };

/// Nodes and elements numbered from 1, cells first. Doubles keep every bit. Regions become physical volumes,
/// lines physical curves, both with their names; the annotation is a section of its own, which Gmsh skips.
std::string format_gmsh(const VolumeMesh& mesh, GmshVersion version, Encoding encoding);

/// Tetrahedra, prisms and hexahedra of the first order; points, lines and faces are skipped, pyramids and
/// higher orders refused. Cells come in the order of the file; a cell's region is its (first) physical group.
/// Throws InputError with the line and the thing.
VolumeMesh parse_gmsh(const std::string& file, const std::string& text);

}  // namespace sinew::assets
