#include "assets/vega.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <set>

#include <fmt/format.h>

#include "assets/detail/annotation.h"
#include "assets/detail/numbered_vertices.h"
#include "assets/detail/text.h"
#include "assets/detail/text_scanner.h"
#include "assets/error.h"

namespace sinew::assets {
namespace {

using lattice::CellType;

constexpr const char* kAllCells = "allElements";  ///< the set that every file has.

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

class Parser {
 public:
  Parser(const std::string& file, const std::string& text) : text_(text), in_(file, text, '#') {}

  VolumeMesh parse() {
    std::optional<std::string_view> line = in_.line_of_text();
    if (!line || line->front() != '*') in_.fail("expected a section like '*VERTICES' first");
    while (line) {
      const std::string_view header = *line;
      line.reset();
      if (header.starts_with("*VERTICES"))
        read_vertices();
      else if (header.starts_with("*ELEMENTS"))
        read_elements();
      else if (header.starts_with("*SET "))
        read_set(std::string(trimmed(header.substr(5))), line);
      else if (header.starts_with("*REGION"))
        read_region();
      else if (header.starts_with("*MATERIAL"))
        ;  // materials belong to the scene
      else
        in_.fail(fmt::format("got '{}', expected *VERTICES, *ELEMENTS, *MATERIAL, *SET or *REGION",
                             detail::printable(header.substr(0, 40))));
      while (!line || line->front() != '*') {
        line = in_.line_of_text();
        if (!line) break;
      }
    }
    if (mesh_.complex.cells.empty()) in_.fail("there are no cells; expected *VERTICES and *ELEMENTS");
    assign_regions();
    mesh_.annotation = detail::annotation_from_comments(text_);
    return std::move(mesh_);
  }

 private:
  void read_vertices();
  void read_elements();
  void read_set(const std::string& name, std::optional<std::string_view>& next);
  void read_region();
  void assign_regions();

