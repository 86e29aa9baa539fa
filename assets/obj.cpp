#include "assets/obj.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>

#include "assets/detail/file_bytes.h"
#include "assets/error.h"
#include "assets/point_cache.h"

namespace sinew::assets {
namespace {

constexpr const char* kBlanks = " \t\r";

/// Takes the next word off the front of a line; empty at its end.
std::string_view next_word(std::string_view& line) {
  line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
  const std::string_view word = line.substr(0, line.find_first_of(kBlanks));
  line.remove_prefix(word.size());
  return word;
}

template <class T>
std::optional<T> parse(std::string_view word) {
  T value{};
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || word.empty()) return std::nullopt;
  return value;
}

/// A mesh that grows while a file is read.
class Growing {
 public:
  void add_point(const std::array<double, 3>& p) {
    coordinates_.insert(coordinates_.end(), p.begin(), p.end());
  }
  void add_polygon(const std::vector<int>& polygon) {
    for (std::size_t k = 2; k < polygon.size(); ++k)
      corners_.insert(corners_.end(), {polygon[0], polygon[k - 1], polygon[k]});
  }
  int num_points() const { return static_cast<int>(coordinates_.size() / 3); }
  NamedMesh finish(const std::string& file) const {
    if (coordinates_.empty()) throw InputError(file, "no vertices");
    for (std::size_t i = 0; i < coordinates_.size(); ++i)
      if (!std::isfinite(coordinates_[i]))
        throw InputError(file, fmt::format("vertex {}: {} is not finite", i / 3, "xyz"[i % 3]));
    for (const int corner : corners_)
      if (corner < 0 || corner >= num_points())
        throw InputError(file, fmt::format("faces: a face names vertex {}, expected 0 to {} (counted from 0)",
                                           corner, num_points() - 1));
    NamedMesh mesh;
    mesh.points = Eigen::Map<const lattice::Points>(coordinates_.data(), num_points(), 3);
    mesh.triangles = Eigen::Map<const lattice::Triangles>(corners_.data(),
                                                          static_cast<Eigen::Index>(corners_.size() / 3), 3);
    return mesh;
  }

 private:
  std::vector<double> coordinates_;
  std::vector<int> corners_;
};

// --- OBJ ---

NamedMesh read_obj(const std::string& file, std::string_view text) {
  Growing mesh;
  for (int line_number = 1; !text.empty(); ++line_number) {
    std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    const auto wrong = [&](const std::string& what) {
      return InputError(fmt::format("{}:{}", file, line_number), what);
    };
    const std::string_view keyword = next_word(line);
    if (keyword == "v") {
      std::array<double, 3> p;
      for (double& x : p) {
        const std::string_view word = next_word(line);
        const auto value = parse<double>(word);
        if (!value)
          throw wrong(fmt::format("vertex {}: got '{}', expected a number", mesh.num_points(), word));
        x = *value;
      }
      mesh.add_point(p);
    } else if (keyword == "f") {
      std::vector<int> polygon;
      for (std::string_view word = next_word(line); !word.empty(); word = next_word(line)) {
        const auto index = parse<int>(word.substr(0, word.find('/')));
        if (!index || *index == 0) throw wrong(fmt::format("face: got '{}', expected a vertex number", word));
        polygon.push_back(*index > 0 ? *index - 1 : mesh.num_points() + *index);  // negative counts backwards
      }
      if (polygon.size() < 3) throw wrong("face: fewer than three corners");
      mesh.add_polygon(polygon);
    }
  }
  return mesh.finish(file);
}

// --- PLY ---

struct PlyType {
  const char *name, *other_name;
  std::size_t size;
  enum class Kind { Signed, Unsigned, Real } kind;
};

constexpr PlyType kPlyTypes[] = {
    {"char", "int8", 1, PlyType::Kind::Signed},   {"uchar", "uint8", 1, PlyType::Kind::Unsigned},
    {"short", "int16", 2, PlyType::Kind::Signed}, {"ushort", "uint16", 2, PlyType::Kind::Unsigned},
    {"int", "int32", 4, PlyType::Kind::Signed},   {"uint", "uint32", 4, PlyType::Kind::Unsigned},
    {"float", "float32", 4, PlyType::Kind::Real}, {"double", "float64", 8, PlyType::Kind::Real}};

const PlyType* find_ply_type(std::string_view name) {
  const auto* found = std::find_if(std::begin(kPlyTypes), std::end(kPlyTypes), [name](const PlyType& t) {
    return name == t.name || name == t.other_name;
  });
  return found == std::end(kPlyTypes) ? nullptr : found;
}

struct PlyProperty {
  std::string name;
  const PlyType* type = nullptr;
  const PlyType* count_type = nullptr;  ///< lists only.
};

struct PlyElement {
  std::string name;
  long long count = 0;
  std::vector<PlyProperty> properties;
};

/// Reads numbers one after the other from the body of a PLY file.
class PlyBody {
 public:
  PlyBody(const std::string& file, std::string_view bytes, std::string_view format)
      : file_(file), bytes_(bytes), ascii_(format == "ascii"), big_endian_(format == "binary_big_endian") {}

