#include "assets/vtu.h"

#include <bit>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>

#include "assets/detail/base64.h"
#include "assets/detail/vtk_cells.h"

namespace sinew::assets {
namespace {

static_assert(std::endian::native == std::endian::little, "arrays are written as they lie in memory");

std::string escape(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '"')
      out += "&quot;";
    else
      out += c;
  }
  return out;
}

template <class T>
const char* type_name() {
  if constexpr (std::is_same_v<T, double>)
    return "Float64";
  else if constexpr (std::is_same_v<T, std::int64_t>)
    return "Int64";
  else
    return "UInt8";
}

/// VTK's inline binary form: the number of bytes as UInt64, then the bytes, in one run of base64.
template <class T>
void append_array(std::string& out, const std::string& name, int components, const std::vector<T>& values,
                  bool file_array = false) {
  const std::uint64_t bytes = values.size() * sizeof(T);
  std::vector<std::uint8_t> raw(sizeof(bytes) + bytes);
  std::memcpy(raw.data(), &bytes, sizeof(bytes));
  if (bytes > 0) std::memcpy(raw.data() + sizeof(bytes), values.data(), bytes);
  out += fmt::format("<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\"", type_name<T>(),
                     escape(name), components);
  if (file_array)
    out += fmt::format(" NumberOfTuples=\"{}\"", values.size() / static_cast<std::size_t>(components));
  out += " format=\"binary\">\n" + detail::encode_base64(raw) + "\n</DataArray>\n";
}

void append_arrays(std::string& out, const std::vector<VtuArray>& arrays, std::size_t tuples) {
  for (const VtuArray& array : arrays)
    std::visit(
        [&](const auto& values) {
          if (values.size() != tuples * static_cast<std::size_t>(array.components)) {
            throw std::invalid_argument(fmt::format("vtu: array '{}' has {} values for {} tuples of {}",
                                                    array.name, values.size(), tuples, array.components));
          }
          append_array(out, array.name, array.components, values);
        },
        array.values);
}

void append_cells(std::string& out, const VtuGrid& grid) {
  const detail::VtkCells cells = detail::vtk_cells(grid);
  out += "<Cells>\n";
  append_array(out, "connectivity", 1, cells.connectivity);
  append_array(out, "offsets", 1, cells.offsets);
  append_array(out, "types", 1, std::vector<std::uint8_t>(cells.types.begin(), cells.types.end()));
  out += "</Cells>\n";
}

}  // namespace

std::string format_vtu(const VtuGrid& grid) {
  std::string out =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
      "byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<UnstructuredGrid>\n";
  if (!grid.file_arrays.empty()) {
    out += "<FieldData>\n";
    for (const VtuArray& array : grid.file_arrays)
      std::visit([&](const auto& values) { append_array(out, array.name, array.components, values, true); },
                 array.values);
    out += "</FieldData>\n";
  }
  const std::size_t num_cells = grid.cells.size() + grid.lines.size();
  out += fmt::format("<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n", grid.points.rows(), num_cells);
  out += "<PointData>\n";
  append_arrays(out, grid.point_arrays, static_cast<std::size_t>(grid.points.rows()));
  out += "</PointData>\n<CellData>\n";
  append_arrays(out, grid.cell_arrays, num_cells);
  out += "</CellData>\n<Points>\n";
  append_array(out, "Points", 3,
               std::vector<double>(grid.points.data(), grid.points.data() + grid.points.size()));
  out += "</Points>\n";
  append_cells(out, grid);
  out += "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
  return out;
}

}  // namespace sinew::assets
