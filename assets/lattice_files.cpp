#include "assets/lattice_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "assets/detail/annotation.h"
#include "assets/detail/file_bytes.h"
#include "assets/detail/lattice_json.h"
#include "assets/error.h"
#include "assets/gmsh.h"
#include "assets/medit.h"
#include "assets/tetgen.h"
#include "assets/vega.h"
#include "lattice/build.h"
#include "lattice/check_cells.h"
#include "lattice/quality.h"

namespace sinew::assets {
namespace {

using Eigen::Vector3d;
using lattice::Cell;
using lattice::CellType;
using lattice::ControlLattice;

double distance_to_segment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const double length_squared = (b - a).squaredNorm();
  const double t = length_squared > 0.0 ? std::clamp((p - a).dot(b - a) / length_squared, 0.0, 1.0) : 0.0;
  return (a + t * (b - a) - p).norm();
}

/// Frame of the bone or soft frame nearest to p; -1 where there is none.
int nearest_frame(const ControlLattice& lattice, const Vector3d& p) {
  int frame = -1;
  double nearest = std::numeric_limits<double>::infinity();
  const auto offer = [&](double distance, int candidate) {
    if (distance < nearest) nearest = distance, frame = candidate;
  };
  for (const lattice::LatticeBone& bone : lattice.bones)
    offer(distance_to_segment(p, bone.rest_start, bone.rest_end), bone.frame);
  for (const lattice::SoftFrame& soft : lattice.soft_frames) offer((soft.position - p).norm(), soft.frame);
  return frame;
}

/// Names, extensions and formats; the first of an extension is its default.
struct FormatName {
  const char* name;
  const char* extension;
  LatticeFormat format;
};
constexpr std::array<FormatName, 11> kFormats{{{"vtu", ".vtu", LatticeFormat::Vtu},
                                               {"vtk", ".vtk", LatticeFormat::Vtk},
                                               {"vtk-binary", ".vtk", LatticeFormat::VtkBinary},
                                               {"msh41", ".msh", LatticeFormat::Gmsh41},
                                               {"msh41-binary", ".msh", LatticeFormat::Gmsh41Binary},
                                               {"msh22", ".msh", LatticeFormat::Gmsh22},
                                               {"msh22-binary", ".msh", LatticeFormat::Gmsh22Binary},
                                               {"mesh", ".mesh", LatticeFormat::Medit},
                                               {"tetgen", ".node", LatticeFormat::TetGen},
                                               {"tetgen", ".ele", LatticeFormat::TetGen},
                                               {"veg", ".veg", LatticeFormat::Vega}}};

std::string extension_of(const std::string& file) {
  std::string extension = std::filesystem::path(file).extension().string();
  for (char& c : extension)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return extension;
}

/// The two files of a TetGen lattice: the user names either.
std::string tetgen_partner(const std::string& file, const char* extension) {
  return std::filesystem::path(file).replace_extension(extension).string();
}

/// Pads the entries of the cells with those of the lines, which have none.
VtuArray with_lines(VtuArray array, std::size_t num_lines) {
  const std::size_t more = num_lines * static_cast<std::size_t>(array.components);
  std::visit(
      [&](auto& values) {
        using T = typename std::decay_t<decltype(values)>::value_type;
        if constexpr (std::is_same_v<T, double>)
          values.insert(values.end(), more, std::numeric_limits<double>::quiet_NaN());
        else
          values.insert(values.end(), more, static_cast<T>(-1));
      },
      array.values);
  return array;
}

VtuGrid make_grid(const ControlLattice& lattice, const std::string& json, const LatticeFields& fields) {
  VtuGrid grid;
  grid.points = lattice.complex.points;
  grid.cells = lattice.complex.cells;
  std::vector<double> dihedral, jacobian, volume;
  std::vector<std::int64_t> frame, bone_of_line, place(grid.cells.size(), -1),
      bone_of_point(static_cast<std::size_t>(grid.points.rows()), -1);
  for (const Cell& cell : grid.cells) {
    Vector3d mean = Vector3d::Zero();
    for (int k = 0; k < num_corners(cell.type); ++k) mean += grid.points.row(cell.vertices[k]).transpose();
    dihedral.push_back(lattice::min_dihedral_degrees(lattice.complex, cell));
    jacobian.push_back(lattice::min_scaled_jacobian(lattice.complex, cell));
    volume.push_back(lattice::cell_volume(lattice.complex, cell));
    frame.push_back(nearest_frame(lattice, mean / num_corners(cell.type)));
  }
  std::vector<std::int64_t> region(lattice.regions.begin(), lattice.regions.end());
  if (region.empty()) region = frame;
  for (const lattice::CellCopy& copy : lattice.copies) place[copy.cell] = copy.place;
  for (std::size_t b = 0; b < lattice.bones.size(); ++b) {
    const lattice::LatticeBone& bone = lattice.bones[b];
    if (bone.chain.empty()) continue;
    grid.lines.push_back(bone.chain);
    for (int v : bone.chain) bone_of_point[static_cast<std::size_t>(v)] = static_cast<std::int64_t>(b);
    bone_of_line.push_back(static_cast<std::int64_t>(b));
    frame.push_back(bone.frame);
  }
  const std::size_t num_lines = grid.lines.size();
  std::vector<std::int64_t> bone(grid.cells.size(), -1);
  bone.insert(bone.end(), bone_of_line.begin(), bone_of_line.end());
  grid.point_arrays = {{"bone", 1, bone_of_point}};
  grid.point_arrays.insert(grid.point_arrays.end(), fields.points.begin(), fields.points.end());
  grid.cell_arrays = {with_lines({"dihedral", 1, dihedral}, num_lines),
                      with_lines({"scaled_jacobian", 1, jacobian}, num_lines),
                      with_lines({"volume", 1, volume}, num_lines),
                      with_lines({"region", 1, region}, num_lines),
                      {"frame", 1, frame},
                      {"bone", 1, bone},
                      with_lines({"place", 1, place}, num_lines)};
  for (const VtuArray& array : fields.cells) grid.cell_arrays.push_back(with_lines(array, num_lines));
  grid.file_arrays = {{detail::kAnnotation, 1, std::vector<std::uint8_t>(json.begin(), json.end())}};
  return grid;
}

VolumeMesh make_mesh(const ControlLattice& lattice, std::string json) {
  VolumeMesh mesh;
  mesh.complex = lattice.complex;
  mesh.regions = lattice.regions;
  mesh.region_names = lattice.region_names;
  mesh.annotation = std::move(json);
  for (const lattice::LatticeBone& bone : lattice.bones) {
    mesh.line_names.push_back(bone.name);
    if (!bone.chain.empty()) mesh.lines.push_back({bone.chain, static_cast<int>(mesh.line_names.size())});
  }
  return mesh;
}

/// Where Medit's sections put every cell; empty where they keep the order.
std::vector<int> medit_order(const std::vector<Cell>& cells) {
  std::vector<int> place(cells.size());
  int next = 0;
  for (const CellType type : {CellType::Tetrahedron, CellType::Wedge, CellType::Hexahedron})
    for (std::size_t c = 0; c < cells.size(); ++c)
      if (cells[c].type == type) place[c] = next++;
  if (std::is_sorted(place.begin(), place.end())) place.clear();
  return place;
}

/// The whole-number cell array that other programs keep their regions in; empty where there is none.
std::vector<int> regions_of_grid(const VtuGrid& grid) {
  for (const char* name : {"region", "gmsh:physical", "medit:ref", "CellEntityIds", "PhysicalIds",
                           "MaterialIds", "MaterialID", "attribute"})
    for (const VtuArray& array : grid.cell_arrays) {
      if (array.name != name || array.components != 1) continue;
      std::vector<int> regions;
      const auto take = [&](const auto& values) {
        for (std::size_t c = 0; c < grid.cells.size() && c < values.size(); ++c) {
          const auto value = static_cast<double>(values[c]);
          if (!(std::abs(value) <= 2147483647.0) || value != std::round(value)) return;
          regions.push_back(static_cast<int>(value));
        }
      };
      std::visit(take, array.values);
      if (regions.size() == grid.cells.size()) return regions;
    }
  return {};
}

VolumeMesh mesh_of_grid(VtuGrid grid) {
  VolumeMesh mesh;
  for (const VtuArray& array : grid.file_arrays) {
    const auto* bytes = std::get_if<std::vector<std::uint8_t>>(&array.values);
    if (bytes && array.name == detail::kAnnotation) mesh.annotation.assign(bytes->begin(), bytes->end());
  }
  mesh.regions = regions_of_grid(grid);
  mesh.numbering.cells = std::move(grid.cell_numbers);
  mesh.complex = {std::move(grid.points), std::move(grid.cells)};
  drop_idle_regions(mesh);
  return mesh;
}

std::string read_some(const std::string& file) {
  std::string text = detail::read_whole(file);
  if (text.empty()) throw InputError(file, "is empty, expected a lattice");
  return text;
}

VolumeMesh parse(const std::string& file) {
  switch (lattice_format(file)) {
    case LatticeFormat::Vtu:
      return mesh_of_grid(parse_vtu(file, read_some(file)));
    case LatticeFormat::Vtk:
    case LatticeFormat::VtkBinary:
      return mesh_of_grid(parse_vtk(file, read_some(file)));
    case LatticeFormat::Gmsh41:
    case LatticeFormat::Gmsh41Binary:
    case LatticeFormat::Gmsh22:
    case LatticeFormat::Gmsh22Binary:
      return parse_gmsh(file, read_some(file));
    case LatticeFormat::Medit:
      return parse_medit(file, read_some(file));
    case LatticeFormat::TetGen: {
      const std::string node = tetgen_partner(file, ".node"), ele = tetgen_partner(file, ".ele");
      return parse_tetgen(node, read_some(node), ele, read_some(ele));
    }
    case LatticeFormat::Vega:
      return parse_vega(file, read_some(file));
  }
  return {};
}

void refuse_skin_outside(const lattice::CellComplex& complex, const LatticeInput& input) {
  if (const std::string line = lattice::skin_outside(complex, input.skin.surface); !line.empty())
    throw std::invalid_argument(line);
}

void refuse_faults(const std::string& file, const VolumeMesh& mesh, lattice::Coincidence coincidence) {
  const std::vector<std::string> faults = lattice::cell_faults(mesh.complex, mesh.numbering, coincidence);
  if (!faults.empty()) throw InputError(file, faults.front());
}

}  // namespace

