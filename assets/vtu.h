#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "lattice/control_lattice.h"

/// VTK's XML unstructured grids (.vtu, https://docs.vtk.org "VTKXMLFileFormats"), as ParaView opens them.
namespace sinew::assets {

/// A named array on points, on cells or on the whole file, `components` values per tuple.
struct VtuArray {
  std::string name;
  int components = 1;
  std::variant<std::vector<double>, std::vector<std::int64_t>, std::vector<std::uint8_t>> values;
};

/// What a .vtu file holds for us.
struct VtuGrid {
  lattice::Points points;
  std::vector<lattice::Cell> cells;
  /// Chains of points drawn as lines, after the cells; they have entries in `cell_arrays`, too.
  std::vector<std::vector<int>> lines;
  std::vector<VtuArray> point_arrays;  ///< points.rows() tuples each.
  std::vector<VtuArray> cell_arrays;   ///< cells.size() + lines.size() tuples each.
  std::vector<VtuArray> file_arrays;   ///< any length.
};

/// The text of a .vtu file: base64 arrays of little-endian numbers, so that every double keeps its bits.
/// Throws std::invalid_argument where an array has the wrong length.
std::string format_vtu(const VtuGrid& grid);

/// Reads what format_vtu writes, and ASCII or uncompressed base64 files of other programs that hold
/// tetrahedra, wedges and hexahedra; points, lines and faces among the cells are skipped, arrays of other
/// types ignored. `text` is the content, `file` its name for messages. Throws InputError with the line and
/// the array.
VtuGrid parse_vtu(const std::string& file, const std::string& text);

}  // namespace sinew::assets
