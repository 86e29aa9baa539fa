#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "skeleton/skeleton.h"

namespace sinew::skeleton {

/// How values between keys are found; glTF's three.
enum class Interpolation { Step, Linear, CubicSpline };

/// Keys of one vector quantity. Before the first key and after the last the value is held.
struct VectorTrack {
  Interpolation interpolation = Interpolation::Linear;
  std::vector<double> times;                               ///< [s], strictly increasing, at least one.
  std::vector<Eigen::Vector3d> values;                     ///< one per key.
  std::vector<Eigen::Vector3d> in_tangents, out_tangents;  ///< CubicSpline only, one per key [unit/s].
};

/// Keys of a rotation: slerp between keys (shorter way), or glTF's cubic spline, normalised.
struct RotationTrack {
  Interpolation interpolation = Interpolation::Linear;
  std::vector<double> times;                               ///< [s], strictly increasing, at least one.
  std::vector<Eigen::Quaterniond> values;                  ///< unit; neighbours in one hemisphere.
  std::vector<Eigen::Vector4d> in_tangents, out_tangents;  ///< CubicSpline only (x, y, z, w) [1/s].
};

/// What a clip does to one joint; parts without a track keep the joint's own local value.
struct Channel {
  int joint = -1;
  std::optional<VectorTrack> translation;  ///< [m].
  std::optional<RotationTrack> rotation;
  std::optional<VectorTrack> scale;  ///< [-].
};

/// A named motion of a skeleton.
struct Clip {
  std::string name;
  double start = 0.0;             ///< earliest key [s].
  double end = 0.0;               ///< latest key [s].
  int num_keys = 0;               ///< distinct key times over all channels.
  std::vector<Channel> channels;  ///< at most one per joint.

  double duration() const { return end - start; }
};

/// The times between which all values of a clip move evenly [s], ascending and distinct: its keys, and just
/// before each but the first of a track of steps, which jumps there.
std::vector<double> key_times(const Clip& clip);

/// How far apart most keys of the clip are: the median over all tracks [s]; 0 where none has two.
double key_interval(const Clip& clip);

Eigen::Vector3d sample(const VectorTrack& track, double time);
Eigen::Quaterniond sample(const RotationTrack& track, double time);

/// Pose of the skeleton at `time` [s]; any time, the ends are held. World transforms [m].
Pose sample(const Skeleton& skeleton, const Clip& clip, double time);

}  // namespace sinew::skeleton
