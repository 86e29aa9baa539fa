#pragma once

#include <algorithm>
#include <vector>

#include <Eigen/Core>

namespace sinew::lattice::detail {

/// Points in a uniform grid, for visits by box.
class SampleGrid {
 public:
  SampleGrid(const std::vector<Eigen::Vector3d>& points, double side);

  /// Calls visit(point) for every point in the grid cells that the box touches until it returns false.
  /// Returns whether every call returned true.
  template <class Visit>
  bool all_of(const Eigen::Vector3d& low, const Eigen::Vector3d& high, const Visit& visit) const {
    const Eigen::Vector3i first = cell_of(low), last = cell_of(high);
    for (int i = first.x(); i <= last.x(); ++i)
      for (int j = first.y(); j <= last.y(); ++j)
        for (int k = first.z(); k <= last.z(); ++k) {
          const int cell = (i * count_.y() + j) * count_.z() + k;
          for (int n = offsets_[cell]; n < offsets_[cell + 1]; ++n)
            if (!visit(points_[n])) return false;
        }
    return true;
  }

 private:
  Eigen::Vector3i cell_of(const Eigen::Vector3d& p) const {
    const Eigen::Array3d scaled = ((p - low_) / side_).array().floor();
    return scaled.max(0.0).min((count_.array() - 1).cast<double>()).cast<int>();
  }

  Eigen::Vector3d low_;
  double side_;
  Eigen::Vector3i count_;
  std::vector<int> offsets_;
  std::vector<Eigen::Vector3d> points_;  ///< in grid order.
};

}  // namespace sinew::lattice::detail
