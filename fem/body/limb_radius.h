#pragma once

#include <vector>

#include "fem/body/frames.h"
#include "lattice/mirror_map.h"
#include "lattice/surface.h"

namespace sinew::fem {

/// How thick the flesh round a bone is.
class LimbRadii {
 public:
  /// `window` h [m]: skin that projects onto the bone within it of a point counts there. With `mirror`, of a
  /// mirrored lattice, partners have the skin of both; null: none is looked at.
  LimbRadii(const lattice::ControlLattice& lattice, const FrameTree& tree, const lattice::Surface& skin,
            double window, const lattice::MirrorMap* mirror = nullptr);

  /// Whole-bone radius [m]: area-weighted median distance to the bone of the skin vertices whose dominant
  /// frame is the bone's; a tenth of its length where there are none.
  double of_bone(int bone) const { return bones_[static_cast<std::size_t>(bone)].median; }
  /// Radius [m] near the point at distance `along` [m] from the bone's start, over the skin within the
  /// window; else of_bone.
  double near(int bone, double along) const;

 private:
  struct Sample {
    double along, distance, area;
  };
  struct Bone {
    std::vector<Sample> samples;
    double median = 0.0;
  };
  void share(const std::vector<int>& partner);

  std::vector<Bone> bones_;
  double window_ = 0.0;
};

}  // namespace sinew::fem
