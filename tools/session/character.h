#pragma once

#include <functional>
#include <string>
#include <vector>

#include "assets/lattice_files.h"
#include "assets/lattice_input.h"
#include "assets/rig.h"
#include "fem/time/simulation.h"
#include "lattice/build.h"
#include "tools/scene/scene.h"

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

/// Called with one sentence for whatever the user should hear: warnings of the gate, what was chosen.
using Talk = std::function<void(const std::string&)>;

/// Loads the rig, chooses the clip, builds or reads the lattice and settles the materials. Throws the errors
/// of assets/error.h, and NumericalError where the lattice has a failure that a simulation cannot bear.
Character make_character(const Scene& scene, const Talk& talk);

/// The last part of it: damping, materials, pulls and regions for a rig, a clip and a lattice that are there.
/// Throws assets::ConfigError and assets::InputError for a bone or region that is not there.
void settle_flesh(const Scene& scene, Character& character, const Talk& talk);

/// How a lattice of the user's is read.
assets::ReadLatticeOptions read_options(const Scene& scene, const assets::Rig& rig);

/// The builder's options for a scene and the names of a rig's joints. Throws assets::ConfigError for a
/// pattern that fits no joint, naming the nearest. A build with them throws Interrupted when a signal came.
lattice::BuildOptions build_options(const Scene& scene, const std::vector<std::string>& joints);

/// Moves sizes from joints without skin to the nearest above that has some and no size of its own, and says
/// so.
void hang_idle_sizes(const assets::LatticeInput& input, const Talk& talk, lattice::BuildOptions& options);

/// Says which joints the scene sizes cells at in vain.
void warn_of_idle_sizes(const lattice::BuildResult& result, const std::vector<std::string>& joints,
                        const Talk& talk);

/// The flesh of the character. Throws assets::InputError naming the rig where the lattice cannot carry it.
fem::Body make_body(const Character& character);

/// The same to look at: materials and regions without matrices. Without a clip every frame has a region.
fem::Body paint_body(const Character& character);

/// fem's options for a scene.
fem::SimulationOptions simulation_options(const Scene& scene);
/// The same with what the character's clip adds: how dense its keys are, and cuts, found and stated.
fem::SimulationOptions simulation_options(const Scene& scene, const Character& character,
                                          const fem::Body& body);

/// One sentence for every cut of a run over these frames, and for every frame stated in vain.
void say_cuts(const Scene& scene, const Character& character, const std::vector<fem::Cut>& cuts,
              const FrameRange& frames, const Talk& talk);

/// Output frames, at the clip times t0 + k / fps: the scene's, or the whole clip. Where the clip scales flesh
/// to nothing the whole clip ends before that, with a word; frames that the scene asks for and that reach it
/// are an assets::InputError.
FrameRange frame_range(const Scene& scene, const Character& character, const Talk& talk);

}  // namespace sinew::tools
