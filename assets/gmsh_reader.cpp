#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>

#include <fmt/format.h>

#include "assets/detail/annotation.h"
#include "assets/detail/text.h"
#include "assets/detail/text_scanner.h"
#include "assets/gmsh.h"

namespace sinew::assets {
namespace {

using lattice::CellType;

static_assert(std::endian::native == std::endian::little, "binary files are read as they lie in memory");

constexpr std::int64_t kMaxInt = 2147483647;

/// Nodes of an element of the first order; 0 for others.
int nodes_of_type(std::int64_t type) {
  constexpr std::array<int, 8> kNodes{0, 2, 3, 4, 4, 8, 6, 5};
  if (type == 15) return 1;
  return type >= 1 && type <= 7 ? kNodes[static_cast<std::size_t>(type)] : 0;
}

class Reader {
 public:
  Reader(const std::string& file, const std::string& text) : in_(file, text) {}

  VolumeMesh read() {
    while (const std::optional<std::string_view> line = in_.line_of_text()) {
      if (line->empty() || line->front() != '$')
        in_.fail(fmt::format("got '{}', expected a section like '$MeshFormat'",
                             detail::printable(line->substr(0, 40))));
      section(std::string(line->substr(1)));
    }
    if (!has_format_) in_.fail("there is no section $MeshFormat");
    if (!has_nodes_) in_.fail("there is no section $Nodes");
    if (!has_elements_) in_.fail("there is no section $Elements");
    for (const auto& [key, name] : names_)
      if (key.first == 3) mesh_.region_names.push_back({key.second, name});
    drop_idle_regions(mesh_);
    return std::move(mesh_);
  }

 private:
  void section(const std::string& name);
  void read_format();
  void read_names();
  void read_entities();
  void read_nodes();
  void read_nodes_22();
  void read_nodes_41();
  void read_elements();
  void read_elements_22();
  void read_elements_41();
  void add_element(std::int64_t type, std::int64_t tag, std::int64_t region,
                   const std::vector<std::int64_t>& nodes);
  void add_node(std::int64_t tag, const Eigen::Vector3d& p);
  void index_nodes();
  int vertex(std::int64_t element, std::int64_t tag);
  int check_type(std::int64_t element, std::int64_t type) const;

  template <class T>
  T raw(std::string_view thing) {
    T value;
    std::memcpy(&value, in_.bytes(thing, sizeof(T)).data(), sizeof(T));
    return value;
  }
  /// A 32-bit number, a 64-bit one and a double, in the file's encoding.
  std::int64_t int32(std::string_view thing) {
    return binary_ ? raw<std::int32_t>(thing) : in_.integer(thing, -kMaxInt - 1, kMaxInt);
  }
  std::int64_t size(std::string_view thing) {
    const std::int64_t value =
        binary_ ? raw<std::int64_t>(thing) : in_.integer(thing, 0, std::numeric_limits<std::int64_t>::max());
    if (value < 0) in_.fail(fmt::format("{}: got {}, expected at least 0", thing, value));
    return value;
  }
  std::int64_t entries(std::string_view thing, std::size_t ascii_bytes, std::size_t binary_bytes) {
    const std::int64_t n = size(thing);
    in_.check_count(thing, static_cast<std::uint64_t>(n), binary_ ? binary_bytes : ascii_bytes);
    return n;
  }
  double real(std::string_view thing) {
    const double value = binary_ ? raw<double>(thing) : in_.coordinate(thing);
    if (!std::isfinite(value)) in_.fail(fmt::format("{}: got {}, expected a finite number", thing, value));
    return value;
  }

