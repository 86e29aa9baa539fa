#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "assets/detail/vtk_cells.h"
#include "assets/detail/vtu_data.h"
#include "assets/detail/xml_tags.h"
#include "assets/error.h"
#include "assets/vtu.h"

namespace sinew::assets {
namespace {

using detail::XmlTag;

/// A <DataArray> with its decoded numbers. Integers keep 64 bits, floats a double.
struct DataArray {
  std::string section;  ///< the element round it: Points, Cells, PointData, CellData, FieldData.
  std::string name;
  int components = 1;
  int line = 0;
  std::variant<std::vector<double>, std::vector<std::int64_t>, std::vector<std::uint8_t>> values;
};

class Reader {
 public:
  Reader(const std::string& file, const std::string& text)
      : file_(file), markup_(text), tags_(detail::xml_tags(file, markup_.text())) {}

  VtuGrid read() {
    read_head();
    read_arrays();
    VtuGrid grid;
    read_points(grid);
    read_cells(grid);
    for (DataArray& array : arrays_) {
      VtuArray out{array.name, array.components, std::move(array.values)};
      if (array.section == "PointData") grid.point_arrays.push_back(std::move(out));
      if (array.section == "CellData") detail::add_cell_array(out, num_cells_, places_, grid);
      if (array.section == "FieldData") grid.file_arrays.push_back(std::move(out));
    }
    return grid;
  }

 private:
  [[noreturn]] void fail(int line, const std::string& what) const {
    throw InputError(fmt::format("{}:{}", file_, line), what);
  }
  void read_head();
  void read_arrays();
  DataArray decode(const XmlTag& tag, const std::string& section) const;
  template <class Stored, class T>
  std::vector<T> decode_as(const XmlTag& tag, const std::string& label) const;
  template <class T>
  std::vector<T> decode_ascii(const XmlTag& tag, const std::string& label) const;
  const DataArray& find(const std::string& section, const std::string& name) const;
  std::int64_t count(const XmlTag& tag, const char* attribute) const;
  std::vector<std::int64_t> integers(const DataArray& array) const;
  void read_points(VtuGrid& grid) const;
  void read_cells(VtuGrid& grid);

