#include "lattice/detail/sample_grid.h"

namespace sinew::lattice::detail {

using Eigen::Vector3d;

SampleGrid::SampleGrid(const std::vector<Vector3d>& points, double side)
    : low_(Vector3d::Zero()), side_(side), count_(Eigen::Vector3i::Ones()) {
  if (!points.empty()) {
    Vector3d high = points[0];
    low_ = points[0];
    for (const Vector3d& p : points) {
      low_ = low_.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    count_ = ((high - low_) / side).array().floor().cast<int>() + 1;
  }
  offsets_.assign(static_cast<std::size_t>(count_.prod()) + 1, 0);
  std::vector<int> cell_of_point;
  for (const Vector3d& p : points) {
    const Eigen::Vector3i c = cell_of(p);
    cell_of_point.push_back((c.x() * count_.y() + c.y()) * count_.z() + c.z());
    ++offsets_[cell_of_point.back() + 1];
  }
  for (std::size_t i = 1; i < offsets_.size(); ++i) offsets_[i] += offsets_[i - 1];
  points_.resize(points.size());
  std::vector<int> next(offsets_.begin(), offsets_.end() - 1);
  for (std::size_t i = 0; i < points.size(); ++i) points_[next[cell_of_point[i]]++] = points[i];
}

}  // namespace sinew::lattice::detail