  double next(const PlyType& type, const std::string& where) {
    return ascii_ ? next_text(where) : next_binary(type, where);
  }

 private:
  double next_text(const std::string& where) {
    bytes_.remove_prefix(std::min(bytes_.find_first_not_of(" \t\r\n"), bytes_.size()));
    const std::string_view word = bytes_.substr(0, bytes_.find_first_of(" \t\r\n"));
    bytes_.remove_prefix(word.size());
    const auto value = parse<double>(word);
    if (!value)
      throw InputError(file_, fmt::format("{}: got '{}', expected a number", where, word.substr(0, 40)));
    return *value;
  }

  double next_binary(const PlyType& type, const std::string& where) {
    if (bytes_.size() < type.size) throw InputError(file_, where + ": the file ends before it");
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < type.size; ++i) {
      const std::size_t place = big_endian_ ? type.size - 1 - i : i;
      bits |= std::uint64_t{static_cast<unsigned char>(bytes_[i])} << (8 * place);
    }
    bytes_.remove_prefix(type.size);
    if (type.kind == PlyType::Kind::Real)
      return type.size == 8 ? std::bit_cast<double>(bits)
                            : static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
    if (type.kind == PlyType::Kind::Unsigned) return static_cast<double>(bits);
    const unsigned unused =
        64 - 8 * static_cast<unsigned>(type.size);  // moves the sign bit to the top and back
    return static_cast<double>(static_cast<std::int64_t>(bits << unused) >> unused);
  }

  const std::string& file_;
  std::string_view bytes_;
  bool ascii_, big_endian_;
};

struct PlyHeader {
  std::string format;
  std::vector<PlyElement> elements;
  std::size_t size = 0;  ///< bytes before the body.
};

PlyHeader read_ply_header(const std::string& file, std::string_view text) {
  PlyHeader header;
  const std::string_view all = text;
  for (int line_number = 1;; ++line_number) {
    const auto wrong = [&](const std::string& what) {
      return InputError(fmt::format("{}:{}", file, line_number), what);
    };
    if (text.empty()) throw wrong("the header has no end_header");
    std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    const std::string_view keyword = next_word(line);
    if (keyword == "end_header") break;
    if (keyword == "format") {
      header.format = next_word(line);
      if (header.format != "ascii" && header.format != "binary_little_endian" &&
          header.format != "binary_big_endian")
        throw wrong("format '" + header.format +
                    "', expected ascii, binary_little_endian or binary_big_endian");
    } else if (keyword == "element") {
      PlyElement element;
      element.name = next_word(line);
      const auto count = parse<long long>(next_word(line));
      if (!count || *count < 0) throw wrong("element '" + element.name + "': expected a count");
      element.count = *count;
      header.elements.push_back(element);
    } else if (keyword == "property") {
      PlyProperty property;
      std::string_view type = next_word(line);
      if (type == "list") {
        property.count_type = find_ply_type(next_word(line));
        type = next_word(line);
        if (property.count_type == nullptr) throw wrong("property: unknown type of a list's count");
      }
      property.type = find_ply_type(type);
      property.name = next_word(line);
      if (property.type == nullptr) throw wrong("property: unknown type '" + std::string(type) + "'");
      if (header.elements.empty()) throw wrong("property before the first element");
      header.elements.back().properties.push_back(property);
    }
  }
  if (header.format.empty()) throw InputError(file, "the header names no format");
  header.size = all.size() - text.size();
  return header;
}

void read_ply_vertex(const PlyElement& element, const std::string& where, PlyBody& body, Growing& mesh) {
  // The lists of a vertex were refused with the header.
  std::array<double, 3> p{};
  for (const PlyProperty& property : element.properties) {
    const double value = body.next(*property.type, where);
    for (std::size_t c = 0; c < 3; ++c)
      if (property.name == std::string_view("xyz").substr(c, 1)) p[c] = value;
  }
  mesh.add_point(p);
}

