#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "assets/atomic_output.h"
#include "assets/lattice_input.h"
#include "assets/volume_mesh.h"
#include "assets/vtu.h"
#include "lattice/control_lattice.h"
#include "lattice/recover_bones.h"

namespace sinew::assets {

/// Lattice files. Reading tells them apart by their extension and what they say of themselves.
enum class LatticeFormat {
  Vtu,           ///< .vtu, VTK XML.
  Vtk,           ///< .vtk, legacy VTK as text.
  VtkBinary,     ///< .vtk.
  Gmsh41,        ///< .msh, Gmsh 4.1 as text.
  Gmsh41Binary,  ///< .msh.
  Gmsh22,        ///< .msh, Gmsh 2.2 as text.
  Gmsh22Binary,  ///< .msh.
  Medit,         ///< .mesh.
  TetGen,        ///< .node and .ele: tetrahedra only.
  Vega,          ///< .veg: tetrahedra only or hexahedra only.
};

/// The format that a file of that name gets; .msh means 4.1 and .vtk legacy VTK, both as text. Throws
/// ConfigError for an unknown extension, naming those there are.
LatticeFormat lattice_format(const std::string& file);

/// As above, but `name` chooses where the extension leaves a choice: vtk, vtk-binary, msh41, msh41-binary,
/// msh22, msh22-binary; an empty name leaves it open. Throws ConfigError where it does not fit the extension.
LatticeFormat lattice_format(const std::string& file, const std::string& name);

/// More to see in VTK files, with one tuple per cell and per vertex of the lattice.
struct LatticeFields {
  std::vector<VtuArray> points;
  std::vector<VtuArray> cells;
};

/// Share of flesh [-] in every cell ("fill", as the simulation samples it) and the level of its finest
/// subdivision ("level", 0: not subdivided).
LatticeFields skin_fields(const lattice::ControlLattice& lattice, const lattice::Surface& skin);

/// The content of a lattice file; for TetGen that of the .node file, with the .ele file in `second`. `joints`
/// are those the lattice was built for: the file keeps their names.
/// VTK files have the cell arrays dihedral [degrees], scaled_jacobian [-], volume [m^3], frame (a joint
/// index: the frame of the bone or soft frame nearest to the cell's mean), region (the user's regions; frame
/// where there are none), bone (of the lines, an index; -1 for cells) and place (of cells that coincide, one
/// for each limb, the smallest index; else -1), the point array bone (-1 off the bones), `fields`, and the
/// file array sinew_lattice (text). On lines real arrays are NaN (-1 in .vtk as text).
std::string format_lattice(LatticeFormat format, const lattice::ControlLattice& lattice,
                           const lattice::JointTree& joints, const LatticeFields& fields = {},
                           std::string* second = nullptr);

/// Writes the file (for TetGen both) under a temporary name and renames it. Throws ConfigError for an unknown
/// extension or cells that the format cannot hold, BusyError, IoError.
void write_lattice(const std::string& file, const lattice::ControlLattice& lattice,
                   const lattice::JointTree& joints, Overwrite overwrite, const LatticeFields& fields = {},
                   const std::string& format_name = {});

/// Every file that write_lattice makes for that name.
std::vector<std::string> lattice_file_names(const std::string& file);

/// The cells of any lattice file, indices checked, turned to positive volume, idle vertices dropped from
/// files of other programs. Throws ConfigError for an unknown extension, InputError with the line and thing,
/// IoError.
VolumeMesh read_volume_mesh(const std::string& file);

struct ReadLatticeOptions {
  /// How bones are found in files of other programs.
  lattice::RecoverOptions bones;
  /// From the coordinates of such a file to the rig's space: metres, Y up. Sinew's own are there already.
  Eigen::Affine3d rig_from_file = Eigen::Affine3d::Identity();
};

/// Reads a lattice for `input`. A file of write_lattice comes back bit for bit, its joints found by name. In
/// files of other programs the bones are found in the edges (lattice/recover_bones.h). Whatever the file,
/// cells (lattice/check_cells.h), bones, parts and the skin are checked, and the quality is measured anew.
/// Throws ConfigError for an unknown extension, InputError with one line about the first thing wrong,
/// IoError.
lattice::ControlLattice read_lattice(const std::string& file, const LatticeInput& input,
                                     const ReadLatticeOptions& options = {});

}  // namespace sinew::assets
