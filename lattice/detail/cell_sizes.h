#pragma once

#include <algorithm>
#include <compare>
#include <limits>
#include <vector>

#include "lattice/build.h"
#include "lattice/detail/joint_weights.h"
#include "lattice/detail/unit_skin.h"

namespace sinew::lattice::detail {

/// The target edge of one flesh, as it follows from h. Thin limbs get the smaller edges that they ask for
/// relative to the thickest limb, whose edge is h: where all are alike, all edges are.
struct SizeRule {
  static constexpr double kAny = std::numeric_limits<double>::infinity();

  double factor = 1.0;
  double allowed = kAny;   ///< the edge that this limb is thick enough for, unit coordinates.
  double thickest = kAny;  ///< the largest that some limb is thick enough for.

  double edge(double h) const;
  auto operator<=>(const SizeRule&) const = default;
};

/// How large cells shall be at every place: the flesh of a joint (its skin, its bones and what lies between
/// them) has the target edge of its rule, and away from it the target edge may grow by kGrowth per length, so
/// that neighbouring cells differ little: the smallest of edge + kGrowth distance over all flesh. Unit
/// coordinates.
class CellSizes {
 public:
  /// Growth of the target edge per length: the cell behind a cell of edge e has an edge of about 1.35 e.
  static constexpr double kGrowth = 0.35;

  /// Flesh along a segment.
  struct Flesh {
    SizeRule rule;
    Eigen::Vector3d a, b;  ///< its ends.
  };

  CellSizes() = default;  ///< h everywhere.
  /// `rule_of_vertex`: per welded point of the skin; `segments` are further flesh.
  CellSizes(const UnitSkin& skin, const std::vector<SizeRule>& rule_of_vertex,
            const std::vector<Flesh>& segments);

  /// Whether the target edge is h everywhere.
  bool is_uniform(double h) const { return smallest(h) == h && largest(h) == h; }
  /// Target edge at p where that of flesh without a rule is h.
  double edge_at(const Eigen::Vector3d& p, double h) const;
  /// The extreme target edges.
  double smallest(double h) const;
  double largest(double h) const;

 private:
  struct Place {
    SizeRule rule;
    SurfaceQuery flesh;
  };
  std::vector<Place> places_;  ///< by rule; empty where there is none.
};

/// The joints of options.size_factors that no skin hangs on, ascending: excluded ones are among them.
std::vector<int> idle_sizes(const JointWeights& weights, const BuildOptions& options);

/// The sizes that the options ask for. `stand_in` says for every joint which one its skin counts for;
/// `partner`, of a mirrored rig, which joint is its image: both have the skin of both. null: none is looked
/// at.
CellSizes sizes_of_joints(const UnitSkin& skin, const JointTree& unit_joints, const JointWeights& weights,
                          const std::vector<int>& stand_in, const BuildOptions& options,
                          const std::vector<int>* partner = nullptr);

}  // namespace sinew::lattice::detail
