#pragma once

#include <vector>

#include "tools/session/character.h"

/// What a scene and a clip ask of the time loop.
namespace sinew::tools {

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