/// Any element that is not a vertex: its lists called vertex_index or vertex_indices are polygons.
void read_ply_row(const PlyElement& element, const std::string& where, PlyBody& body, Growing& mesh) {
  for (const PlyProperty& property : element.properties) {
    const double count = property.count_type != nullptr ? body.next(*property.count_type, where) : 1.0;
    const bool is_polygon =
        element.name == "face" && property.count_type != nullptr && property.name.rfind("vertex_ind", 0) == 0;
    std::vector<int> polygon;
    for (double k = 0; k < count; ++k) {
      const double value = body.next(*property.type, where);
      // Out of an int's range is out of range for every mesh: -1 is refused later.
      if (is_polygon) polygon.push_back(std::abs(value) < 2e9 ? static_cast<int>(value) : -1);
    }
    if (is_polygon) mesh.add_polygon(polygon);
  }
}

NamedMesh read_ply(const std::string& file, std::string_view text) {
  const PlyHeader header = read_ply_header(file, text);
  PlyBody body(file, text.substr(header.size), header.format);
  Growing mesh;
  for (const PlyElement& element : header.elements) {
    const auto has = [&](const char* name) {
      return std::any_of(element.properties.begin(), element.properties.end(),
                         [name](const PlyProperty& p) { return p.name == name; });
    };
    const bool is_vertex = element.name == "vertex";
    if (is_vertex && !(has("x") && has("y") && has("z")))
      throw InputError(file, "element 'vertex': expected properties x, y and z");
    if (is_vertex && std::any_of(element.properties.begin(), element.properties.end(),
                                 [](const PlyProperty& p) { return p.count_type != nullptr; }))
      throw InputError(file, "element 'vertex': lists per vertex cannot be read");
    for (long long row = 0; !element.properties.empty() && row < element.count; ++row) {
      const std::string where = fmt::format("{} {}", element.name, row);
      if (is_vertex)
        read_ply_vertex(element, where, body, mesh);
      else
        read_ply_row(element, where, body, mesh);
    }
  }
  return mesh.finish(file);
}

bool has_extension(const std::string& file, std::string_view extension) {
  if (file.size() < extension.size()) return false;
  return std::equal(extension.begin(), extension.end(), file.end() - static_cast<long>(extension.size()),
                    [](char a, char b) { return a == (b >= 'A' && b <= 'Z' ? b + ('a' - 'A') : b); });
}

}  // namespace

std::string obj_text(const std::vector<NamedMesh>& parts, const std::string& comment) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  if (!comment.empty()) fmt::format_to(out, "# {}\n", comment);
  Eigen::Index first = 1;  // OBJ counts from 1 over all objects
  for (const NamedMesh& part : parts) {
    std::string name = part.name.empty() ? "part" : part.name;
    for (char& c : name)
      if (static_cast<unsigned char>(c) <= ' ') c = '_';
    fmt::format_to(out, "g {}\n", name);
    const FloatPoints points = to_float(part.points);
    for (Eigen::Index v = 0; v < points.rows(); ++v)
      fmt::format_to(out, "v {} {} {}\n", points(v, 0), points(v, 1), points(v, 2));
    for (Eigen::Index t = 0; t < part.triangles.rows(); ++t) {
      for (int c = 0; c < 3; ++c)
        if (part.triangles(t, c) < 0 || part.triangles(t, c) >= points.rows())
          throw std::invalid_argument(fmt::format("part '{}': triangle {} names vertex {} of {}", part.name,
                                                  t, part.triangles(t, c), points.rows()));
      fmt::format_to(out, "f {} {} {}\n", first + part.triangles(t, 0), first + part.triangles(t, 1),
                     first + part.triangles(t, 2));
    }
    first += points.rows();
  }
  return fmt::to_string(text);
}

NamedMesh read_surface(const std::string& file) {
  const bool is_obj = has_extension(file, ".obj"), is_ply = has_extension(file, ".ply");
  if (!is_obj && !is_ply) throw InputError(file, "unknown extension, expected .obj or .ply");
  const std::string text = detail::read_whole(file);
  if (text.empty()) throw InputError(file, "the file is empty, expected an OBJ or PLY mesh");
  if (is_ply && text.compare(0, 3, "ply") != 0)
    throw InputError(file, "no PLY file, it does not start with 'ply'");
  return is_obj ? read_obj(file, text) : read_ply(file, text);
}

}  // namespace sinew::assets