  detail::TextScanner in_;
  VolumeMesh mesh_;
  bool has_format_ = false, has_nodes_ = false, has_elements_ = false, binary_ = false, is_41_ = false;
  std::vector<double> coordinates_;
  std::vector<std::pair<std::int64_t, int>> index_of_tag_;  ///< ascending.
  std::map<std::pair<int, int>, std::string> names_;        ///< of physical groups (dimension, tag).
  std::map<std::int64_t, int> region_of_volume_;            ///< version 4.1.
};

void Reader::section(const std::string& name) {
  if (name == "MeshFormat") {
    read_format();
  } else {
    if (!has_format_) in_.fail("expected $MeshFormat first");
    if (name == "PhysicalNames")
      read_names();
    else if (name == "Entities" && is_41_)
      read_entities();
    else if (name == "Nodes")
      read_nodes();
    else if (name == "Elements")
      read_elements();
    else if (name == detail::kAnnotation)
      mesh_.annotation = std::string(in_.rest_of_line());
  }
  std::string end = "$End";
  end += name;
  if (!in_.skip_to_line(end)) in_.fail(fmt::format("${}: the file ends before {}", name, end));
  in_.skip_line();
}

void Reader::read_format() {
  const std::string version(in_.need_word("$MeshFormat"));
  if (version != "2.2" && version != "4.1")
    in_.fail(fmt::format("$MeshFormat: version, got '{}', expected 2.2 or 4.1; hint: save with -format msh41",
                         detail::printable(version.substr(0, 20))));
  is_41_ = version == "4.1";
  binary_ = in_.integer("$MeshFormat: file type", 0, 1) == 1;
  in_.integer("$MeshFormat: data size", 8, 8);
  has_format_ = true;
  in_.skip_line();
  if (!binary_) return;
  const auto one = raw<std::int32_t>("$MeshFormat");
  if (one != 1)
    in_.fail(
        fmt::format("$MeshFormat: byte order, got {:#x} for 1, expected little-endian; hint: save as ASCII",
                    static_cast<std::uint32_t>(one)));
  in_.skip_line();
}

void Reader::read_names() {
  const std::int64_t n = in_.count("$PhysicalNames", 6);
  for (std::int64_t i = 0; i < n; ++i) {
    const auto dimension = static_cast<int>(in_.integer("$PhysicalNames: dimension", 0, 3));
    const auto tag = static_cast<int>(in_.integer("$PhysicalNames: number", -kMaxInt, kMaxInt));
    std::string_view name = in_.rest_of_line();
    if (name.size() < 2 || name.front() != '"' || name.back() != '"')
      in_.fail("$PhysicalNames: expected a name in quotes");
    names_[{dimension, tag}] = detail::printable(name.substr(1, name.size() - 2));
  }
}

/// Only the physical groups of volumes matter.
void Reader::read_entities() {
  std::array<std::int64_t, 4> counts{};
  for (std::int64_t& n : counts) n = entries("$Entities", 8, 12);
  for (int dimension = 0; dimension < 4; ++dimension)
    for (std::int64_t i = 0; i < counts[static_cast<std::size_t>(dimension)]; ++i) {
      const std::int64_t tag = int32("$Entities");
      for (int k = 0; k < (dimension == 0 ? 3 : 6); ++k) real("$Entities");
      const std::int64_t groups = entries("$Entities: physical groups", 2, 4);
      for (std::int64_t k = 0; k < groups; ++k) {
        const auto group = static_cast<int>(int32("$Entities"));
        if (dimension == 3 && k == 0) region_of_volume_[tag] = group;
      }
      if (dimension == 0) continue;
      const std::int64_t bounds = entries("$Entities: boundary", 2, 4);
      for (std::int64_t k = 0; k < bounds; ++k) int32("$Entities");
    }
}

void Reader::add_node(std::int64_t tag, const Eigen::Vector3d& p) {
  coordinates_.insert(coordinates_.end(), {p.x(), p.y(), p.z()});
  mesh_.numbering.vertices.push_back(tag);
}

void Reader::index_nodes() {
  const std::vector<std::int64_t>& tags = mesh_.numbering.vertices;
  mesh_.complex.points =
      Eigen::Map<const lattice::Points>(coordinates_.data(), static_cast<Eigen::Index>(tags.size()), 3);
  for (std::size_t v = 0; v < tags.size(); ++v) index_of_tag_.emplace_back(tags[v], static_cast<int>(v));
  std::sort(index_of_tag_.begin(), index_of_tag_.end());
  const auto twice = std::adjacent_find(index_of_tag_.begin(), index_of_tag_.end(),
                                        [](const auto& a, const auto& b) { return a.first == b.first; });
  if (twice != index_of_tag_.end()) in_.fail(fmt::format("$Nodes: node {} is there twice", twice->first));
}

void Reader::read_nodes() {
  if (has_nodes_) in_.fail("$Nodes: there are two such sections");
  has_nodes_ = true;
  if (is_41_)
    read_nodes_41();
  else
    read_nodes_22();
  index_nodes();
}

void Reader::read_nodes_22() {
  const std::int64_t n = in_.count("$Nodes", binary_ ? 28 : 8);
  if (binary_) in_.skip_line();
  for (std::int64_t i = 0; i < n; ++i) {
    const std::int64_t tag = int32("$Nodes: number");
    const double x = real("$Nodes"), y = real("$Nodes"), z = real("$Nodes");
    add_node(tag, {x, y, z});
  }
}

void Reader::read_nodes_41() {
  const std::int64_t blocks = entries("$Nodes: blocks", 8, 20);
  const std::int64_t total = entries("$Nodes", 8, 32);
  size("$Nodes");
  size("$Nodes");
  for (std::int64_t b = 0; b < blocks; ++b) {
    const std::int64_t dimension = int32("$Nodes: dimension");
    int32("$Nodes: entity");
    const bool parametric = int32("$Nodes: parametric") != 0;
    if (dimension < 0 || dimension > 3)
      in_.fail(fmt::format("$Nodes: dimension, got {}, expected 0..3", dimension));
    const std::int64_t n = entries("$Nodes: block", 8, 32);
    std::vector<std::int64_t> tags;
    for (std::int64_t i = 0; i < n; ++i) tags.push_back(size("$Nodes: number"));
    for (std::int64_t tag : tags) {
      const double x = real("$Nodes"), y = real("$Nodes"), z = real("$Nodes");
      for (std::int64_t k = 0; parametric && k < dimension; ++k) real("$Nodes");
      add_node(tag, {x, y, z});
    }
  }
  if (static_cast<std::int64_t>(mesh_.numbering.vertices.size()) != total)
    in_.fail(fmt::format("$Nodes: got {} nodes, expected {}", mesh_.numbering.vertices.size(), total));
}

int Reader::check_type(std::int64_t element, std::int64_t type) const {
  if (type == 7)
    in_.fail(fmt::format("cell {}: is a pyramid, whose apex has four edges; hint: split it into tetrahedra",
                         element));
  const int nodes = nodes_of_type(type);
  if (nodes == 0)
    in_.fail(
        fmt::format("cell {}: Gmsh element type, got {}, expected 4 (tetrahedron), 5 (hexahedron) or 6 "
                    "(prism); hint: mesh with -order 1",
                    element, type));
  return nodes;
}

int Reader::vertex(std::int64_t element, std::int64_t tag) {
  const auto found = std::lower_bound(index_of_tag_.begin(), index_of_tag_.end(), std::pair(tag, -1));
  if (found == index_of_tag_.end() || found->first != tag)
    in_.fail(fmt::format("cell {}: node, got {}, expected one of $Nodes", element, tag));
  return found->second;
}

void Reader::add_element(std::int64_t type, std::int64_t tag, std::int64_t region,
                         const std::vector<std::int64_t>& nodes) {
  if (type == 1) {
    mesh_.lines.push_back({{vertex(tag, nodes[0]), vertex(tag, nodes[1])}, static_cast<int>(region)});
    return;
  }
  lattice::Cell cell;
  if (type == 4)
    cell.type = CellType::Tetrahedron;
  else if (type == 5)
    cell.type = CellType::Hexahedron;
  else if (type == 6)
    cell.type = CellType::Wedge;
  else
    return;  // points and faces
  for (std::size_t k = 0; k < nodes.size(); ++k) cell.vertices[k] = vertex(tag, nodes[k]);
  mesh_.complex.cells.push_back(cell);
  mesh_.numbering.cells.push_back(tag);
  mesh_.regions.push_back(static_cast<int>(region));
}

void Reader::read_elements() {
  if (!has_nodes_) in_.fail("$Elements: comes before $Nodes");
  if (has_elements_) in_.fail("$Elements: there are two such sections");
  has_elements_ = true;
  if (is_41_)
    read_elements_41();
  else
    read_elements_22();
}

void Reader::read_elements_22() {
  const std::int64_t total = in_.count("$Elements", 8);
  if (binary_) in_.skip_line();
  std::vector<std::int64_t> nodes;
  // ASCII: number, type, tags, nodes. Binary: blocks of one type and number of tags.
  for (std::int64_t done = 0; done < total;) {
    std::int64_t in_block = 1, tag = 0, type = 0, num_tags = 0;
    if (binary_) {
      type = int32("$Elements: type");
      in_block = int32("$Elements: block");
      num_tags = int32("$Elements: tags");
      if (in_block < 1 || in_block > total - done)
        in_.fail(fmt::format("$Elements: block, got {} elements, expected 1..{}", in_block, total - done));
    }
    for (std::int64_t i = 0; i < in_block; ++i, ++done) {
      tag = int32("$Elements: number");
      if (!binary_) {
        type = int32("$Elements: type");
        num_tags = int32("$Elements: tags");
      }
      const int num_nodes = check_type(tag, type);
      if (num_tags < 0) in_.fail(fmt::format("cell {}: number of tags, got {}", tag, num_tags));
      std::int64_t region = 0;
      for (std::int64_t k = 0; k < num_tags; ++k) {
        const std::int64_t value = int32("$Elements: tag");
        if (k == 0) region = value;
      }
      nodes.clear();
      for (int k = 0; k < num_nodes; ++k) nodes.push_back(int32("$Elements: node"));
      add_element(type, tag, region, nodes);
    }
  }
}

void Reader::read_elements_41() {
  const std::int64_t blocks = entries("$Elements: blocks", 8, 20);
  const std::int64_t total = entries("$Elements", 4, 16);
  size("$Elements");
  size("$Elements");
  std::int64_t done = 0;
  std::vector<std::int64_t> nodes;
  for (std::int64_t b = 0; b < blocks; ++b) {
    const std::int64_t dimension = int32("$Elements: dimension"), entity = int32("$Elements: entity");
    const std::int64_t type = int32("$Elements: type");
    const std::int64_t n = entries("$Elements: block", 4, 16);
    const auto group = region_of_volume_.find(entity);
    const int region = dimension == 3 && group != region_of_volume_.end() ? group->second : 0;
    for (std::int64_t i = 0; i < n; ++i) {
      const std::int64_t tag = size("$Elements: number");
      const int num_nodes = check_type(tag, type);
      nodes.clear();
      for (int k = 0; k < num_nodes; ++k) nodes.push_back(size("$Elements: node"));
      add_element(type, tag, dimension == 1 ? static_cast<int>(entity) : region, nodes);
    }
    done += n;
  }
  if (done != total) in_.fail(fmt::format("$Elements: got {} elements, expected {}", done, total));
}

}  // namespace

VolumeMesh parse_gmsh(const std::string& file, const std::string& text) { return Reader(file, text).read(); }

}  // namespace sinew::assets
