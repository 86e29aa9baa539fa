#include "assets/medit.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "assets/error.h"

namespace sinew::assets {
namespace {

using lattice::Cell;
using lattice::CellType;

constexpr const char* section_name(CellType type) {
  return type == CellType::Tetrahedron ? "Tetrahedra" : type == CellType::Wedge ? "Prisms" : "Hexahedra";
}

/// Numbers per entry of the sections we skip, references included.
const std::map<std::string_view, int>& skipped_sections() {
  static const std::map<std::string_view, int> kSections{
      {"Triangles", 4},        {"Quadrilaterals", 5},   {"Corners", 1},           {"Ridges", 1},
      {"RequiredVertices", 1}, {"RequiredEdges", 1},    {"RequiredTriangles", 1}, {"Normals", 3},
      {"Tangents", 3},         {"NormalAtVertices", 2}, {"TangentAtVertices", 2}, {"TangentAtEdges", 3}};
  return kSections;
}

class Parser {
 public:
  Parser(const std::string& file, std::string_view text) : file_(file), text_(text) {}

  MeditMesh parse() {
    const std::optional<std::string_view> first = word();
    if (first == "MFEM") fail("got an MFEM mesh, expected a Medit mesh; hint: save it as .vtu");
    if (!first || (*first != "MeshVersionFormatted" && *first != "MeshVersionUnformatted"))
      fail("expected 'MeshVersionFormatted' first");
    if (*first == "MeshVersionUnformatted") fail("got a binary mesh, expected ASCII");
    integer("MeshVersionFormatted", 1, 4);
    while (const std::optional<std::string_view> keyword = word()) {
      if (*keyword == "End") break;
      section(*keyword);
    }
    if (num_vertices_ < 0) fail("there is no section 'Vertices'");
    check_vertices();
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}:{}", file_, line_), what);
  }

  std::optional<std::string_view> word() {
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '#') {
        while (at_ < text_.size() && text_[at_] != '\n') ++at_;
      } else if (c == ' ' || c == '\t' || c == '\r' || c == '\n') {
        line_ += c == '\n';
        ++at_;
      } else {
        const std::size_t first = at_;
        while (at_ < text_.size() && std::string_view(" \t\r\n#").find(text_[at_]) == std::string_view::npos)
          ++at_;
        return text_.substr(first, at_ - first);
      }
    }
    return std::nullopt;
  }

  template <class T>
  T number(std::string_view section) {
    const std::optional<std::string_view> token = word();
    if (!token) fail(fmt::format("{}: the file ends in the middle", section));
    T value{};
    const auto [end, error] = std::from_chars(token->data(), token->data() + token->size(), value);
    if (error != std::errc() || end != token->data() + token->size())
      fail(fmt::format("{}: got '{}', expected a number", section, token->substr(0, 40)));
    return value;
  }
  std::int64_t integer(std::string_view section, std::int64_t low, std::int64_t high) {
    const auto value = number<std::int64_t>(section);
    if (value < low || value > high)
      fail(fmt::format("{}: got {}, expected {}..{}", section, value, low, high));
    return value;
  }
  /// How many entries a section announces; each takes at least two characters of the file.
  std::int64_t entries(std::string_view section) {
    return integer(section, 0, static_cast<std::int64_t>(text_.size() / 2));
  }

  void section(std::string_view keyword);
  void read_vertices();
  void read_cells(CellType type);
  void check_vertices() const;

  const std::string& file_;
  std::string_view text_;
  std::size_t at_ = 0;
  int line_ = 1;
  MeditMesh mesh_;
  std::int64_t num_vertices_ = -1;
  std::vector<int> cell_lines_;
};

