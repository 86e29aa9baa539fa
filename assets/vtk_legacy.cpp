#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include <fmt/format.h>

#include "assets/detail/text.h"
#include "assets/detail/text_scanner.h"
#include "assets/detail/vtk_cells.h"
#include "assets/detail/vtu_data.h"
#include "assets/error.h"
#include "assets/vtu.h"

/// Legacy files: lines of keywords with numbers behind them, in ASCII or big-endian.
namespace sinew::assets {
namespace {

using Values = decltype(VtuArray::values);

class Reader {
 public:
  Reader(const std::string& file, const std::string& text) : in_(file, text) {}
  VtuGrid read();

 private:
  void read_head();
  void read_points();
  void read_cells();
  void read_cells_51(std::int64_t num_offsets, std::int64_t size);
  void read_types();
  void read_field(std::vector<VtuArray>* arrays);
  void read_attribute(const std::string& keyword);
  void skip_metadata();
  Values values(const std::string& type, std::uint64_t count, const std::string& thing);
  template <class Stored, class T>
  std::vector<T> values_as(std::uint64_t count, const std::string& thing);
  std::vector<std::int64_t> integers(const std::string& type, std::uint64_t count, const std::string& thing);
  std::string word(const std::string& thing) { return std::string(in_.need_word(thing)); }
  std::int64_t count(const std::string& thing, std::size_t bytes_each) {
    return in_.count(thing, bytes_each);
  }

