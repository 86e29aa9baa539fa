#include "lattice/detail/joint_weights.h"

#include <algorithm>

namespace sinew::lattice::detail {
namespace {

/// Breadth-first nearest descendant that is a frame, or -1.
int nearest_descendant(int joint, const std::vector<std::vector<int>>& children,
                       const std::vector<bool>& is_frame) {
  std::vector<int> queue{joint};
  for (std::size_t i = 0; i < queue.size(); ++i) {
    if (is_frame[queue[i]]) return queue[i];
    queue.insert(queue.end(), children[queue[i]].begin(), children[queue[i]].end());
  }
  return -1;
}

}  // namespace

JointWeights joint_weights(const UnitSkin& skin, const JointTree& joints, const std::vector<int>& stand_in) {
  const int n = static_cast<int>(joints.parents.size());
  JointWeights result{std::vector<double>(n, 0.0),
                      {},
                      std::vector<std::vector<std::pair<int, double>>>(n),
                      std::vector<bool>(n, false)};
  for (std::size_t v = 0; v < skin.weights.size(); ++v)
    for (const Influence& influence : skin.weights[v]) {
      if (!(influence.weight > 0.0)) continue;
      const int joint = stand_in[influence.frame];
      result.area[joint] += influence.weight * skin.areas[v];
      result.vertices[joint].emplace_back(static_cast<int>(v), influence.weight);
    }
  result.subtree_area = result.area;
  for (int j = n - 1; j >= 0; --j)
    if (joints.parents[j] >= 0) result.subtree_area[joints.parents[j]] += result.subtree_area[j];
  return result;
}

std::vector<int> frame_of_joint(const std::vector<int>& parents, const std::vector<int>& frames) {
  const int n = static_cast<int>(parents.size());
  std::vector<int> result(n, -1);
  if (frames.empty()) return result;
  std::vector<bool> is_frame(n, false);
  for (int f : frames) is_frame[f] = true;
  std::vector<std::vector<int>> children(n);
  for (int j = 0; j < n; ++j)
    if (parents[j] >= 0) children[parents[j]].push_back(j);
  for (int j = 0; j < n; ++j) {
    int found = j;
    while (found >= 0 && !is_frame[found]) found = parents[found];
    if (found < 0) found = nearest_descendant(j, children, is_frame);
    result[j] = found >= 0 ? found : *std::min_element(frames.begin(), frames.end());
  }
  return result;
}

}  // namespace sinew::lattice::detail
