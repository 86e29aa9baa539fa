#pragma once

#include <functional>
#include <string>
#include <vector>

#include "assets/glb_writer.h"

namespace sinew::samples {

/// One key of a curve.
struct CurveKey {
  double time;  ///< [s].
  double value;
};

/// Smooth curve through keys: piecewise cubic, monotone between keys, level at its extremes
/// (slopes after [Fritsch84]); the ends are held.
class Curve {
 public:
  Curve(std::vector<CurveKey> keys);  // NOLINT: a list of keys reads as a curve
  /// Sets the slope [1/s] at key `key`.
  Curve& with_slope(std::size_t key, double slope);
  double operator()(double time) const;

 private:
  std::vector<CurveKey> keys_;
  std::vector<double> slopes_;
};

/// A skeleton in the making: joints by name at rest positions [m], all with axes along the world's.
struct SampleJoint {
  std::string name;
  std::string parent;  ///< empty for a root; comes before this joint.
  Eigen::Vector3d position;
};

/// Joint angles at an instant: about x (pitch), y (yaw) and z (roll) of the parent [degrees], and an offset
/// [m].
struct JointPose {
  Eigen::Vector3d degrees{0, 0, 0};
  Eigen::Vector3d offset{0, 0, 0};
};

/// Fills the pose of every joint (in the order of the skeleton) at a time [s].
using Motion = std::function<void(double time, std::vector<JointPose>& pose)>;

/// Index of a joint. Throws std::out_of_range with its name.
int joint_index(const std::vector<SampleJoint>& joints, const std::string& name);

/// For every joint its partner on the other side: names ending in _l and _r are swapped.
std::vector<int> mirror_joints(const std::vector<SampleJoint>& joints);

/// Nodes and skin of the scene: node i is joint i.
void add_skeleton(const std::vector<SampleJoint>& joints, assets::GlbScene& scene);

/// Samples the motion at 60 keys a second; joints that stay at rest get no channel.
skeleton::Clip make_clip(const std::string& name, double duration, const std::vector<SampleJoint>& joints,
                         const Motion& motion);

}  // namespace sinew::samples
