#pragma once

#include <optional>
#include <string>

#include "lattice/build.h"
#include "lattice/surface.h"

namespace sinew::tools {

/// What `sinew lattice` is asked to do.
struct LatticeRequest {
  std::string rig;     ///< input file.
  std::string output;  ///< lattice file to write; the picture is beside it, with .png behind its name.
  std::string format;  ///< where the extension leaves a choice; empty: its default.
  int cells = 1000;    ///< wanted [-]; 20 ... 1e6.
  std::optional<double> height;  ///< of the character [m]; 1e-3 ... 1e4. Unset: guessed.
  std::string lattice;           ///< a lattice of the user's to check and write instead of building one.
  bool lattice_in_file_space = false;  ///< its units and axes are the rig file's; else metres, Y up.
  double snap_tolerance = 1e-4;  ///< how far it may miss its bones, as a share of the skin's size; (0, 0.1].
  bool soft_bones = false;       ///< bones that are no edges of it are held by penalty.
  bool no_picture = false;
  bool no_cache = false;
  bool overwrite = false;
  bool json = false;  ///< the lattice as JSON on stdout.
};

/// Builds the lattice (or checks the user's) and writes it with its picture; data to stdout, talk to stderr.
/// Throws assets::ConfigError (bad value, unknown extension), assets::BusyError (a file is there),
/// NumericalError (the gate fails; nothing is written) and what reading and writing throw.
void run_lattice(const LatticeRequest& request);

/// The JSON of --json: vertices [m], cells, bones with their chains, tip and soft bones, soft frames, changes
/// to the skeleton, quality.
std::string lattice_report(const lattice::ControlLattice& lattice, const lattice::JointTree& joints);

}  // namespace sinew::tools
