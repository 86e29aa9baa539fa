#pragma once

#include <string>
#include <vector>

#include "assets/lattice_input.h"
#include "assets/rig.h"
#include "fem/time/simulation.h"
#include "lattice/build.h"
#include "tools/scene/scene.h"
#include "tools/support/caller.h"

/// From a scene to a body that can be simulated: rig, clip, lattice, flesh.
namespace sinew::tools {

/// Seconds spent in each phase, in order.
using PhaseTimes = std::vector<std::pair<std::string, double>>;

/// Everything a run needs, in the rig's space (SI, Y up).
struct Character {
  assets::Rig rig;
  int clip = -1;                     ///< index into rig.clips; -1: none, the rest pose alone.
  assets::LatticeInput input;        ///< welded skin and joints.
  lattice::BuildResult lattice;      ///< built, or read from the scene's lattice file.
  std::string new_lattice_key;       ///< where it was built: its name in the cache, to be kept there.
  fem::BodyOptions body_options;     ///< materials and damping in force.
  std::vector<fem::HeldPlane> held;  ///< of a plain scene.
  std::vector<int> bare_frames;      ///< of a plain scene that nothing holds.
  double limb_thickness = 0.0;       ///< t of the default stiffness [m].
  double swing = 0.0;                ///< f of the default stiffness [Hz].
  PhaseTimes times;

  const skeleton::Clip& the_clip() const { return rig.clips[static_cast<std::size_t>(clip)]; }
  /// pose_from_rest of every joint at a time [s].
  std::vector<Eigen::Affine3d> pose(double time) const;
};

/// Loads the rig, chooses the clip, builds or reads the lattice and settles the materials. Throws the errors
/// of assets/error.h, and NumericalError where the lattice has a failure that a simulation cannot bear, and
/// Stopped.
Character make_character(const Scene& scene, const Caller& caller);

/// The flesh of the character. Throws assets::InputError naming the rig where the lattice cannot carry it.
fem::Body make_body(const Character& character);

/// The same to look at: materials and regions without matrices. Without a clip every frame has a region.
fem::Body paint_body(const Character& character);

}  // namespace sinew::tools
