#include "assets/tetgen.h"

#include <cmath>

#include <fmt/format.h>

#include "assets/detail/annotation.h"
#include "assets/detail/numbered_vertices.h"
#include "assets/detail/text_scanner.h"
#include "assets/error.h"

namespace sinew::assets {
namespace {

using detail::TextScanner;

constexpr std::int64_t kMaxAttributes = 1000;
constexpr std::int64_t kMaxInt = 2147483647;

/// Reads the vertices; returns the number of the first.
std::int64_t read_nodes(TextScanner& in, VolumeMesh& mesh) {
  const std::int64_t n = in.count("number of vertices", 8);
  if (in.integer("dimension", 2, 3) != 3) in.fail("dimension: got 2, expected 3");
  const std::int64_t skipped =
      in.integer("number of attributes", 0, kMaxAttributes) + in.integer("boundary markers", 0, 1);
  return detail::read_numbered_vertices(in, n, skipped, "", mesh);
}

int region_of(TextScanner& in, double attribute) {
  if (!(std::abs(attribute) <= 2147483647.0) || attribute != std::round(attribute))
    in.fail(fmt::format("region attribute: got {}, expected a whole number", attribute));
  return static_cast<int>(attribute);
}

void read_elements(TextScanner& in, std::int64_t first, VolumeMesh& mesh) {
  const std::int64_t n = in.count("number of tetrahedra", 10);
  const std::int64_t corners = in.integer("vertices per tetrahedron", 4, 10);
  if (corners != 4)
    in.fail(
        fmt::format("vertices per tetrahedron: got {}, expected 4; hint: run TetGen without -o2", corners));
  const std::int64_t attributes = in.integer("number of attributes", 0, kMaxAttributes);
  const std::int64_t last = first + mesh.complex.points.rows() - 1;
  for (std::int64_t c = 0; c < n; ++c) {
    lattice::Cell cell;
    const std::int64_t number = in.integer("number of a tetrahedron", first + c, first + c);
    for (int k = 0; k < 4; ++k)
      cell.vertices[k] =
          static_cast<int>(in.integer(fmt::format("cell {}: vertex", number), first, last) - first);
    for (std::int64_t k = 0; k < attributes; ++k) {
      const double attribute = in.real("attribute");
      if (k == 0) mesh.regions.push_back(region_of(in, attribute));
    }
    mesh.complex.cells.push_back(cell);
    mesh.numbering.cells.push_back(number);
  }
}

}  // namespace

TetgenTexts format_tetgen(const VolumeMesh& mesh) {
  const lattice::CellComplex& complex = mesh.complex;
  TetgenTexts out;
  out.node = fmt::format("{} 3 0 0\n", complex.points.rows());
  for (Eigen::Index v = 0; v < complex.points.rows(); ++v)
    out.node +=
        fmt::format("{} {} {} {}\n", v + 1, complex.points(v, 0), complex.points(v, 1), complex.points(v, 2));
  out.node += detail::annotation_as_comments(mesh.annotation);
  out.ele = fmt::format("{} 4 {}\n", complex.cells.size(), mesh.regions.empty() ? 0 : 1);
  for (std::size_t c = 0; c < complex.cells.size(); ++c) {
    const lattice::Cell& cell = complex.cells[c];
    if (cell.type != lattice::CellType::Tetrahedron)
      throw ConfigError(
          fmt::format("TetGen files: cell {}: has {} vertices, expected tetrahedra only; hint: "
                      "write .vtu, .vtk, .msh or .mesh",
                      c + 1, num_corners(cell.type)));
    out.ele += fmt::format("{} {} {} {} {}", c + 1, cell.vertices[0] + 1, cell.vertices[1] + 1,
                           cell.vertices[2] + 1, cell.vertices[3] + 1);
    out.ele += mesh.regions.empty() ? "\n" : fmt::format(" {}\n", mesh.regions[c]);
  }
  return out;
}

VolumeMesh parse_tetgen(const std::string& node_file, const std::string& node, const std::string& ele_file,
                        const std::string& ele) {
  VolumeMesh mesh;
  TextScanner nodes(node_file, node, '#'), elements(ele_file, ele, '#');
  const std::int64_t first = read_nodes(nodes, mesh);
  if (mesh.complex.points.rows() > kMaxInt) nodes.fail("too many vertices");
  read_elements(elements, first, mesh);
  for (TextScanner* in : {&nodes, &elements})
    if (const auto word = in->word())
      in->fail(fmt::format("got '{}' behind the last entry", word->substr(0, 40)));
  mesh.annotation = detail::annotation_from_comments(node);
  drop_idle_regions(mesh);
  return mesh;
}

}  // namespace sinew::assets