void Parser::section(std::string_view keyword) {
  if (keyword == "Dimension") {
    if (integer(keyword, 2, 3) != 3) fail("Dimension: got 2, expected 3");
  } else if (keyword == "Vertices") {
    read_vertices();
  } else if (keyword == "Tetrahedra") {
    read_cells(CellType::Tetrahedron);
  } else if (keyword == "Prisms") {
    read_cells(CellType::Wedge);
  } else if (keyword == "Hexahedra") {
    read_cells(CellType::Hexahedron);
  } else if (keyword == "Edges") {
    const std::int64_t n = entries(keyword);
    for (std::int64_t i = 0; i < n; ++i) {
      const auto a = number<int>(keyword), b = number<int>(keyword), reference = number<int>(keyword);
      mesh_.edges.push_back({{a - 1, b - 1}, reference});
    }
  } else if (keyword == "Pyramids") {
    if (entries(keyword) > 0) fail("Pyramids: their apex has four edges; hint: split them into tetrahedra");
  } else if (const auto known = skipped_sections().find(keyword); known != skipped_sections().end()) {
    const std::int64_t n = entries(keyword) * known->second;
    for (std::int64_t i = 0; i < n; ++i) number<double>(keyword);
  } else {
    fail(fmt::format("got '{}', expected the name of a section", keyword.substr(0, 40)));
  }
}

void Parser::read_vertices() {
  if (num_vertices_ >= 0) fail("Vertices: there are two such sections");
  num_vertices_ = entries("Vertices");
  mesh_.complex.points.resize(num_vertices_, 3);
  for (std::int64_t v = 0; v < num_vertices_; ++v) {
    for (int k = 0; k < 3; ++k) {
      const auto x = number<double>("Vertices");
      if (!std::isfinite(x)) fail(fmt::format("Vertices: vertex {} is not finite", v + 1));
      mesh_.complex.points(v, k) = x;
    }
    number<double>("Vertices");  // the reference
  }
}

void Parser::read_cells(CellType type) {
  const char* name = section_name(type);
  const std::int64_t n = entries(name);
  for (std::int64_t c = 0; c < n; ++c) {
    Cell cell;
    cell.type = type;
    for (int k = 0; k < num_corners(type); ++k)
      cell.vertices[k] = static_cast<int>(integer(name, 1, 2147483647)) - 1;
    cell_lines_.push_back(line_);
    number<double>(name);  // the reference
    mesh_.complex.cells.push_back(cell);
  }
}

void Parser::check_vertices() const {
  for (std::size_t c = 0; c < mesh_.complex.cells.size(); ++c) {
    const Cell& cell = mesh_.complex.cells[c];
    for (int k = 0; k < num_corners(cell.type); ++k)
      if (cell.vertices[k] >= num_vertices_) {
        throw InputError(fmt::format("{}:{}", file_, cell_lines_[c]),
                         fmt::format("{}: vertex, got {}, expected 1..{}", section_name(cell.type),
                                     cell.vertices[k] + 1, num_vertices_));
      }
  }
  for (const auto& [edge, reference] : mesh_.edges)
    for (int v : edge)
      if (v < 0 || v >= num_vertices_)
        fail(fmt::format("Edges: vertex, got {}, expected 1..{}", v + 1, num_vertices_));
}

}  // namespace

std::string format_medit(const MeditMesh& mesh) {
  const lattice::CellComplex& complex = mesh.complex;
  std::string out =
      fmt::format("MeshVersionFormatted 2\nDimension 3\n\nVertices\n{}\n", complex.points.rows());
  for (Eigen::Index v = 0; v < complex.points.rows(); ++v)
    out += fmt::format("{:.17g} {:.17g} {:.17g} 0\n", complex.points(v, 0), complex.points(v, 1),
                       complex.points(v, 2));
  for (const CellType type : {CellType::Tetrahedron, CellType::Wedge, CellType::Hexahedron}) {
    const auto count = std::count_if(complex.cells.begin(), complex.cells.end(),
                                     [&](const Cell& c) { return c.type == type; });
    if (count == 0) continue;
    out += fmt::format("\n{}\n{}\n", section_name(type), count);
    for (const Cell& cell : complex.cells) {
      if (cell.type != type) continue;
      for (int k = 0; k < num_corners(type); ++k) out += fmt::format("{} ", cell.vertices[k] + 1);
      out += "0\n";
    }
  }
  if (!mesh.edges.empty()) {
    out += fmt::format("\nEdges\n{}\n", mesh.edges.size());
    for (const auto& [edge, reference] : mesh.edges)
      out += fmt::format("{} {} {}\n", edge[0] + 1, edge[1] + 1, reference);
  }
  return out + "\nEnd\n";
}

MeditMesh parse_medit(const std::string& file, const std::string& text) { return Parser(file, text).parse(); }

}  // namespace sinew::assets