  detail::TextScanner in_;
  VtuGrid grid_;
  bool binary_ = false;
  double version_ = 3.0;
  std::int64_t num_points_ = -1, num_tuples_ = 0;
  bool has_cells_ = false, has_types_ = false;
  detail::VtkCells cells_;
  std::vector<VtuArray>* section_ = nullptr;  ///< where the next attributes belong.
  std::vector<VtuArray> cell_arrays_;
};

void Reader::read_head() {
  const std::string_view first = in_.rest_of_line();
  constexpr std::string_view kMark = "# vtk DataFile Version ";
  if (!first.starts_with(kMark)) in_.fail("expected '# vtk DataFile Version' first");
  const std::string version(first.substr(kMark.size(), 3));
  if (version.size() != 3 || version[1] != '.' || version[0] < '1' || version[0] > '5')
    in_.fail(fmt::format("version, got '{}', expected 1.0 ... 5.1", detail::printable(version)));
  version_ = version[0] - '0' + 0.1 * (version[2] - '0');
  in_.rest_of_line();  // the title
  const std::string encoding = word("encoding");
  if (encoding != "ASCII" && encoding != "BINARY")
    in_.fail(fmt::format("encoding, got '{}', expected ASCII or BINARY",
                         detail::printable(encoding.substr(0, 40))));
  binary_ = encoding == "BINARY";
  if (word("DATASET") != "DATASET") in_.fail("expected 'DATASET'");
  const std::string kind = word("DATASET");
  if (kind != "UNSTRUCTURED_GRID")
    in_.fail(
        fmt::format("DATASET, got '{}', expected UNSTRUCTURED_GRID", detail::printable(kind.substr(0, 40))));
}

VtuGrid Reader::read() {
  read_head();
  while (const std::optional<std::string_view> next = in_.word()) {
    const std::string keyword(*next);
    if (keyword == "POINTS") {
      read_points();
    } else if (keyword == "CELLS") {
      read_cells();
    } else if (keyword == "CELL_TYPES") {
      read_types();
    } else if (keyword == "FIELD") {
      read_field(section_ == nullptr ? &grid_.file_arrays : section_);
    } else if (keyword == "METADATA") {
      skip_metadata();
    } else if (keyword == "POINT_DATA" || keyword == "CELL_DATA") {
      num_tuples_ = in_.integer(keyword, 0, 2147483647);
      section_ = keyword == "POINT_DATA" ? &grid_.point_arrays : &cell_arrays_;
    } else {
      read_attribute(keyword);
    }
  }
  if (num_points_ < 0) in_.fail("there is no section POINTS");
  if (!has_cells_ || !has_types_) in_.fail("there are no sections CELLS and CELL_TYPES");
  if (cells_.types.size() != cells_.offsets.size())
    in_.fail(fmt::format("CELL_TYPES: got {}, expected {}", cells_.types.size(), cells_.offsets.size()));
  const std::vector<std::int64_t> places =
      detail::read_vtk_cells(cells_, num_points_, grid_, [&](const std::string& what) { in_.fail(what); });
  for (const VtuArray& array : cell_arrays_)
    detail::add_cell_array(array, static_cast<std::int64_t>(cells_.types.size()), places, grid_);
  return std::move(grid_);
}

/// A block up to an empty line.
void Reader::skip_metadata() {
  in_.rest_of_line();
  while (in_.bytes_left() > 0 && !in_.rest_of_line().empty()) {
  }
}

template <class Stored, class T>
std::vector<T> Reader::values_as(std::uint64_t count, const std::string& thing) {
  if (binary_) {
    in_.skip_line();
    in_.check_count(thing, count, sizeof(Stored));
    const std::string_view raw = in_.bytes(thing, count * sizeof(Stored));
    const auto stored =
        detail::numbers_from_bytes<Stored>(std::vector<std::uint8_t>(raw.begin(), raw.end()), true);
    return std::vector<T>(stored.begin(), stored.end());
  }
  in_.check_count(thing, count, 2);
  std::vector<T> out;
  for (std::uint64_t i = 0; i < count; ++i) {
    if constexpr (std::is_same_v<T, double>)
      out.push_back(in_.real(thing));
    else
      out.push_back(static_cast<T>(in_.integer(thing, std::numeric_limits<std::int64_t>::min(),
                                               std::numeric_limits<std::int64_t>::max())));
  }
  return out;
}

Values Reader::values(const std::string& type, std::uint64_t count, const std::string& thing) {
  if (type == "double") return values_as<double, double>(count, thing);
  if (type == "float") return values_as<float, double>(count, thing);
  if (type == "int") return values_as<std::int32_t, std::int64_t>(count, thing);
  if (type == "unsigned_int") return values_as<std::uint32_t, std::int64_t>(count, thing);
  if (type == "long" || type == "unsigned_long" || type == "vtktypeint64")
    return values_as<std::int64_t, std::int64_t>(count, thing);
  if (type == "vtkIdType") return values_as<std::int32_t, std::int64_t>(count, thing);  // always 32 bits here
  if (type == "short") return values_as<std::int16_t, std::int64_t>(count, thing);
  if (type == "unsigned_short") return values_as<std::uint16_t, std::int64_t>(count, thing);
  if (type == "char") return values_as<std::int8_t, std::int64_t>(count, thing);
  if (type == "unsigned_char") return values_as<std::uint8_t, std::uint8_t>(count, thing);
  in_.fail(fmt::format("{}: type, got '{}', expected a type of numbers", thing,
                       detail::printable(type.substr(0, 40))));
}

std::vector<std::int64_t> Reader::integers(const std::string& type, std::uint64_t count,
                                           const std::string& thing) {
  Values found = values(type, count, thing);
  if (auto* numbers = std::get_if<std::vector<std::int64_t>>(&found)) return std::move(*numbers);
  if (const auto* bytes = std::get_if<std::vector<std::uint8_t>>(&found))
    return {bytes->begin(), bytes->end()};
  in_.fail(fmt::format("{}: got floating-point numbers, expected integers", thing));
}

void Reader::read_points() {
  if (num_points_ >= 0) in_.fail("POINTS: there are two such sections");
  num_points_ = count("POINTS", 3);
  const Values found = values(word("POINTS"), 3 * static_cast<std::uint64_t>(num_points_), "POINTS");
  const auto* numbers = std::get_if<std::vector<double>>(&found);
  if (numbers == nullptr) in_.fail("POINTS: expected type float or double");
  for (std::size_t i = 0; i < numbers->size(); ++i)
    if (!std::isfinite((*numbers)[i])) in_.fail(fmt::format("POINTS: point {} is not finite", i / 3));
  grid_.points = Eigen::Map<const lattice::Points>(numbers->data(), num_points_, 3);
}

/// Up to version 4: for every cell the number of its points, then the points.
void Reader::read_cells() {
  if (has_cells_) in_.fail("CELLS: there are two such sections");
  has_cells_ = true;
  const std::int64_t n = count("CELLS", 1), size = count("CELLS", 1);
  if (version_ > 5.0) return read_cells_51(n, size);
  const std::vector<std::int64_t> list = integers("int", static_cast<std::uint64_t>(size), "CELLS");
  std::size_t at = 0;
  for (std::int64_t c = 0; c < n; ++c) {
    const std::int64_t points = at < list.size() ? list[at] : -1;
    if (points < 0 || points > static_cast<std::int64_t>(list.size() - at) - 1)
      in_.fail(fmt::format("CELLS: cell {}: number of points, got {}, expected 0..{}", c, points,
                           at < list.size() ? list.size() - at - 1 : 0));
    const auto first = list.begin() + static_cast<std::ptrdiff_t>(at) + 1;
    cells_.connectivity.insert(cells_.connectivity.end(), first, first + points);
    cells_.offsets.push_back(static_cast<std::int64_t>(cells_.connectivity.size()));
    at += static_cast<std::size_t>(points) + 1;
  }
  if (at != list.size()) in_.fail(fmt::format("CELLS: got {} numbers, expected {}", list.size(), at));
}

/// From version 5: offsets, the first of them 0, and connectivity.
void Reader::read_cells_51(std::int64_t num_offsets, std::int64_t size) {
  if (word("CELLS") != "OFFSETS") in_.fail("CELLS: expected OFFSETS");
  const std::string offset_type = word("OFFSETS");
  std::vector<std::int64_t> offsets =
      integers(offset_type, static_cast<std::uint64_t>(num_offsets), "OFFSETS");
  if (word("CELLS") != "CONNECTIVITY") in_.fail("CELLS: expected CONNECTIVITY");
  const std::string type = word("CONNECTIVITY");
  cells_.connectivity = integers(type, static_cast<std::uint64_t>(size), "CONNECTIVITY");
  if (!offsets.empty()) offsets.erase(offsets.begin());
  cells_.offsets = std::move(offsets);
}

void Reader::read_types() {
  if (has_types_) in_.fail("CELL_TYPES: there are two such sections");
  has_types_ = true;
  const std::int64_t n = count("CELL_TYPES", 1);
  cells_.types = integers("int", static_cast<std::uint64_t>(n), "CELL_TYPES");
}

void Reader::read_field(std::vector<VtuArray>* arrays) {
  word("FIELD");
  const std::int64_t n = in_.integer("FIELD", 0, 100000);
  for (std::int64_t i = 0; i < n; ++i) {
    std::string name = word("FIELD");
    if (name == "METADATA") {
      skip_metadata();
      name = word("FIELD");
    }
    const std::string thing = "array '" + detail::printable(name.substr(0, 80)) + "'";
    const auto components = in_.integer(thing, 1, 1000000);
    const std::int64_t tuples = count(thing, 1);
    const std::string type = word(thing);
    arrays->push_back(
        {name, static_cast<int>(components),
         values(type, static_cast<std::uint64_t>(components) * static_cast<std::uint64_t>(tuples), thing)});
  }
}

/// The attributes of POINT_DATA and CELL_DATA.
void Reader::read_attribute(const std::string& keyword) {
  static const std::map<std::string, int> kComponents{
      {"SCALARS", 1}, {"VECTORS", 3}, {"NORMALS", 3}, {"TENSORS", 9}, {"TENSORS6", 6}};
  const auto known = kComponents.find(keyword);
  if (section_ == nullptr || (known == kComponents.end() && keyword != "LOOKUP_TABLE" &&
                              keyword != "COLOR_SCALARS" && keyword != "TEXTURE_COORDINATES"))
    in_.fail(fmt::format("got '{}', expected a keyword like POINTS, CELLS or CELL_DATA",
                         detail::printable(keyword.substr(0, 40))));
  const std::string name = word(keyword), thing = "array '" + detail::printable(name.substr(0, 80)) + "'";
  const auto tuples = static_cast<std::uint64_t>(num_tuples_);
  if (keyword == "LOOKUP_TABLE") {
    const auto size = static_cast<std::uint64_t>(in_.integer(thing, 0, 100000000));
    values(binary_ ? "unsigned_char" : "float", 4 * size, thing);
  } else if (keyword == "COLOR_SCALARS") {
    const auto components = static_cast<std::uint64_t>(in_.integer(thing, 1, 4));
    values(binary_ ? "unsigned_char" : "float", components * tuples, thing);
  } else if (keyword == "TEXTURE_COORDINATES") {
    const auto components = static_cast<std::uint64_t>(in_.integer(thing, 1, 3));
    values(word(thing), components * tuples, thing);
  } else {
    const std::string type = word(thing);
    int components = known->second;
    if (keyword == "SCALARS") {
      // "SCALARS name type [components]", then "LOOKUP_TABLE name" on a line of its own.
      const std::string_view rest = in_.rest_of_line();
      if (!rest.empty())
        components = rest == "1" ? 1 : rest == "2" ? 2 : rest == "3" ? 3 : rest == "4" ? 4 : -1;
      if (components < 0) in_.fail(fmt::format("{}: number of components, expected 1..4", thing));
      if (word(thing) != "LOOKUP_TABLE") in_.fail(fmt::format("{}: expected LOOKUP_TABLE", thing));
      word(thing);
    }
    section_->push_back(
        {name, components, values(type, static_cast<std::uint64_t>(components) * tuples, thing)});
  }
}

template <class T>
void append_number(std::string& out, T value, Encoding encoding) {
  if (encoding == Encoding::Ascii) {
    if constexpr (sizeof(T) == 1)
      out += fmt::format("{} ", static_cast<int>(value));
    else if constexpr (std::is_same_v<T, double>)
      out += std::isnan(value) ? std::string("-1 ") : fmt::format("{} ", value);  // VTK cannot read "nan"
    else
      out += fmt::format("{} ", value);
    return;
  }
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  std::reverse(bytes, bytes + sizeof(T));
  out.append(bytes, sizeof(T));
}

constexpr const char* type_name(const std::vector<double>&) { return "double"; }
constexpr const char* type_name(const std::vector<std::int64_t>&) { return "vtktypeint64"; }
constexpr const char* type_name(const std::vector<std::uint8_t>&) { return "unsigned_char"; }

void append_field(std::string& out, const std::vector<VtuArray>& arrays, Encoding encoding) {
  out += fmt::format("FIELD FieldData {}\n", arrays.size());
  for (const VtuArray& array : arrays)
    std::visit(
        [&](const auto& values) {
          std::string name = array.name;
          std::replace(name.begin(), name.end(), ' ', '_');
          out += fmt::format("{} {} {} {}\n", name, array.components,
                             values.size() / static_cast<std::size_t>(array.components), type_name(values));
          for (std::size_t i = 0; i < values.size(); ++i) {
            append_number(out, values[i], encoding);
            if (encoding == Encoding::Ascii && i % 30 == 29) out += '\n';  // lines of readable length
          }
          out += '\n';
        },
        array.values);
}

}  // namespace

VtuGrid parse_vtk(const std::string& file, const std::string& text) { return Reader(file, text).read(); }

std::string format_vtk(const VtuGrid& grid, Encoding encoding) {
  const bool is_ascii = encoding == Encoding::Ascii;
  std::string out = fmt::format("# vtk DataFile Version 3.0\nSinew lattice\n{}\nDATASET UNSTRUCTURED_GRID\n",
                                is_ascii ? "ASCII" : "BINARY");
  if (!grid.file_arrays.empty()) append_field(out, grid.file_arrays, encoding);
  out += fmt::format("POINTS {} double\n", grid.points.rows());
  for (Eigen::Index v = 0; v < grid.points.rows(); ++v) {
    for (int k = 0; k < 3; ++k) append_number(out, grid.points(v, k), encoding);
    if (is_ascii) out.back() = '\n';
  }
  const detail::VtkCells cells = detail::vtk_cells(grid);
  out += fmt::format("{}CELLS {} {}\n", is_ascii ? "" : "\n", cells.types.size(),
                     cells.types.size() + cells.connectivity.size());
  std::int64_t begin = 0;
  for (const std::int64_t end : cells.offsets) {
    append_number(out, static_cast<std::int32_t>(end - begin), encoding);
    for (; begin < end; ++begin)
      append_number(out, static_cast<std::int32_t>(cells.connectivity[static_cast<std::size_t>(begin)]),
                    encoding);
    if (is_ascii) out.back() = '\n';
  }
  out += fmt::format("{}CELL_TYPES {}\n", is_ascii ? "" : "\n", cells.types.size());
  for (const std::int64_t type : cells.types) {
    append_number(out, static_cast<std::int32_t>(type), encoding);
    if (is_ascii) out.back() = '\n';
  }
  if (!is_ascii) out += '\n';
  if (!grid.cell_arrays.empty()) {
    out += fmt::format("CELL_DATA {}\n", cells.types.size());
    append_field(out, grid.cell_arrays, encoding);
  }
  if (!grid.point_arrays.empty()) {
    out += fmt::format("POINT_DATA {}\n", grid.points.rows());
    append_field(out, grid.point_arrays, encoding);
  }
  return out;
}

}  // namespace sinew::assets
