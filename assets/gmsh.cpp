#include "assets/gmsh.h"

#include <algorithm>
#include <cstring>
#include <map>

#include <fmt/format.h>

#include "assets/detail/annotation.h"

namespace sinew::assets {
namespace {

int gmsh_type(lattice::CellType type) {
  return type == lattice::CellType::Tetrahedron ? 4 : type == lattice::CellType::Hexahedron ? 5 : 6;
}
constexpr int kLine = 1;

/// Numbers in one of the two encodings. ASCII numbers are divided by blanks, entries by ends of line.
class Writer {
 public:
  explicit Writer(Encoding encoding) : binary_(encoding == Encoding::Binary) {}

  Writer& int32(std::int64_t value) { return put(static_cast<std::int32_t>(value)); }
  Writer& size(std::size_t value) { return put(static_cast<std::uint64_t>(value)); }
  Writer& real(double value) { return put(value); }
  /// Ends an entry; nothing in binary.
  void end() {
    if (binary_) return;
    if (!out_.empty() && out_.back() == ' ') out_.back() = '\n';
  }
  /// Ends a section's data.
  void end_data() {
    if (binary_) out_ += '\n';
  }
  void text(const std::string& line) { out_ += line; }
  bool binary() const { return binary_; }
  std::string take() { return std::move(out_); }

 private:
  template <class T>
  Writer& put(T value) {
    if (binary_) {
      char bytes[sizeof(T)];
      std::memcpy(bytes, &value, sizeof(T));
      out_.append(bytes, sizeof(T));
    } else {
      out_ += fmt::format("{} ", value);
    }
    return *this;
  }

