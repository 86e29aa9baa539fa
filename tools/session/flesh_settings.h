#pragma once

#include <vector>

#include "tools/session/character.h"

/// How stiff, heavy and damped the flesh of a character is.
namespace sinew::tools {

/// How far apart the poses are that the flesh is judged by [s]: enough to see every bend of a clip keyed at
/// 24 to 60 Hz.
inline constexpr double kPoseSpacing = 1.0 / 30.0;

/// pose_from_rest of every joint over the whole clip, kPoseSpacing apart, without those that are scaled to
/// nothing; the rest pose where there is no clip.
std::vector<std::vector<Eigen::Affine3d>> sample_poses(const Character& character);

/// Damping, materials, pulls and regions for a rig, a clip and a lattice that are there. Throws
/// assets::ConfigError and assets::InputError for a bone or region that is not there.
void settle_flesh(const Scene& scene, Character& character, const Talk& talk);

}  // namespace sinew::tools
