#include "assets/collapse.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "assets/detail/text.h"

namespace sinew::assets {

namespace {

/// Scaled to a ten-thousandth in all directions, a person is thinner than a hair.
constexpr double kNoVolume = 1e-12;
/// Between keys a spline may dip: it is looked at this often [s].
constexpr double kSpacing = 1.0 / 240.0;
/// No longer than that: an hour shows what a clip does.
constexpr double kLongest = 3600.0;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// Whether a track leaves the side of 0 on which the joint stands at rest, or may do so between keys.
bool is_suspect(const skeleton::VectorTrack& track, const Eigen::Vector3d& rest) {
  if (track.interpolation == skeleton::Interpolation::CubicSpline) return true;
  return std::any_of(track.values.begin(), track.values.end(), [&](const Eigen::Vector3d& value) {
    return (value.array() * rest.array().sign() < 1e-3 * rest.array().abs()).any();
  });
}

/// Joints that carry flesh, or above such ones.
std::vector<bool> bearing_joints(const Rig& rig) {
  std::vector<bool> bears(at(rig.skeleton.num_joints()), false);
  for (const Part& part : rig.parts) {
    if (part.role != PartRole::Simulated) continue;
    for (const auto& influences : part.weights) {
      for (const lattice::Influence& influence : influences) bears[at(influence.frame)] = true;
    }
  }
  for (std::size_t j = bears.size(); j-- > 0;) {
    const int parent = rig.skeleton.joint(static_cast<int>(j)).parent;
    if (bears[j] && parent >= 0) bears[at(parent)] = true;
  }
  return bears;
}

}  // namespace

std::optional<Collapse> first_collapse(const Rig& rig, const skeleton::Clip& clip, double begin, double end) {
  std::set<double> times{begin, end};
  bool suspect = false;
  for (const skeleton::Channel& channel : clip.channels) {
    if (!channel.scale || !is_suspect(*channel.scale, rig.skeleton.joint(channel.joint).local.scale))
      continue;
    suspect = true;
    for (const double time : channel.scale->times) {
      if (time > begin && time < end) times.insert(time);
    }
  }
  if (!suspect) return std::nullopt;
  const double last = std::min(end, begin + kLongest);
  for (int k = 1; begin + k * kSpacing < last; ++k) times.insert(begin + k * kSpacing);

  const std::vector<bool> bears = bearing_joints(rig);
  const auto collapsed_at = [&](double time) {
    const auto maps = skeleton::pose_from_rest(rig.skeleton, skeleton::sample(rig.skeleton, clip, time));
    for (std::size_t j = 0; j < maps.size(); ++j) {
      if (bears[j] && !(maps[j].linear().determinant() > kNoVolume)) return static_cast<int>(j);
    }
    return -1;
  };
  double good = begin;
  for (const double time : times) {
    if (collapsed_at(time) < 0) {
      good = time;
      continue;
    }
    double bad = time;
    while (bad - good > 1e-6) {
      const double middle = 0.5 * (good + bad);
      (collapsed_at(middle) < 0 ? good : bad) = middle;
    }
    return Collapse{bad, collapsed_at(bad)};
  }
  return std::nullopt;
}

std::string collapse_text(const Rig& rig, const Collapse& collapse) {
  return "joint '" + rig.skeleton.joint(collapse.joint).name + "' is scaled to nothing at " +
         detail::number(collapse.time) + " s";
}

}  // namespace sinew::assets
