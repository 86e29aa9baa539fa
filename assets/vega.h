#pragma once

#include <string>

#include "assets/volume_mesh.h"

/// Vega FEM's .veg files [Sin13]: tetrahedra or hexahedra, materials by sets of cells.
namespace sinew::assets {

/// Numbered from 1; shortest decimals that keep every bit. Regions become sets, the annotation a comment;
/// lines have no place. Throws ConfigError where the cells are not all tetrahedra or all hexahedra.
std::string format_vega(const VolumeMesh& mesh);

/// Numbered from 0 or from 1, as the first vertex says. Every *REGION of a set is a region, numbered in the
/// file's order; where a cell is in several, the last one counts. Throws InputError with the line.
VolumeMesh parse_vega(const std::string& file, const std::string& text);

}  // namespace sinew::assets
