#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "assets/volume_mesh.h"
#include "lattice/control_lattice.h"

/// VTK's unstructured grids, as ParaView opens them: XML (.vtu, https://docs.vtk.org "VTKXMLFileFormats") and
/// legacy (.vtk, "VTKLegacyFileFormats").
namespace sinew::assets {

/// A named array on points, on cells or on the whole file, `components` values per tuple.
struct VtuArray {
  std::string name;
  int components = 1;
  std::variant<std::vector<double>, std::vector<std::int64_t>, std::vector<std::uint8_t>> values;
};

/// What such a file holds for us.
struct VtuGrid {
  lattice::Points points;
  std::vector<lattice::Cell> cells;
  /// Chains of points drawn as lines, after the cells; they have entries in `cell_arrays`, too.
  std::vector<std::vector<int>> lines;
  /// What a reader found the cells as, counting from 0 and with those it skipped; empty when writing.
  std::vector<std::int64_t> cell_numbers;
  std::vector<VtuArray> point_arrays;  ///< points.rows() tuples each.
  std::vector<VtuArray> cell_arrays;   ///< cells.size() + lines.size() tuples each.
  std::vector<VtuArray> file_arrays;   ///< any length.
};

/// The text of a .vtu file: base64 arrays of little-endian numbers, so that every double keeps its bits.
/// Throws std::invalid_argument where an array has the wrong length.
std::string format_vtu(const VtuGrid& grid);

/// Reads files of one piece that hold tetrahedra, wedges and hexahedra: ASCII, base64 or appended (raw or
/// base64), either byte order, plain or compressed by zlib. Points and faces among the cells are skipped,
/// arrays of other types than numbers ignored. `text` is the content, `file` its name for messages. Throws
/// InputError with the line and the array, LimitError where the data unpack to more than a file may hold.
VtuGrid parse_vtu(const std::string& file, const std::string& text);

/// The text of a legacy file, version 3.0. ASCII has the shortest decimals that keep every bit, and -1 for
/// NaN, which VTK cannot read there.
std::string format_vtk(const VtuGrid& grid, Encoding encoding);

/// Reads legacy files (versions 1.0 to 5.1, ASCII or binary) as parse_vtu() does.
VtuGrid parse_vtk(const std::string& file, const std::string& text);

}  // namespace sinew::assets
