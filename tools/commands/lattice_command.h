#pragma once

#include <string>

#include "lattice/build.h"
#include "lattice/surface.h"
#include "tools/scene/scene.h"

namespace sinew::tools {

/// What `sinew lattice` is asked to do.
struct LatticeRequest {
  /// The rig, the output (a lattice file; the picture is beside it, with .png behind its name) and what
  /// concerns the lattice: its size, joints, cache, or a lattice of the user's to check and write instead of
  /// building one.
  Scene scene;
  std::string format;  ///< where the extension of the output leaves a choice; empty: its default.
};

/// Builds the lattice (or checks the user's) and writes it with its picture; data to stdout, talk to stderr.
/// Throws assets::ConfigError (bad value, unknown extension), assets::BusyError (a file is there),
/// NumericalError (the gate fails; nothing is written) and what reading and writing throw.
void run_lattice(const LatticeRequest& request);

/// The JSON of --json: vertices [m], cells, bones with their chains, tip and soft bones, soft frames, changes
/// to the skeleton, symmetry, quality.
std::string lattice_report(const lattice::BuildResult& result, const lattice::JointTree& joints);

}  // namespace sinew::tools