LatticeFormat lattice_format(const std::string& file) { return lattice_format(file, ""); }

LatticeFormat lattice_format(const std::string& file, const std::string& name) {
  const std::string extension = extension_of(file);
  bool is_known = false;
  for (const FormatName& format : kFormats) {
    if (format.extension != extension) continue;
    if (name.empty() || name == format.name) return format.format;
    is_known = true;
  }
  if (is_known)
    throw ConfigError(
        fmt::format("format: got '{}', which does not fit the extension '{}'", name, extension));
  throw ConfigError(fmt::format(
      "{}: extension, got '{}', expected .vtu, .vtk, .msh, .mesh, .node, .ele or .veg", file, extension));
}

std::string format_lattice(LatticeFormat format, const ControlLattice& lattice,
                           const lattice::JointTree& joints, const LatticeFields& fields,
                           std::string* second) {
  const bool groups_cells = format == LatticeFormat::Medit;
  const std::vector<int> order = groups_cells ? medit_order(lattice.complex.cells) : std::vector<int>{};
  std::string json = detail::lattice_to_json(lattice, joints, order);
  switch (format) {
    case LatticeFormat::Vtu:
      return format_vtu(make_grid(lattice, json, fields));
    case LatticeFormat::Vtk:
      return format_vtk(make_grid(lattice, json, fields), Encoding::Ascii);
    case LatticeFormat::VtkBinary:
      return format_vtk(make_grid(lattice, json, fields), Encoding::Binary);
    case LatticeFormat::Gmsh41:
      return format_gmsh(make_mesh(lattice, std::move(json)), GmshVersion::V41, Encoding::Ascii);
    case LatticeFormat::Gmsh41Binary:
      return format_gmsh(make_mesh(lattice, std::move(json)), GmshVersion::V41, Encoding::Binary);
    case LatticeFormat::Gmsh22:
      return format_gmsh(make_mesh(lattice, std::move(json)), GmshVersion::V22, Encoding::Ascii);
    case LatticeFormat::Gmsh22Binary:
      return format_gmsh(make_mesh(lattice, std::move(json)), GmshVersion::V22, Encoding::Binary);
    case LatticeFormat::Medit:
      return format_medit(make_mesh(lattice, std::move(json)));
    case LatticeFormat::TetGen: {
      TetgenTexts texts = format_tetgen(make_mesh(lattice, std::move(json)));
      if (second != nullptr) *second = std::move(texts.ele);
      return std::move(texts.node);
    }
    case LatticeFormat::Vega:
      return format_vega(make_mesh(lattice, std::move(json)));
  }
  return {};
}

