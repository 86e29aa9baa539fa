#pragma once

#include <string>
#include <vector>

#include "assets/lattice_files.h"
#include "assets/lattice_input.h"
#include "assets/rig.h"
#include "lattice/build.h"
#include "tools/scene/scene.h"
#include "tools/support/caller.h"

/// What a scene asks of the lattice.
namespace sinew::tools {

/// How a lattice of the user's is read.
assets::ReadLatticeOptions read_options(const Scene& scene, const assets::Rig& rig);

/// The builder's options for a scene and the names of a rig's joints. Throws assets::ConfigError for a
/// pattern that fits no joint, naming the nearest. A build with them throws Stopped when the caller, who must
/// outlive it, asks for that.
lattice::BuildOptions build_options(const Scene& scene, const std::vector<std::string>& joints,
                                    const Caller& caller);

/// Moves sizes from joints without skin to the nearest above that has some and no size of its own, and says
/// so.
void hang_idle_sizes(const assets::LatticeInput& input, const Talk& talk, lattice::BuildOptions& options);

/// Says which joints the scene sizes cells at in vain.
void warn_of_idle_sizes(const lattice::BuildResult& result, const std::vector<std::string>& joints,
                        const Talk& talk);

}  // namespace sinew::tools