  const std::string& text_;
  detail::TextScanner in_;
  VolumeMesh mesh_;
  std::int64_t first_ = 1, num_vertices_ = -1, first_cell_ = 1;
  std::map<std::string, std::vector<std::int64_t>> sets_;
  std::vector<std::string> regions_;
};

void Parser::read_vertices() {
  if (num_vertices_ >= 0) in_.fail("*VERTICES: there are two such sections");
  num_vertices_ = in_.count("*VERTICES", 8);
  in_.integer("*VERTICES: dimension", 3, 3);
  in_.rest_of_line();
  first_ = detail::read_numbered_vertices(in_, num_vertices_, 0, "*VERTICES: ", mesh_);
  in_.rest_of_line();
}

void Parser::read_elements() {
  if (num_vertices_ < 0) in_.fail("*ELEMENTS: comes before *VERTICES");
  if (!mesh_.complex.cells.empty()) in_.fail("*ELEMENTS: there are two such sections");
  const std::string_view type = in_.need_word("*ELEMENTS");
  lattice::Cell cell;
  if (type.starts_with("TET"))
    cell.type = CellType::Tetrahedron;
  else if (type.starts_with("CUBIC"))
    cell.type = CellType::Hexahedron;
  else
    in_.fail(
        fmt::format("*ELEMENTS: got '{}', expected TET or CUBIC", detail::printable(type.substr(0, 40))));
  const int corners = num_corners(cell.type);
  const std::int64_t n = in_.count("*ELEMENTS", static_cast<std::size_t>(2 * corners + 2));
  in_.integer("*ELEMENTS: vertices per cell", corners, corners);
  in_.rest_of_line();
  for (std::int64_t c = 0; c < n; ++c) {
    if (c == 0)
      first_cell_ = in_.integer("*ELEMENTS: number of the first cell", 0, 1);
    else
      in_.integer("*ELEMENTS: number of a cell", first_cell_ + c, first_cell_ + c);
    for (int k = 0; k < corners; ++k)
      cell.vertices[k] = static_cast<int>(
          in_.integer(fmt::format("cell {}: vertex", first_cell_ + c), first_, first_ + num_vertices_ - 1) -
          first_);
    mesh_.complex.cells.push_back(cell);
    mesh_.numbering.cells.push_back(first_cell_ + c);
  }
  in_.rest_of_line();
}

/// Numbers with commas between them, over any number of lines up to the next section.
void Parser::read_set(const std::string& name, std::optional<std::string_view>& next) {
  std::vector<std::int64_t>& cells = sets_[name];
  while ((next = in_.line_of_text()) && next->front() != '*') {
    std::string_view rest = *next;
    while (!rest.empty()) {
      const std::size_t comma = std::min(rest.find(','), rest.size());
      const std::string_view word = trimmed(rest.substr(0, comma));
      rest.remove_prefix(std::min(comma + 1, rest.size()));
      if (word.empty()) continue;
      std::int64_t number = 0;
      const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
      if (error != std::errc() || end != word.data() + word.size())
        in_.fail(fmt::format("*SET {}: got '{}', expected the number of a cell", detail::printable(name),
                             detail::printable(word.substr(0, 40))));
      cells.push_back(number);
    }
  }
}

void Parser::read_region() {
  const std::optional<std::string_view> line = in_.line_of_text();
  const std::size_t comma = line ? line->find(',') : std::string_view::npos;
  if (comma == std::string_view::npos)
    in_.fail("*REGION: expected a set and a material with a comma between");
  regions_.emplace_back(trimmed(line->substr(0, comma)));
}

void Parser::assign_regions() {
  const auto last = first_cell_ + static_cast<std::int64_t>(mesh_.complex.cells.size()) - 1;
  for (std::size_t r = 0; r < regions_.size(); ++r) {
    if (regions_[r] == kAllCells) continue;
    const auto set = sets_.find(regions_[r]);
    if (set == sets_.end())
      in_.fail(fmt::format("*REGION: there is no set '{}'", detail::printable(regions_[r])));
    mesh_.regions.resize(mesh_.complex.cells.size(), 0);
    const int number = static_cast<int>(r) + 1;
    mesh_.region_names.push_back({number, regions_[r]});
    for (std::int64_t c : set->second) {
      if (c < first_cell_ || c > last)
        in_.fail(fmt::format("*SET {}: cell, got {}, expected {}..{}", detail::printable(regions_[r]), c,
                             first_cell_, last));
      mesh_.regions[static_cast<std::size_t>(c - first_cell_)] = number;
    }
  }
  drop_idle_regions(mesh_);
}

}  // namespace

std::string format_vega(const VolumeMesh& mesh) {
  const lattice::CellComplex& complex = mesh.complex;
  const CellType type = complex.cells.empty() ? CellType::Tetrahedron : complex.cells.front().type;
  for (std::size_t c = 0; c < complex.cells.size(); ++c)
    if (complex.cells[c].type != type || type == CellType::Wedge)
      throw ConfigError(
          fmt::format("Vega files: cell {}: has {} vertices, expected tetrahedra only or "
                      "hexahedra only; hint: write .vtu, .vtk, .msh or .mesh",
                      c + 1, num_corners(complex.cells[c].type)));
  std::string out = fmt::format("*VERTICES\n{} 3 0 0\n", complex.points.rows());
  for (Eigen::Index v = 0; v < complex.points.rows(); ++v)
    out +=
        fmt::format("{} {} {} {}\n", v + 1, complex.points(v, 0), complex.points(v, 1), complex.points(v, 2));
  out += fmt::format("\n*ELEMENTS\n{}\n{} {} 0\n", type == CellType::Tetrahedron ? "TET" : "CUBIC",
                     complex.cells.size(), num_corners(type));
  for (std::size_t c = 0; c < complex.cells.size(); ++c) {
    out += fmt::format("{}", c + 1);
    for (int k = 0; k < num_corners(type); ++k) out += fmt::format(" {}", complex.cells[c].vertices[k] + 1);
    out += '\n';
  }
  // A file needs a material; Sinew's own come from the scene.
  out += "\n*MATERIAL flesh\nENU, 1000, 100000, 0.45\n\n*REGION\nallElements, flesh\n";
  for (int region : std::set<int>(mesh.regions.begin(), mesh.regions.end())) {
    out += fmt::format("\n*SET region_{}\n", region);
    for (std::size_t c = 0; c < mesh.regions.size(); ++c)
      if (mesh.regions[c] == region) out += fmt::format("{}\n", c + 1);
    out += fmt::format("\n*REGION\nregion_{}, flesh\n", region);
  }
  return out + detail::annotation_as_comments(mesh.annotation);
}

VolumeMesh parse_vega(const std::string& file, const std::string& text) { return Parser(file, text).parse(); }

}  // namespace sinew::assets