std::vector<std::string> lattice_file_names(const std::string& file) {
  if (lattice_format(file) != LatticeFormat::TetGen) return {file};
  return {tetgen_partner(file, ".node"), tetgen_partner(file, ".ele")};
}

void write_lattice(const std::string& file, const ControlLattice& lattice, const lattice::JointTree& joints,
                   Overwrite overwrite, const LatticeFields& fields, const std::string& format_name) {
  std::string second;
  const std::string first =
      format_lattice(lattice_format(file, format_name), lattice, joints, fields, &second);
  const std::vector<std::string> names = lattice_file_names(file);
  if (names.size() == 2) write_file(names[1], second, overwrite);
  try {
    write_file(names[0], first, overwrite);
  } catch (...) {
    // Half of a pair is worth nothing; what an overwritten one held is lost either way.
    std::error_code ignored;
    if (names.size() == 2) std::filesystem::remove(names[1], ignored);
    throw;
  }
}

VolumeMesh read_volume_mesh(const std::string& file) {
  VolumeMesh mesh = parse(file);
  if (mesh.complex.cells.empty()) throw InputError(file, "holds no tetrahedron, wedge or hexahedron");
  if (mesh.annotation.empty()) drop_idle_vertices(mesh);
  lattice::orient_cells(mesh.complex);
  return mesh;
}