  bool binary_;
  std::string out_;
};

int region_of(const VolumeMesh& mesh, std::size_t cell) {
  return mesh.regions.empty() ? 0 : mesh.regions[cell];
}

/// The geometric entity that stands for a region: a number of its own for cells without one.
int entity_of(const VolumeMesh& mesh, int region) {
  if (region != 0) return region;
  const auto largest = std::max_element(mesh.regions.begin(), mesh.regions.end());
  return largest == mesh.regions.end() ? 1 : std::max(*largest, 0) + 1;
}

/// Names in quotes cannot hold one.
std::string quoted(std::string name) {
  std::replace(name.begin(), name.end(), '"', '\'');
  return '"' + name + '"';
}

void write_names(const VolumeMesh& mesh, Writer& out) {
  const std::size_t count = mesh.region_names.size() + mesh.line_names.size();
  if (count == 0) return;
  out.text(fmt::format("$PhysicalNames\n{}\n", count));
  for (std::size_t i = 0; i < mesh.line_names.size(); ++i)
    out.text(fmt::format("1 {} {}\n", i + 1, quoted(mesh.line_names[i])));
  for (const lattice::RegionName& region : mesh.region_names)
    out.text(fmt::format("3 {} {}\n", region.number, quoted(region.name)));
  out.text("$EndPhysicalNames\n");
}

std::size_t num_line_pieces(const VolumeMesh& mesh) {
  std::size_t count = 0;
  for (const VolumeMesh::Line& line : mesh.lines) count += line.vertices.size() - 1;
  return count;
}

void write_22(const VolumeMesh& mesh, Writer& out) {
  const auto num_nodes = static_cast<std::size_t>(mesh.complex.points.rows());
  out.text(fmt::format("$Nodes\n{}\n", num_nodes));
  for (std::size_t v = 0; v < num_nodes; ++v) {
    out.int32(static_cast<std::int64_t>(v) + 1);
    for (int k = 0; k < 3; ++k) out.real(mesh.complex.points(static_cast<Eigen::Index>(v), k));
    out.end();
  }
  out.end_data();
  out.text(fmt::format("$EndNodes\n$Elements\n{}\n", mesh.complex.cells.size() + num_line_pieces(mesh)));
  const int no_region = entity_of(mesh, 0);
  std::int64_t tag = 0;
  // Two tags: the physical group and the geometric entity. Binary: a block of one element each time.
  const auto head = [&](int type, int group) {
    ++tag;
    if (out.binary())
      out.int32(type).int32(1).int32(2).int32(tag);
    else
      out.int32(tag).int32(type).int32(2);
    out.int32(group).int32(group == 0 ? no_region : group);
  };
  for (std::size_t c = 0; c < mesh.complex.cells.size(); ++c) {
    const lattice::Cell& cell = mesh.complex.cells[c];
    head(gmsh_type(cell.type), region_of(mesh, c));
    for (int k = 0; k < num_corners(cell.type); ++k) out.int32(cell.vertices[k] + 1);
    out.end();
  }
  for (const VolumeMesh::Line& line : mesh.lines)
    for (std::size_t i = 1; i < line.vertices.size(); ++i) {
      head(kLine, line.number);
      out.int32(line.vertices[i - 1] + 1).int32(line.vertices[i] + 1);
      out.end();
    }
  out.end_data();
  out.text("$EndElements\n");
}

/// Every region is a volume and every line number a curve: the entity and its physical group share the
/// number. Volumes of cells without a region have no group.
void write_entities_41(const VolumeMesh& mesh, Writer& out) {
  const Eigen::RowVector3d low = mesh.complex.points.colwise().minCoeff(),
                           high = mesh.complex.points.colwise().maxCoeff();
  std::map<int, int> curves, volumes;  // entity -> physical group
  for (const VolumeMesh::Line& line : mesh.lines) curves[line.number] = line.number;
  const int no_region = entity_of(mesh, 0);
  for (std::size_t c = 0; c < mesh.complex.cells.size(); ++c) {
    const int region = region_of(mesh, c);
    volumes[region == 0 ? no_region : region] = region;
  }
  out.text("$Entities\n");
  out.size(0).size(curves.size()).size(0).size(volumes.size()).end();
  for (const auto& entities : {curves, volumes})
    for (const auto& [number, group] : entities) {
      out.int32(number);
      for (const Eigen::RowVector3d& corner : {low, high})
        for (int k = 0; k < 3; ++k) out.real(corner[k]);
      out.size(group == 0 ? 0 : 1);
      if (group != 0) out.int32(group);
      out.size(0).end();
    }
  out.end_data();
  out.text("$EndEntities\n");
}

void write_nodes_41(const VolumeMesh& mesh, Writer& out) {
  const auto n = static_cast<std::size_t>(mesh.complex.points.rows());
  out.text("$Nodes\n");
  out.size(1).size(n).size(1).size(n).end();
  out.int32(3)
      .int32(mesh.complex.cells.empty() ? 1 : entity_of(mesh, region_of(mesh, 0)))
      .int32(0)
      .size(n)
      .end();
  for (std::size_t v = 0; v < n; ++v) out.size(v + 1).end();
  for (Eigen::Index v = 0; v < mesh.complex.points.rows(); ++v) {
    for (int k = 0; k < 3; ++k) out.real(mesh.complex.points(v, k));
    out.end();
  }
  out.end_data();
  out.text("$EndNodes\n");
}

/// Blocks of cells of one type and region that follow each other, so that the order of the cells is kept.
void write_elements_41(const VolumeMesh& mesh, Writer& out) {
  const std::vector<lattice::Cell>& cells = mesh.complex.cells;
  std::vector<std::size_t> starts;
  for (std::size_t c = 0; c < cells.size(); ++c)
    if (c == 0 || cells[c].type != cells[c - 1].type || region_of(mesh, c) != region_of(mesh, c - 1))
      starts.push_back(c);
  const std::size_t total = cells.size() + num_line_pieces(mesh);
  std::size_t num_lines = 0;
  for (const VolumeMesh::Line& line : mesh.lines) num_lines += line.vertices.size() > 1;
  out.text("$Elements\n");
  out.size(starts.size() + num_lines).size(total).size(1).size(total).end();
  const int no_region = entity_of(mesh, 0);
  std::size_t tag = 0;
  for (std::size_t b = 0; b < starts.size(); ++b) {
    const std::size_t end = b + 1 < starts.size() ? starts[b + 1] : cells.size();
    const lattice::Cell& first = cells[starts[b]];
    const int region = region_of(mesh, starts[b]);
    out.int32(3).int32(region == 0 ? no_region : region).int32(gmsh_type(first.type));
    out.size(end - starts[b]).end();
    for (std::size_t c = starts[b]; c < end; ++c) {
      out.size(++tag);
      for (int k = 0; k < num_corners(cells[c].type); ++k)
        out.size(static_cast<std::size_t>(cells[c].vertices[k]) + 1);
      out.end();
    }
  }
  for (const VolumeMesh::Line& line : mesh.lines) {
    if (line.vertices.size() < 2) continue;
    out.int32(1).int32(line.number).int32(kLine).size(line.vertices.size() - 1).end();
    for (std::size_t i = 1; i < line.vertices.size(); ++i)
      out.size(++tag)
          .size(static_cast<std::size_t>(line.vertices[i - 1]) + 1)
          .size(static_cast<std::size_t>(line.vertices[i]) + 1)
          .end();
  }
  out.end_data();
  out.text("$EndElements\n");
}

}  // namespace

std::string format_gmsh(const VolumeMesh& mesh, GmshVersion version, Encoding encoding) {
  Writer out(encoding);
  const bool is_41 = version == GmshVersion::V41;
  out.text(fmt::format("$MeshFormat\n{} {} 8\n", is_41 ? "4.1" : "2.2", out.binary() ? 1 : 0));
  if (out.binary()) out.int32(1);
  out.end_data();
  out.text("$EndMeshFormat\n");
  write_names(mesh, out);
  if (is_41) {
    write_entities_41(mesh, out);
    write_nodes_41(mesh, out);
    write_elements_41(mesh, out);
  } else {
    write_22(mesh, out);
  }
  if (!mesh.annotation.empty()) {
    std::string flat = mesh.annotation;
    std::replace(flat.begin(), flat.end(), '\n', ' ');
    out.text(fmt::format("${0}\n{1}\n$End{0}\n", detail::kAnnotation, flat));
  }
  return out.take();
}

}  // namespace sinew::assets
