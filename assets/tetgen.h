#pragma once

#include <string>

#include "assets/volume_mesh.h"

/// TetGen's pairs of files [Si15]: vertices in .node, tetrahedra in .ele.
namespace sinew::assets {

struct TetgenTexts {
  std::string node, ele;
};

/// Numbered from 1; shortest decimals that keep every bit. Regions are an attribute of the cells, the
/// annotation a comment in .node; lines have no place. Throws ConfigError where a cell is no tetrahedron.
TetgenTexts format_tetgen(const VolumeMesh& mesh);

/// Numbered from 0 or from 1, as the first vertex says; attributes but the first of the cells are skipped.
/// Throws InputError with file and line.
VolumeMesh parse_tetgen(const std::string& node_file, const std::string& node, const std::string& ele_file,
                        const std::string& ele);

}  // namespace sinew::assets
