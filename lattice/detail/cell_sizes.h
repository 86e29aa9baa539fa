#pragma once

#include <vector>

#include "lattice/build.h"
#include "lattice/detail/joint_weights.h"
#include "lattice/detail/unit_skin.h"

namespace sinew::lattice::detail {

/// How large cells shall be at every place: the flesh of a joint (its skin, its bones and what lies between
/// them) has the target edge h times the joint's factor, and away from it the target edge may grow by
/// kGrowth per length, so that neighbouring cells differ little: the smallest of
/// h factor + kGrowth distance over all flesh. Unit coordinates.
class CellSizes {
 public:
  /// Growth of the target edge per length: the cell behind a cell of edge e has an edge of about 1.35 e.
  static constexpr double kGrowth = 0.35;

  /// Flesh along a segment.
  struct Flesh {
    double factor = 1.0;
    Eigen::Vector3d a, b;  ///< its ends.
  };

  CellSizes() = default;  ///< h everywhere.
  /// `factor_of_vertex`: per welded point of the skin; `segments` are further flesh.
  CellSizes(const UnitSkin& skin, const std::vector<double>& factor_of_vertex,
            const std::vector<Flesh>& segments);

  bool is_uniform() const { return largest_ == 1.0 && finer_.empty(); }
  /// Target edge at p where that of flesh with a factor of 1 is h.
  double edge_at(const Eigen::Vector3d& p, double h) const;
  /// The extreme factors.
  double smallest() const { return finer_.empty() ? largest_ : finer_.front().factor; }
  double largest() const { return largest_; }

 private:
  struct Place {
    double factor;
    SurfaceQuery flesh;
  };
  std::vector<Place> finer_;  ///< all but the coarsest flesh, by factor.
  double largest_ = 1.0;
};

/// The joints of options.size_factors that no skin hangs on, ascending: excluded ones are among them.
std::vector<int> idle_sizes(const JointWeights& weights, const BuildOptions& options);

/// The sizes that the options ask for. `stand_in` says for every joint which one its skin counts for.
CellSizes sizes_of_joints(const UnitSkin& skin, const JointTree& unit_joints, const JointWeights& weights,
                          const std::vector<int>& stand_in, const BuildOptions& options);

}  // namespace sinew::lattice::detail
