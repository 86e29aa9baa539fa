#include "fem/time/cuts.h"

#include <algorithm>

namespace sinew::fem {
namespace {

constexpr double kLeastWay = 0.25;      // sizes of the body
constexpr double kLeastFaster = 4.0;    // than before and after
constexpr double kLeastForce = 200.0;   // to start and stop on the way [m/s^2]
constexpr double kStillFrames = 0.1;    // share of the frames that may stay behind: a foot's target, a camera
constexpr double kTimeRounding = 1e-9;  // [s]; where steps and keys end together

/// Where the frames' origins stand.
std::vector<Eigen::Vector3d> origins_at(const FrameTree& tree, const Motion& motion, double time) {
  const std::vector<Eigen::Affine3d> pose = motion(time);
  std::vector<Eigen::Vector3d> origins;
  for (const Frame& frame : tree.frames)
    origins.push_back(pose[static_cast<std::size_t>(frame.joint)] * frame.origin_rest);
  return origins;
}

/// Ways of the frames between two such places, ascending [m].
std::vector<double> ways(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to) {
  std::vector<double> result;
  for (std::size_t f = 0; f < from.size(); ++f) result.push_back((to[f] - from[f]).norm());
  std::sort(result.begin(), result.end());
  return result;
}

double share_of(const std::vector<double>& ascending, double share) {
  return ascending[static_cast<std::size_t>(share * static_cast<double>(ascending.size()))];
}

double way_between(const FrameTree& tree, const Motion& motion, double begin, double end) {
  return share_of(ways(origins_at(tree, motion, begin), origins_at(tree, motion, end)), 0.5);
}

/// What the frames do from each key to the next.
struct Intervals {
  std::vector<double> keys;       ///< one more than intervals.
  std::vector<double> least_way;  ///< of nine frames in ten [m].
  std::vector<double> speed;      ///< of the frame in the middle of them all [m/s].
};

Intervals intervals_of(const FrameTree& tree, const Motion& motion, const std::vector<double>& keys) {
  Intervals intervals{keys, {}, {}};
  std::vector<Eigen::Vector3d> from = origins_at(tree, motion, keys.front());
  for (std::size_t k = 1; k < keys.size(); ++k) {
    std::vector<Eigen::Vector3d> to = origins_at(tree, motion, keys[k]);
    const std::vector<double> of_frames = ways(from, to);
    intervals.least_way.push_back(share_of(of_frames, kStillFrames));
    intervals.speed.push_back(share_of(of_frames, 0.5) / (keys[k] - keys[k - 1]));
    from = std::move(to);
  }
  return intervals;
}

/// Whether the body is put from one key to another. The way is that from key to key: a body that is put aside
/// for one frame and back goes it twice.
bool is_cut(const Intervals& in, std::size_t from, std::size_t to, double size) {
  const double time = in.keys[to] - in.keys[from];
  double way = 0.0;
  for (std::size_t k = from; k < to; ++k) way += in.least_way[k];
  if (way <= kLeastWay * size || 4.0 * way <= kLeastForce * time * time) return false;
  // A motion that is seen neither before nor after may be anything.
  const bool has_before = from > 0, has_after = to < in.speed.size();
  const double before = has_before ? in.speed[from - 1] : 0.0, after = has_after ? in.speed[to] : 0.0;
  return (has_before || has_after) && way > kLeastFaster * std::max(before, after) * time;
}

}  // namespace

std::vector<Cut> find_cuts(const FrameTree& tree, double size, const Motion& motion,
                           const std::vector<double>& keys) {
  std::vector<Cut> cuts;
  if (keys.size() < 2 || tree.frames.empty()) return cuts;
  const Intervals in = intervals_of(tree, motion, keys);
  const auto short_enough = [&](std::size_t from, std::size_t to) {
    return keys[to] - keys[from] <= kLongestCut + 1e-6;  // rounding of keys that are stored as floats
  };
  for (std::size_t from = 0; from + 1 < keys.size();) {
    std::size_t to = from + 1;
    while (to < keys.size() && short_enough(from, to) && !is_cut(in, from, to, size)) ++to;
    if (to == keys.size() || !short_enough(from, to)) {
      ++from;
      continue;
    }
    while (from + 1 < to && is_cut(in, from + 1, to, size)) ++from;
    cuts.push_back({keys[from], keys[to], way_between(tree, motion, keys[from], keys[to]), false});
    from = to;
  }
  return cuts;
}

Cut stated_cut(const FrameTree& tree, const Motion& motion, const std::vector<double>& keys, double begin,
               double end) {
  constexpr double kPart = 1e-6;  // [s]; rounding of keys that are stored as floats
  Cut cut{begin, end, 0.0, true};
  for (std::size_t k = 1; k < keys.size(); ++k) {
    const bool lies_in_it = keys[k - 1] < end - kPart && keys[k] > begin + kPart;
    if (!lies_in_it || keys[k] - keys[k - 1] > kLongestCut + kPart) continue;
    cut.begin = std::min(cut.begin, keys[k - 1]);
    cut.end = std::max(cut.end, keys[k]);
  }
  cut.way = way_between(tree, motion, cut.begin, cut.end);
  return cut;
}

bool touches_cut(const std::vector<Cut>& cuts, double begin, double end) {
  return std::any_of(cuts.begin(), cuts.end(), [&](const Cut& cut) {
    return begin < cut.end - kTimeRounding && end > cut.begin + kTimeRounding;
  });
}

}  // namespace sinew::fem
