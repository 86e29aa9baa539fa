#pragma once

#include <Eigen/Core>

namespace sinew::lattice::detail {

/// Distance between a point and a segment, and between two segments.
double point_segment_distance(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b);
double segment_segment_distance(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                                const Eigen::Vector3d& d);

}  // namespace sinew::lattice::detail
