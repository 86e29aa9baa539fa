#pragma once

#include <array>
#include <functional>
#include <vector>

#include <Eigen/Core>

namespace sinew::lattice::detail {

using TriangleCorners = std::array<Eigen::Vector3d, 3>;

/// True where an edge of one triangle passes through the inside of the other, by more than `eps` on either
/// side of it and away from its border. Triangles that only touch, or lie in one plane, do not cross.
bool triangles_cross(const TriangleCorners& a, const TriangleCorners& b, double eps);

/// Triangles in a uniform grid, for questions about one more triangle. Not for several threads at once.
class TriangleGrid {
 public:
  TriangleGrid(std::vector<TriangleCorners> triangles, double side);

  /// True where some triangle crosses `t`.
  bool crosses(const TriangleCorners& t, double eps) const;

  /// Calls visit(index) for every triangle that crosses `t` until it returns false; whether it always
  /// returned true.
  bool for_each_crossing(const TriangleCorners& t, double eps, const std::function<bool(int)>& visit) const;

  /// Where the segment from p to q passes through triangles, as shares of its length in (0, 1), ascending;
  /// twice where it passes through the edge of two.
  std::vector<double> crossings(const Eigen::Vector3d& p, const Eigen::Vector3d& q) const;

 private:
  /// Calls visit(index) for every triangle whose box meets the box from low to high until it returns false.
  template <class Visit>
  bool visit_near(const Eigen::Vector3d& low, const Eigen::Vector3d& high, const Visit& visit) const;
  Eigen::Vector3i cell_of(const Eigen::Vector3d& p) const;

  std::vector<TriangleCorners> triangles_;
  Eigen::Vector3d low_{0, 0, 0};
  double side_;
  Eigen::Vector3i count_{1, 1, 1};
  std::vector<std::vector<int>> cells_;
  mutable std::vector<int> seen_;  ///< number of the question that looked at a triangle last.
  mutable int question_ = 0;
};

}  // namespace sinew::lattice::detail
