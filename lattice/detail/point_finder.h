#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

#include "lattice/points.h"

namespace sinew::lattice::detail {

/// Points by their position along a direction in which no two points of a grid coincide.
class PointFinder {
 public:
  /// `points` must outlive the finder.
  explicit PointFinder(const Points& points)
      : points_(points), order_(static_cast<std::size_t>(points.rows())) {
    std::iota(order_.begin(), order_.end(), 0);
    for (Eigen::Index i = 0; i < points.rows(); ++i) key_.push_back(points.row(i).dot(direction()));
    std::sort(order_.begin(), order_.end(), [&](int a, int b) {
      const double x = key_[static_cast<std::size_t>(a)], y = key_[static_cast<std::size_t>(b)];
      return x != y ? x < y : a < b;
    });
  }

  /// Whether accept(row) holds for one of the points within `tolerance` of p.
  template <class Accept>
  bool any_near(const Eigen::Vector3d& p, double tolerance, const Accept& accept) const {
    const double key = p.dot(direction().transpose());
    const auto key_of = [&](int i) { return key_[static_cast<std::size_t>(i)]; };
    for (auto it = std::lower_bound(order_.begin(), order_.end(), key - tolerance,
                                    [&](int i, double k) { return key_of(i) < k; });
         it != order_.end() && key_of(*it) <= key + tolerance; ++it)
      if ((points_.row(*it).transpose() - p).norm() <= tolerance && accept(*it)) return true;
    return false;
  }
  bool has_near(const Eigen::Vector3d& p, double tolerance) const {
    return any_near(p, tolerance, [](int) { return true; });
  }
  /// The smallest row of a point within `tolerance` of p; -1 where there is none.
  int first_near(const Eigen::Vector3d& p, double tolerance) const {
    int first = -1;
    any_near(p, tolerance, [&](int i) {
      if (first < 0 || i < first) first = i;
      return false;
    });
    return first;
  }

 private:
  static Eigen::RowVector3d direction() { return Eigen::RowVector3d(0.53, 0.73, 0.43).normalized(); }

  const Points& points_;
  std::vector<int> order_;
  std::vector<double> key_;
};

}  // namespace sinew::lattice::detail
