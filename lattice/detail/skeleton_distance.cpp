#include "lattice/detail/skeleton_distance.h"

#include <algorithm>
#include <limits>

namespace sinew::lattice::detail {

SkeletonDistance::SkeletonDistance(const ReducedSkeleton& skeleton) {
  const std::size_t n = skeleton.nodes.size();
  struct Step {
    int to;
    double length;
  };
  std::vector<std::vector<Step>> steps(n);
  for (const ReducedBone& bone : skeleton.bones) {
    const double length = (skeleton.nodes[bone.end].position - skeleton.nodes[bone.start].position).norm();
    bones_.push_back({bone.start, bone.end, length});
    steps[bone.start].push_back({bone.end, length});
    steps[bone.end].push_back({bone.start, length});
  }
  // The skeleton is a forest: one walk from every node.
  node_distance_.assign(n, std::vector<double>(n, std::numeric_limits<double>::infinity()));
  for (std::size_t from = 0; from < n; ++from) {
    std::vector<double>& distance = node_distance_[from];
    std::vector<int> open{static_cast<int>(from)};
    distance[from] = 0.0;
    for (std::size_t i = 0; i < open.size(); ++i)
      for (const Step& step : steps[open[i]]) {
        if (distance[step.to] <= distance[open[i]] + step.length) continue;
        distance[step.to] = distance[open[i]] + step.length;
        open.push_back(step.to);
      }
  }
}

double SkeletonDistance::between(const BoneStretch& a, const BoneStretch& b) const {
  const Bone &from = bones_[a.bone], &to = bones_[b.bone];
  if (a.bone == b.bone) return std::max({0.0, b.low - a.high, a.low - b.high}) * from.length;
  const double a_start = a.low * from.length, a_end = (1.0 - a.high) * from.length;
  const double b_start = b.low * to.length, b_end = (1.0 - b.high) * to.length;
  return std::min({a_start + node_distance_[from.start][to.start] + b_start,
                   a_start + node_distance_[from.start][to.end] + b_end,
                   a_end + node_distance_[from.end][to.start] + b_start,
                   a_end + node_distance_[from.end][to.end] + b_end});
}

}  // namespace sinew::lattice::detail