  const std::string& file_;
  const detail::VtuMarkup markup_;  ///< the text that the tags point into.
  std::vector<XmlTag> tags_;
  std::vector<DataArray> arrays_;
  detail::VtuEncoding encoding_;
  std::vector<std::int64_t> places_;  ///< in the file's cells, of our cells and lines.
  std::int64_t num_points_ = 0, num_cells_ = 0;
  int piece_line_ = 0;
};

void Reader::read_head() {
  const auto head =
      std::find_if(tags_.begin(), tags_.end(), [](const XmlTag& t) { return t.name == "VTKFile"; });
  if (head == tags_.end())
    fail(1, "there is no <VTKFile> element; hint: save as XML unstructured grid (.vtu)");
  const std::string type = head->attribute("type");
  if (type != "UnstructuredGrid")
    fail(head->line, fmt::format("VTKFile: type, got '{}', expected 'UnstructuredGrid'", type));
  const std::string compressor = head->attribute("compressor");
  if (!compressor.empty() && compressor != "vtkZLibDataCompressor")
    fail(head->line, fmt::format("VTKFile: compressor, got '{}', expected 'vtkZLibDataCompressor' or none; "
                                 "hint: save with ZLib or without compression",
                                 compressor));
  encoding_.zlib = !compressor.empty();
  encoding_.swap_bytes = head->attribute("byte_order") == "BigEndian";
  if (head->attribute("header_type") == "UInt64") encoding_.header_bytes = 8;
  int pieces = 0;
  for (const XmlTag& tag : tags_) {
    if (tag.name == "AppendedData") encoding_.appended_is_raw = tag.attribute("encoding") == "raw";
    if (tag.name != "Piece") continue;
    if (++pieces > 1) fail(tag.line, "Piece: there are several, expected one; hint: merge the blocks");
    num_points_ = count(tag, "NumberOfPoints");
    num_cells_ = count(tag, "NumberOfCells");
    piece_line_ = tag.line;
  }
  if (pieces == 0) fail(head->line, "there is no <Piece> element");
}

std::int64_t Reader::count(const XmlTag& tag, const char* attribute) const {
  const std::string text = tag.attribute(attribute);
  std::int64_t value = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  // 2^31 - 1: indices of lattice vertices are ints.
  if (error != std::errc() || end != text.data() + text.size() || value < 0 || value > 2147483647)
    fail(tag.line, fmt::format("{}: {}, got '{}', expected a count", tag.name, attribute, text));
  return value;
}

void Reader::read_arrays() {
  std::string section;
  for (const XmlTag& tag : tags_) {
    for (const char* name : {"Points", "Cells", "PointData", "CellData", "FieldData"}) {
      if (tag.name == name) section = name;
      if (tag.name == std::string("/") + name) section.clear();
    }
    if (tag.name == "DataArray" && !section.empty()) arrays_.push_back(decode(tag, section));
  }
}

template <class T>
std::vector<T> Reader::decode_ascii(const XmlTag& tag, const std::string& label) const {
  std::vector<T> values;
  const char *p = tag.text.data(), *end = p + tag.text.size();
  int line = tag.text_line;
  while (true) {
    for (; p != end && (*p == ' ' || *p == '\n' || *p == '\r' || *p == '\t'); ++p) line += *p == '\n';
    if (p == end) return values;
    const char* stop = p;
    while (stop != end && *stop != ' ' && *stop != '\n' && *stop != '\r' && *stop != '\t') ++stop;
    // Bytes are read as integers: from_chars takes characters for what they are.
    std::conditional_t<std::is_same_v<T, double>, double, std::int64_t> value{};
    const auto [last, error] = std::from_chars(p, stop, value);
    if (error != std::errc() || last != stop)
      fail(line, fmt::format(
                     "{}: got '{}', expected a number", label,
                     std::string_view(p, static_cast<std::size_t>(std::min<std::ptrdiff_t>(stop - p, 40)))));
    values.push_back(static_cast<T>(value));
    p = stop;
  }
}

/// Stored: the type in the file; T: the type we keep.
template <class Stored, class T>
std::vector<T> Reader::decode_as(const XmlTag& tag, const std::string& label) const {
  const std::string format = tag.attribute("format");
  if (format == "ascii") return decode_ascii<T>(tag, label);
  const auto refuse = [&](const std::string& what) { fail(tag.text_line, label + ": " + what); };
  std::vector<std::uint8_t> bytes;
  if (format == "binary") {
    bytes = detail::vtu_inline_data(encoding_, tag.text, refuse);
  } else if (format == "appended") {
    bytes = detail::vtu_appended_data(encoding_, markup_.appended(), tag.attribute("offset"), refuse);
  } else {
    fail(tag.line,
         fmt::format("{}: format, got '{}', expected 'ascii', 'binary' or 'appended'", label, format));
  }
  if (bytes.size() % sizeof(Stored) != 0)
    refuse(fmt::format("got {} bytes, expected a multiple of {}", bytes.size(), sizeof(Stored)));
  const std::vector<Stored> stored = detail::numbers_from_bytes<Stored>(bytes, encoding_.swap_bytes);
  return std::vector<T>(stored.begin(), stored.end());
}

DataArray Reader::decode(const XmlTag& tag, const std::string& section) const {
  DataArray array;
  array.section = section;
  array.name = tag.attribute("Name");
  array.line = tag.line;
  const std::string label = "array '" + array.name + "'";
  if (!tag.attribute("NumberOfComponents").empty())
    array.components = static_cast<int>(count(tag, "NumberOfComponents"));
  if (array.components < 1) fail(tag.line, label + ": NumberOfComponents, got 0, expected at least 1");
  const std::string type = tag.attribute("type");
  if (type == "Float64")
    array.values = decode_as<double, double>(tag, label);
  else if (type == "Float32")
    array.values = decode_as<float, double>(tag, label);
  else if (type == "Int64" || type == "UInt64")
    array.values = decode_as<std::int64_t, std::int64_t>(tag, label);
  else if (type == "Int32")
    array.values = decode_as<std::int32_t, std::int64_t>(tag, label);
  else if (type == "UInt32")
    array.values = decode_as<std::uint32_t, std::int64_t>(tag, label);
  else if (type == "Int16")
    array.values = decode_as<std::int16_t, std::int64_t>(tag, label);
  else if (type == "UInt16")
    array.values = decode_as<std::uint16_t, std::int64_t>(tag, label);
  else if (type == "UInt8")
    array.values = decode_as<std::uint8_t, std::uint8_t>(tag, label);
  else if (type == "Int8")
    array.values = decode_as<std::int8_t, std::int64_t>(tag, label);
  return array;  // other types stay empty: strings of other programs
}

const DataArray& Reader::find(const std::string& section, const std::string& name) const {
  for (const DataArray& array : arrays_)
    if (array.section == section && (name.empty() || array.name == name)) return array;
  fail(piece_line_, name.empty() ? fmt::format("there is no array in <{}>", section)
                                 : fmt::format("there is no array '{}' in <{}>", name, section));
}

std::vector<std::int64_t> Reader::integers(const DataArray& array) const {
  if (const auto* values = std::get_if<std::vector<std::int64_t>>(&array.values)) return *values;
  if (const auto* bytes = std::get_if<std::vector<std::uint8_t>>(&array.values))
    return {bytes->begin(), bytes->end()};
  fail(array.line, "array '" + array.name + "': got floating-point numbers, expected integers");
}

void Reader::read_points(VtuGrid& grid) const {
  const DataArray& array = find("Points", "");
  const auto* values = std::get_if<std::vector<double>>(&array.values);
  if (values == nullptr || array.components != 3)
    fail(array.line, "array '" + array.name + "': expected three floating-point numbers per point");
  if (static_cast<std::int64_t>(values->size()) != 3 * num_points_)
    fail(array.line, fmt::format("array '{}': got {} numbers, expected 3 for each of {} points", array.name,
                                 values->size(), num_points_));
  for (std::size_t i = 0; i < values->size(); ++i)
    if (!std::isfinite((*values)[i]))
      fail(array.line, fmt::format("array '{}': point {} is not finite", array.name, i / 3));
  grid.points = Eigen::Map<const lattice::Points>(values->data(), num_points_, 3);
}

void Reader::read_cells(VtuGrid& grid) {
  const int line = find("Cells", "types").line;
  const detail::VtkCells cells{integers(find("Cells", "connectivity")), integers(find("Cells", "offsets")),
                               integers(find("Cells", "types"))};
  if (static_cast<std::int64_t>(cells.offsets.size()) != num_cells_ ||
      static_cast<std::int64_t>(cells.types.size()) != num_cells_)
    fail(line, fmt::format("Cells: got {} offsets and {} types, expected {} of each", cells.offsets.size(),
                           cells.types.size(), num_cells_));
  places_ =
      detail::read_vtk_cells(cells, num_points_, grid, [&](const std::string& what) { fail(line, what); });
}

}  // namespace

VtuGrid parse_vtu(const std::string& file, const std::string& text) { return Reader(file, text).read(); }

}  // namespace sinew::assets
