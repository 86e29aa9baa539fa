#pragma once

#include <string>

#include "assets/atomic_output.h"
#include "assets/lattice_input.h"
#include "lattice/control_lattice.h"

namespace sinew::assets {

/// Lattice files, told apart by their extension.
enum class LatticeFormat {
  Vtu,    ///< VTK XML: everything, bit for bit.
  Medit,  ///< .mesh: the cells and, as numbered edges, the bones.
};

/// Throws ConfigError for any other extension, naming the two.
LatticeFormat lattice_format(const std::string& file);

/// The content of a lattice file. `joints` are those the lattice was built for: the file keeps their names.
/// A .vtu has the cell arrays dihedral [degrees], scaled_jacobian [-], volume [m^3], region (a joint index:
/// the frame of the bone or soft frame nearest to the cell's mean) and bone (of the lines, an index; -1 for
/// cells), the point array bone (-1 off the bones), and the file array sinew_lattice (text).
std::string format_lattice(LatticeFormat format, const lattice::ControlLattice& lattice,
                           const lattice::JointTree& joints);

/// Writes the file under a temporary name and renames it. Throws ConfigError for an unknown extension,
/// IoError.
void write_lattice(const std::string& file, const lattice::ControlLattice& lattice,
                   const lattice::JointTree& joints, Overwrite overwrite);

/// Reads a lattice for `input`. A .vtu of write_lattice comes back bit for bit, its joints found by name. Of
/// any other .vtu or .mesh the bones are found in its edges (lattice/recover_bones.h); cells of a type that
/// are all turned inside out are turned back. The quality is measured anew. Throws ConfigError for an unknown
/// extension, InputError with the line and thing, IoError.
lattice::ControlLattice read_lattice(const std::string& file, const LatticeInput& input);

}  // namespace sinew::assets
