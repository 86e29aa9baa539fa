#pragma once

#include <optional>
#include <string>

#include "lattice/build.h"
#include "lattice/surface.h"

namespace sinew::tools {

/// What `sinew lattice` is asked to do.
struct LatticeRequest {
  std::string rig;               ///< input file.
  std::string output;            ///< .vtu or .mesh.
  int cells = 1000;              ///< wanted [-]; 20 ... 1e6.
  std::optional<double> height;  ///< of the character [m]; 1e-3 ... 1e4. Unset: guessed.
  bool overwrite = false;
  bool json = false;  ///< the lattice as JSON on stdout.
};

/// Builds and writes the lattice; data to stdout, talk to stderr. Throws assets::ConfigError (bad value,
/// unknown extension), assets::BusyError (the file is there), NumericalError (the gate fails; nothing is
/// written) and what reading and writing throw.
void run_lattice(const LatticeRequest& request);

/// The JSON of --json: vertices [m], cells, bones with their chains, tip and soft bones, soft frames, changes
/// to the skeleton, quality.
std::string lattice_report(const lattice::ControlLattice& lattice, const lattice::JointTree& joints);

}  // namespace sinew::tools
