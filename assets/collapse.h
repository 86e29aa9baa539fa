#pragma once

#include <optional>

#include "assets/rig.h"
#include "skeleton/clip.h"

/// Clips that scale flesh to nothing, as games hide things: there is no flesh without a volume.
namespace sinew::assets {

/// Where and when.
struct Collapse {
  double time = 0.0;  ///< [s], as the clip counts.
  int joint = -1;     ///< its map from rest to pose keeps no volume, or turns it inside out.
};

/// The first moment of [begin, end] [s] at which a joint that carries skin of a simulated part, or one above
/// such a joint, keeps less than 1e-12 of its volume at rest or is mirrored against that; to within 1e-6 s.
/// Nothing where the clip keeps all scales away from 0.
std::optional<Collapse> first_collapse(const Rig& rig, const skeleton::Clip& clip, double begin, double end);

/// "joint 'arm' is scaled to nothing at 1.25 s".
std::string collapse_text(const Rig& rig, const Collapse& collapse);

}  // namespace sinew::assets
