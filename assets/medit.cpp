#include "assets/medit.h"

#include <algorithm>
#include <map>
#include <string_view>

#include <fmt/format.h>

#include "assets/detail/annotation.h"
#include "assets/detail/text_scanner.h"
#include "assets/error.h"

namespace sinew::assets {
namespace {

using lattice::Cell;
using lattice::CellType;

constexpr std::int64_t kMaxInt = 2147483647;

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
  Parser(const std::string& file, std::string_view text)
      : file_(file), text_(text), scanner_(file, text, '#') {}

  VolumeMesh parse() {
    const std::optional<std::string_view> first = scanner_.word();
    if (first == "MFEM") scanner_.fail("got an MFEM mesh, expected a Medit mesh; hint: save it as .vtu");
    if (!first || (*first != "MeshVersionFormatted" && *first != "MeshVersionUnformatted"))
      scanner_.fail("expected 'MeshVersionFormatted' first");
    if (*first == "MeshVersionUnformatted") scanner_.fail("got a binary mesh, expected ASCII");
    scanner_.integer("MeshVersionFormatted", 1, 4);
    while (const std::optional<std::string_view> keyword = scanner_.word()) {
      if (*keyword == "End") break;
      section(*keyword);
    }
    if (num_vertices_ < 0) scanner_.fail("there is no section 'Vertices'");
    check_vertices();
    mesh_.annotation = detail::annotation_from_comments(text_);
    drop_idle_regions(mesh_);
    return std::move(mesh_);
  }

 private:
  void section(std::string_view keyword);
  void read_vertices();
  void read_cells(CellType type);
  void check_vertices() const;

  const std::string& file_;
  std::string_view text_;
  detail::TextScanner scanner_;
  VolumeMesh mesh_;
  std::int64_t num_vertices_ = -1;
  std::vector<int> cell_lines_;
};

void Parser::section(std::string_view keyword) {
  if (keyword == "Dimension") {
    if (scanner_.integer(keyword, 2, 3) != 3) scanner_.fail("Dimension: got 2, expected 3");
  } else if (keyword == "Vertices") {
    read_vertices();
  } else if (keyword == "Tetrahedra") {
    read_cells(CellType::Tetrahedron);
  } else if (keyword == "Prisms") {
    read_cells(CellType::Wedge);
  } else if (keyword == "Hexahedra") {
    read_cells(CellType::Hexahedron);
  } else if (keyword == "Edges") {
    const std::int64_t n = scanner_.count(keyword, 6);
    for (std::int64_t i = 0; i < n; ++i) {
      const auto a = static_cast<int>(scanner_.integer(keyword, 1, kMaxInt)),
                 b = static_cast<int>(scanner_.integer(keyword, 1, kMaxInt));
      mesh_.lines.push_back({{a - 1, b - 1}, static_cast<int>(scanner_.integer(keyword, -kMaxInt, kMaxInt))});
    }
  } else if (keyword == "Pyramids") {
    if (scanner_.count(keyword, 2) > 0)
      scanner_.fail(
          "Pyramids: cell 1: is a pyramid, whose apex has four edges; hint: split it into tetrahedra");
  } else if (const auto known = skipped_sections().find(keyword); known != skipped_sections().end()) {
    const std::int64_t n = scanner_.count(keyword, static_cast<std::size_t>(2 * known->second));
    for (std::int64_t i = 0; i < n * known->second; ++i) scanner_.real(keyword);
  } else {
    scanner_.fail(fmt::format("got '{}', expected the name of a section", keyword.substr(0, 40)));
  }
}

void Parser::read_vertices() {
  if (num_vertices_ >= 0) scanner_.fail("Vertices: there are two such sections");
  num_vertices_ = scanner_.count("Vertices", 8);
  mesh_.complex.points.resize(num_vertices_, 3);
  for (std::int64_t v = 0; v < num_vertices_; ++v) {
    for (int k = 0; k < 3; ++k) mesh_.complex.points(v, k) = scanner_.coordinate("Vertices");
    scanner_.real("Vertices");  // the reference
    mesh_.numbering.vertices.push_back(v + 1);
  }
}

void Parser::read_cells(CellType type) {
  const char* name = section_name(type);
  const std::int64_t n = scanner_.count(name, static_cast<std::size_t>(2 * num_corners(type) + 2));
  for (std::int64_t c = 0; c < n; ++c) {
    Cell cell;
    cell.type = type;
    for (int k = 0; k < num_corners(type); ++k)
      cell.vertices[k] = static_cast<int>(scanner_.integer(name, 1, kMaxInt)) - 1;
    cell_lines_.push_back(scanner_.line());
    mesh_.regions.push_back(static_cast<int>(scanner_.integer(name, -kMaxInt, kMaxInt)));
    mesh_.complex.cells.push_back(cell);
    mesh_.numbering.cells.push_back(c + 1);
  }
}

void Parser::check_vertices() const {
  for (std::size_t c = 0; c < mesh_.complex.cells.size(); ++c) {
    const Cell& cell = mesh_.complex.cells[c];
    for (int k = 0; k < num_corners(cell.type); ++k)
      if (cell.vertices[k] >= num_vertices_)
        scanner_.fail_at(cell_lines_[c],
                         fmt::format("{}: cell {}: vertex, got {}, expected 1..{}", section_name(cell.type),
                                     mesh_.numbering.cell(c), cell.vertices[k] + 1, num_vertices_));
  }
  for (const VolumeMesh::Line& line : mesh_.lines)
    for (int v : line.vertices)
      if (v >= num_vertices_)
        scanner_.fail(fmt::format("Edges: vertex, got {}, expected 1..{}", v + 1, num_vertices_));
}

}  // namespace

std::string format_medit(const VolumeMesh& mesh) {
  const lattice::CellComplex& complex = mesh.complex;
  std::string out =
      fmt::format("MeshVersionFormatted 2\nDimension 3\n\nVertices\n{}\n", complex.points.rows());
  for (Eigen::Index v = 0; v < complex.points.rows(); ++v)
    out += fmt::format("{} {} {} 0\n", complex.points(v, 0), complex.points(v, 1), complex.points(v, 2));
  for (const CellType type : {CellType::Tetrahedron, CellType::Wedge, CellType::Hexahedron}) {
    const auto count = std::count_if(complex.cells.begin(), complex.cells.end(),
                                     [&](const Cell& c) { return c.type == type; });
    if (count == 0) continue;
    out += fmt::format("\n{}\n{}\n", section_name(type), count);
    for (std::size_t c = 0; c < complex.cells.size(); ++c) {
      const Cell& cell = complex.cells[c];
      if (cell.type != type) continue;
      for (int k = 0; k < num_corners(type); ++k) out += fmt::format("{} ", cell.vertices[k] + 1);
      out += fmt::format("{}\n", mesh.regions.empty() ? 0 : mesh.regions[c]);
    }
  }
  std::size_t num_edges = 0;
  for (const VolumeMesh::Line& line : mesh.lines) num_edges += line.vertices.size() - 1;
  if (num_edges > 0) out += fmt::format("\nEdges\n{}\n", num_edges);
  for (const VolumeMesh::Line& line : mesh.lines)
    for (std::size_t i = 1; i < line.vertices.size(); ++i)
      out += fmt::format("{} {} {}\n", line.vertices[i - 1] + 1, line.vertices[i] + 1, line.number);
  return out + "\nEnd\n" + detail::annotation_as_comments(mesh.annotation);
}

VolumeMesh parse_medit(const std::string& file, const std::string& text) {
  return Parser(file, text).parse();
}

}  // namespace sinew::assets
