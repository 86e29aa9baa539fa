#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "lattice/check_cells.h"
#include "lattice/control_lattice.h"

namespace sinew::assets {

/// How a format that knows both writes its numbers.
enum class Encoding { Ascii, Binary };

/// What a file of cells holds, whatever its format. Readers have checked every index; the shape and
/// orientation of the cells are the caller's to judge.
struct VolumeMesh {
  lattice::CellComplex complex;
  /// Region of every cell (a physical group, a reference, an attribute); empty where the file has none.
  std::vector<int> regions;
  std::vector<lattice::RegionName> region_names;  ///< of some of the regions.
  /// Lines between vertices; the writers draw the bones with them.
  struct Line {
    std::vector<int> vertices;
    int number = 0;
  };
  std::vector<Line> lines;
  std::vector<std::string> line_names;  ///< of lines 1, 2, ...; written where the format has names.
  /// How the file numbers its cells and vertices, for messages.
  lattice::Numbering numbering;
  /// The text that Sinew adds to its own files; empty in others'.
  std::string annotation;
};

/// Forgets regions that say nothing: all of number 0.
void drop_idle_regions(VolumeMesh& mesh);

/// Drops vertices that no cell has, as meshers leave them behind.
void drop_idle_vertices(VolumeMesh& mesh);

}  // namespace sinew::assets
