#pragma once

#include <vector>

#include "lattice/detail/skeleton_reduction.h"

namespace sinew::lattice::detail {

/// A stretch of one bone, parameters in [0, 1].
struct BoneStretch {
  int bone = -1;
  double low = 0.0;
  double high = 0.0;
};

/// Path lengths along a reduced skeleton, unit coordinates.
class SkeletonDistance {
 public:
  explicit SkeletonDistance(const ReducedSkeleton& skeleton);

  /// The shortest way along the bones from one stretch to the other; infinite between separate trees.
  double between(const BoneStretch& a, const BoneStretch& b) const;

 private:
  struct Bone {
    int start, end;
    double length;
  };
  std::vector<Bone> bones_;
  std::vector<std::vector<double>> node_distance_;
};

}  // namespace sinew::lattice::detail
