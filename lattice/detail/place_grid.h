#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "lattice/points.h"

namespace sinew::lattice::detail {

/// Points by place: cubes of equal side, as many as there are points along with the box they fill.
class PlaceGrid {
 public:
  /// `chosen`: the rows of `points` to hold, at least one. `points` must outlive the grid.
  PlaceGrid(const Points& points, const std::vector<int>& chosen) : points_(points) {
    low_ = high_ = points.row(chosen.front()).transpose().array();
    for (int v : chosen) {
      low_ = low_.min(points.row(v).transpose().array());
      high_ = high_.max(points.row(v).transpose().array());
    }
    const double across = std::clamp(std::cbrt(static_cast<double>(chosen.size())), 1.0, 200.0);
    side_ = std::max((high_ - low_).maxCoeff() / across, 1e-300);
    for (int v : chosen) entries_.emplace_back(key(place(points.row(v).transpose().array())), v);
    std::sort(entries_.begin(), entries_.end());
  }

  /// Calls visitor(row) for every point in the box, and for some near it.
  template <class Visitor>
  void visit(const Eigen::Array3d& low, const Eigen::Array3d& high, const Visitor& visitor) const {
    const Eigen::Array3i first = place(low), last = place(high);
    for (int i = first.x(); i <= last.x(); ++i)
      for (int j = first.y(); j <= last.y(); ++j) {
        const std::int64_t end = key({i, j, last.z()});
        for (auto entry = std::lower_bound(entries_.begin(), entries_.end(),
                                           std::pair<std::int64_t, int>(key({i, j, first.z()}), -1));
             entry != entries_.end() && entry->first <= end; ++entry)
          visitor(entry->second);
      }
  }

 private:
  static constexpr int kAcross = 256;  ///< more than there are cubes along an axis.

  Eigen::Array3i place(const Eigen::Array3d& p) const {
    return ((p - low_) / side_).max(0.0).min(kAcross - 1.0).cast<int>();
  }
  static std::int64_t key(const Eigen::Array3i& place) {
    return (static_cast<std::int64_t>(place.x()) * kAcross + place.y()) * kAcross + place.z();
  }

  const Points& points_;
  Eigen::Array3d low_, high_;
  double side_ = 1.0;
  std::vector<std::pair<std::int64_t, int>> entries_;
};

}  // namespace sinew::lattice::detail