ControlLattice read_lattice(const std::string& file, const LatticeInput& input,
                            const ReadLatticeOptions& options) {
  VolumeMesh mesh = read_volume_mesh(file);
  if (mesh.annotation.empty()) {
    for (Eigen::Index v = 0; v < mesh.complex.points.rows(); ++v)
      mesh.complex.points.row(v) =
          (options.rig_from_file * mesh.complex.points.row(v).transpose().eval()).transpose();
    lattice::orient_cells(mesh.complex);  // the map may be a mirror
  }
  try {
    if (mesh.annotation.empty()) {
      refuse_faults(file, mesh, lattice::Coincidence::Refused);
      // Before the bones, as a lattice in other units has neither where they should be; and after them, as
      // snapping moves vertices.
      refuse_skin_outside(mesh.complex, input);
      ControlLattice lattice = lattice::recover_bones(mesh.complex, input.skin.surface, input.joints,
                                                      options.bones, mesh.numbering);
      refuse_skin_outside(lattice.complex, input);
      lattice.regions = std::move(mesh.regions);
      lattice.region_names = std::move(mesh.region_names);
      return lattice;
    }
    ControlLattice lattice;
    lattice.complex = mesh.complex;
    const lattice::Coincidence coincidence = detail::lattice_from_json(
        fmt::format("{}: '{}'", file, detail::kAnnotation), mesh.annotation, input.joints, lattice);
    refuse_faults(file, mesh, coincidence);
    lattice::validate(lattice);
    if (const std::string line = lattice::parts_without_bone(lattice, mesh.numbering); !line.empty())
      throw std::invalid_argument(line);
    refuse_skin_outside(lattice.complex, input);
    lattice.quality = lattice::measure_quality(lattice, input.skin.surface);
    if (!lattice.quality.exact_chains)
      throw std::invalid_argument("a bone is no exact chain of edges; hint: write the lattice anew");
    return lattice;
  } catch (const std::invalid_argument& error) {
    throw InputError(file, error.what());
  }
}

}  // namespace sinew::assets
