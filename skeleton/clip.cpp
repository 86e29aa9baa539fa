#include "skeleton/clip.h"

#include <algorithm>
#include <cstddef>
#include <stdexcept>

namespace sinew::skeleton {

namespace {

/// Where a time falls among the keys: between `key` and key + 1 at fraction u in [0, 1), or exactly on `key`
/// (u = 0) where there is nothing to interpolate.
struct Place {
  std::size_t key = 0;
  double u = 0.0;
  double span = 0.0;  ///< [s] between the two keys; 0 where the value is held.
};

Place find_place(const std::vector<double>& times, double time) {
  if (times.empty()) throw std::invalid_argument("sample: track without keys");
  // Written so that a NaN time holds the first key instead of indexing past the end.
  if (!(time > times.front())) return {};
  if (time >= times.back()) return {times.size() - 1, 0.0, 0.0};
  const auto after = std::upper_bound(times.begin(), times.end(), time);
  const auto key = static_cast<std::size_t>(after - times.begin()) - 1;
  const double span = times[key + 1] - times[key];
  return {key, (time - times[key]) / span, span};
}

/// glTF 2.0, appendix C.4: Hermite polynomial with tangents per second.
template <typename V>
V hermite(const V& p0, const V& m0, const V& p1, const V& m1, double u, double span) {
  const double u2 = u * u;
  const double u3 = u2 * u;
  return (2 * u3 - 3 * u2 + 1) * p0 + span * (u3 - 2 * u2 + u) * m0 + (3 * u2 - 2 * u3) * p1 +
         span * (u3 - u2) * m1;
}

}  // namespace

Eigen::Vector3d sample(const VectorTrack& track, double time) {
  const Place at = find_place(track.times, time);
  const Eigen::Vector3d& begin = track.values[at.key];
  if (at.span == 0.0 || track.interpolation == Interpolation::Step) return begin;
  const Eigen::Vector3d& end = track.values[at.key + 1];
  if (track.interpolation == Interpolation::Linear) return (1.0 - at.u) * begin + at.u * end;
  return hermite<Eigen::Vector3d>(begin, track.out_tangents[at.key], end, track.in_tangents[at.key + 1], at.u,
                                  at.span);
}

Eigen::Quaterniond sample(const RotationTrack& track, double time) {
  const Place at = find_place(track.times, time);
  const Eigen::Quaterniond& begin = track.values[at.key];
  if (at.span == 0.0 || track.interpolation == Interpolation::Step) return begin;
  const Eigen::Quaterniond& end = track.values[at.key + 1];
  if (track.interpolation == Interpolation::Linear) return begin.slerp(at.u, end).normalized();
  const Eigen::Vector4d q = hermite<Eigen::Vector4d>(begin.coeffs(), track.out_tangents[at.key], end.coeffs(),
                                                     track.in_tangents[at.key + 1], at.u, at.span);
  // A spline that passes through zero has no direction; hold the earlier key there.
  if (!(q.norm() > 1e-9)) return begin;
  return Eigen::Quaterniond(q.normalized());
}

namespace {

template <typename Visitor>
void visit_tracks(const Clip& clip, const Visitor& visit) {
  for (const Channel& channel : clip.channels) {
    if (channel.translation) visit(channel.translation->times, channel.translation->interpolation);
    if (channel.rotation) visit(channel.rotation->times, channel.rotation->interpolation);
    if (channel.scale) visit(channel.scale->times, channel.scale->interpolation);
  }
}

}  // namespace

std::vector<double> key_times(const Clip& clip) {
  constexpr double kJustBefore = 1e-6;  // s; shorter than anything that steps or looks
  std::vector<double> times;
  visit_tracks(clip, [&](const std::vector<double>& keys, Interpolation interpolation) {
    for (std::size_t k = 0; k < keys.size(); ++k) {
      times.push_back(keys[k]);
      if (k > 0 && interpolation == Interpolation::Step)
        times.push_back(std::max(keys[k - 1], keys[k] - kJustBefore));
    }
  });
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

double key_interval(const Clip& clip) {
  std::vector<double> intervals;
  visit_tracks(clip, [&](const std::vector<double>& keys, Interpolation) {
    for (std::size_t k = 1; k < keys.size(); ++k) intervals.push_back(keys[k] - keys[k - 1]);
  });
  if (intervals.empty()) return 0.0;
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  return *middle;
}

Pose sample(const Skeleton& skeleton, const Clip& clip, double time) {
  std::vector<Eigen::Affine3d> local;
  local.reserve(skeleton.joints().size());
  for (const Joint& joint : skeleton.joints()) local.push_back(joint.parent_from_joint);
  for (const Channel& channel : clip.channels) {
    if (channel.joint < 0 || channel.joint >= skeleton.num_joints()) {
      throw std::invalid_argument("clip '" + clip.name + "': channel for joint " +
                                  std::to_string(channel.joint) + " of " +
                                  std::to_string(skeleton.num_joints()));
    }
    if (!channel.translation && !channel.rotation && !channel.scale) continue;
    LocalTransform parts = skeleton.joint(channel.joint).local;
    if (channel.translation) parts.translation = sample(*channel.translation, time);
    if (channel.rotation) parts.rotation = sample(*channel.rotation, time);
    if (channel.scale) parts.scale = sample(*channel.scale, time);
    local[static_cast<std::size_t>(channel.joint)] = parts.matrix();
  }
  return pose_from_local(skeleton, local);
}

}  // namespace sinew::skeleton
