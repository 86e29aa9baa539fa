#pragma once

#include <optional>
#include <string>
#include <vector>

#include "assets/rig.h"
#include "lattice/control_lattice.h"

namespace sinew::tools {

/// What becomes of a joint when flesh is put round the skeleton.
struct JointUse {
  double weight_share = 0.0;       ///< part of all skin weight that hangs on it; in [0, 1].
  std::vector<std::string> bones;  ///< lattice bones that move with it.
  std::string reason;              ///< why it has none; empty where it has one.
};

/// Everything `sinew inspect` tells about a file.
struct Inspection {
  assets::Rig rig;
  int clip = -1;                 ///< taken when none is named; -1 where none moves.
  std::vector<JointUse> joints;  ///< one per joint of the rig.
  std::vector<lattice::LatticeBone> bones;
  std::vector<lattice::SkeletonChange> changes;
  bool usable = false;  ///< for `sinew simulate` with no other option.
};

/// Loads the file and finds the bones of a lattice of default size. Throws as assets::load_rig().
Inspection inspect(const std::string& file, const assets::LoadOptions& options = {});

/// For people, several lines.
std::string inspection_text(const Inspection& inspection);

/// For programs: one JSON object.
std::string inspection_json(const Inspection& inspection);

}  // namespace sinew::tools
