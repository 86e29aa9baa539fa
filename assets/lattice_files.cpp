#include "assets/lattice_files.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "assets/detail/file_bytes.h"
#include "assets/detail/lattice_json.h"
#include "assets/error.h"
#include "assets/medit.h"
#include "assets/vtu.h"
#include "lattice/build.h"
#include "lattice/quality.h"
#include "lattice/recover_bones.h"

namespace sinew::assets {
namespace {

using Eigen::Vector3d;
using lattice::Cell;
using lattice::CellType;
using lattice::ControlLattice;

constexpr const char* kJsonArray = "sinew_lattice";

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

std::string format_as_vtu(const ControlLattice& lattice, const lattice::JointTree& joints) {
  VtuGrid grid;
  grid.points = lattice.complex.points;
  grid.cells = lattice.complex.cells;
  std::vector<double> dihedral, jacobian, volume;
  std::vector<std::int64_t> region, bone_of_cell, bone_of_point(grid.points.rows(), -1);
  for (const Cell& cell : grid.cells) {
    Vector3d mean = Vector3d::Zero();
    for (int k = 0; k < num_corners(cell.type); ++k) mean += grid.points.row(cell.vertices[k]).transpose();
    dihedral.push_back(lattice::min_dihedral_degrees(lattice.complex, cell));
    jacobian.push_back(lattice::min_scaled_jacobian(lattice.complex, cell));
    volume.push_back(lattice::cell_volume(lattice.complex, cell));
    region.push_back(nearest_frame(lattice, mean / num_corners(cell.type)));
    bone_of_cell.push_back(-1);
  }
  for (std::size_t b = 0; b < lattice.bones.size(); ++b) {
    const lattice::LatticeBone& bone = lattice.bones[b];
    if (bone.chain.empty()) continue;
    grid.lines.push_back(bone.chain);
    for (int v : bone.chain) bone_of_point[v] = static_cast<std::int64_t>(b);
    dihedral.push_back(0.0);
    jacobian.push_back(0.0);
    volume.push_back(0.0);
    region.push_back(bone.frame);
    bone_of_cell.push_back(static_cast<std::int64_t>(b));
  }
  const std::string json = detail::lattice_to_json(lattice, joints);
  grid.point_arrays = {{"bone", 1, bone_of_point}};
  grid.cell_arrays = {{"dihedral", 1, dihedral},
                      {"scaled_jacobian", 1, jacobian},
                      {"volume", 1, volume},
                      {"region", 1, region},
                      {"bone", 1, bone_of_cell}};
  grid.file_arrays = {{kJsonArray, 1, std::vector<std::uint8_t>(json.begin(), json.end())}};
  return format_vtu(grid);
}

std::string format_as_medit(const ControlLattice& lattice) {
  MeditMesh mesh;
  mesh.complex = lattice.complex;
  for (std::size_t b = 0; b < lattice.bones.size(); ++b)
    for (std::size_t i = 1; i < lattice.bones[b].chain.size(); ++i)
      mesh.edges.push_back(
          {{lattice.bones[b].chain[i - 1], lattice.bones[b].chain[i]}, static_cast<int>(b) + 1});
  return format_medit(mesh);
}

/// The other orientation of a cell.
Cell turned(Cell cell) {
  std::array<int, 8>& v = cell.vertices;
  if (cell.type == CellType::Tetrahedron) {
    std::swap(v[0], v[1]);
  } else {
    const int half = num_corners(cell.type) / 2;
    for (int k = 0; k < half; ++k) std::swap(v[k], v[k + half]);
  }
  return cell;
}

/// Programs disagree on the orientation of a cell type: where all cells of one type are inside out, all are
/// turned. Where only some are, the file is wrong.
void orient_cells(const std::string& file, lattice::CellComplex& complex) {
  for (const CellType type : {CellType::Tetrahedron, CellType::Wedge, CellType::Hexahedron}) {
    std::vector<std::size_t> inverted;
    std::size_t count = 0;
    for (std::size_t c = 0; c < complex.cells.size(); ++c) {
      if (complex.cells[c].type != type) continue;
      ++count;
      if (!(lattice::cell_volume(complex, complex.cells[c]) > 0.0)) inverted.push_back(c);
    }
    if (inverted.size() == count) {
      for (std::size_t c : inverted) complex.cells[c] = turned(complex.cells[c]);
    }
    for (std::size_t c : inverted) {
      const double volume = lattice::cell_volume(complex, complex.cells[c]);
      if (volume > 0.0) continue;
      throw InputError(
          file,
          fmt::format("cell {}: volume, got {:.3g}, expected more than 0 ({} of {} such cells are inverted "
                      "or flat); hint: repair the mesh",
                      c, volume, inverted.size(), count));
    }
  }
}

/// The cells of one file, and the text of our own array where there is one.
struct FileContent {
  lattice::CellComplex complex;
  std::string json;
};

FileContent read_content(const std::string& file) {
  const LatticeFormat format = lattice_format(file);
  const std::string text = detail::read_whole(file);
  if (text.empty()) throw InputError(file, "is empty, expected a lattice");
  FileContent content;
  if (format == LatticeFormat::Medit) {
    content.complex = parse_medit(file, text).complex;
  } else {
    VtuGrid grid = parse_vtu(file, text);
    for (const VtuArray& array : grid.file_arrays)
      if (const auto* bytes = std::get_if<std::vector<std::uint8_t>>(&array.values);
          bytes && array.name == kJsonArray)
        content.json.assign(bytes->begin(), bytes->end());
    content.complex = {std::move(grid.points), std::move(grid.cells)};
  }
  if (content.complex.cells.empty()) throw InputError(file, "holds no tetrahedron, wedge or hexahedron");
  return content;
}

}  // namespace

LatticeFormat lattice_format(const std::string& file) {
  const std::string extension = std::filesystem::path(file).extension().string();
  if (extension == ".vtu") return LatticeFormat::Vtu;
  if (extension == ".mesh") return LatticeFormat::Medit;
  throw ConfigError(fmt::format("{}: extension, got '{}', expected '.vtu' or '.mesh'", file, extension));
}

std::string format_lattice(LatticeFormat format, const ControlLattice& lattice,
                           const lattice::JointTree& joints) {
  return format == LatticeFormat::Vtu ? format_as_vtu(lattice, joints) : format_as_medit(lattice);
}

void write_lattice(const std::string& file, const ControlLattice& lattice, const lattice::JointTree& joints,
                   Overwrite overwrite) {
  write_file(file, format_lattice(lattice_format(file), lattice, joints), overwrite);
}

ControlLattice read_lattice(const std::string& file, const LatticeInput& input) {
  FileContent content = read_content(file);
  orient_cells(file, content.complex);
  try {
    if (content.json.empty())
      return lattice::recover_bones(content.complex, input.skin.surface, input.joints);
    ControlLattice lattice;
    lattice.complex = std::move(content.complex);
    detail::lattice_from_json(file + ": array 'sinew_lattice'", content.json, input.joints, lattice);
    lattice::validate(lattice);
    lattice.quality = lattice::measure_quality(lattice, input.skin.surface);
    return lattice;
  } catch (const std::invalid_argument& error) {
    throw InputError(file, error.what());
  }
}

}  // namespace sinew::assets
