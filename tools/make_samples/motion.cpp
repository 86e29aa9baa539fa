#include "tools/make_samples/motion.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "tools/make_samples/exact_math.h"

namespace sinew::samples {
namespace {

constexpr double kKeysPerSecond = 60.0;

/// Slope at a key between secants d0 (length h0) and d1 (length h1): weighted harmonic mean, 0 at an extreme.
double monotone_slope(double h0, double d0, double h1, double d1) {
  if (d0 * d1 <= 0.0) return 0.0;
  const double w0 = 2.0 * h1 + h0, w1 = h1 + 2.0 * h0;
  return (w0 + w1) / (w0 / d0 + w1 / d1);
}

}  // namespace

Curve::Curve(std::vector<CurveKey> keys) : keys_(std::move(keys)), slopes_(keys_.size(), 0.0) {
  for (std::size_t k = 1; k + 1 < keys_.size(); ++k) {
    const double h0 = keys_[k].time - keys_[k - 1].time, h1 = keys_[k + 1].time - keys_[k].time;
    slopes_[k] = monotone_slope(h0, (keys_[k].value - keys_[k - 1].value) / h0, h1,
                                (keys_[k + 1].value - keys_[k].value) / h1);
  }
}

Curve& Curve::with_slope(std::size_t key, double slope) {
  slopes_.at(key) = slope;
  return *this;
}

double Curve::operator()(double time) const {
  if (time <= keys_.front().time) return keys_.front().value;
  if (time >= keys_.back().time) return keys_.back().value;
  std::size_t k = 0;
  while (time >= keys_[k + 1].time) ++k;
  const double h = keys_[k + 1].time - keys_[k].time, s = (time - keys_[k].time) / h;
  const double rise = keys_[k + 1].value - keys_[k].value;
  const double a = h * slopes_[k], b = h * slopes_[k + 1];
  return keys_[k].value + s * (a + s * (3.0 * rise - 2.0 * a - b + s * (a + b - 2.0 * rise)));
}

int joint_index(const std::vector<SampleJoint>& joints, const std::string& name) {
  for (std::size_t j = 0; j < joints.size(); ++j)
    if (joints[j].name == name) return static_cast<int>(j);
  throw std::out_of_range("no joint '" + name + "'");
}

std::vector<int> mirror_joints(const std::vector<SampleJoint>& joints) {
  std::vector<int> mirror;
  for (const SampleJoint& joint : joints) {
    std::string name = joint.name;
    const std::string side = name.size() > 2 ? name.substr(name.size() - 2) : "";
    if (side == "_l") name.back() = 'r';
    if (side == "_r") name.back() = 'l';
    mirror.push_back(joint_index(joints, name));
  }
  return mirror;
}

void add_skeleton(const std::vector<SampleJoint>& joints, assets::GlbScene& scene) {
  for (std::size_t j = 0; j < joints.size(); ++j) {
    assets::GlbNode node;
    node.name = joints[j].name;
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();
    if (!joints[j].parent.empty()) {
      node.parent = joint_index(joints, joints[j].parent);
      origin = joints[static_cast<std::size_t>(node.parent)].position;
    }
    node.local.translation = to_grid(Eigen::Vector3d(joints[j].position - origin));
    scene.nodes.push_back(node);
    scene.joints.push_back(static_cast<int>(j));
    scene.joint_from_rest.push_back(
        Eigen::Affine3d(Eigen::Translation3d(Eigen::Vector3d(-joints[j].position))));
  }
}

skeleton::Clip make_clip(const std::string& name, double duration, const std::vector<SampleJoint>& joints,
                         const Motion& motion) {
  const int num_keys = static_cast<int>(std::floor(duration * kKeysPerSecond + 0.5)) + 1;
  std::vector<double> times;
  std::vector<std::vector<JointPose>> poses;
  for (int k = 0; k < num_keys; ++k) {
    times.push_back(k / kKeysPerSecond);
    poses.emplace_back(joints.size());
    motion(times.back(), poses.back());
  }
  skeleton::Clip clip{name, 0.0, times.back(), num_keys, {}};
  for (std::size_t j = 0; j < joints.size(); ++j) {
    skeleton::VectorTrack translation{skeleton::Interpolation::Linear, times, {}, {}, {}};
    skeleton::RotationTrack turn{skeleton::Interpolation::Linear, times, {}, {}, {}};
    bool moves = false, turns = false;
    const Eigen::Vector3d origin =
        joints[j].parent.empty()
            ? Eigen::Vector3d(Eigen::Vector3d::Zero())
            : joints[static_cast<std::size_t>(joint_index(joints, joints[j].parent))].position;
    for (const auto& pose : poses) {
      const JointPose& p = pose[j];
      moves = moves || !p.offset.isZero(0.0);
      turns = turns || !p.degrees.isZero(0.0);
      translation.values.push_back(to_grid(Eigen::Vector3d(joints[j].position - origin + p.offset)));
      const Eigen::Quaterniond q = rotation(p.degrees.y(), Eigen::Vector3d::UnitY()) *
                                   rotation(p.degrees.x(), Eigen::Vector3d::UnitX()) *
                                   rotation(p.degrees.z(), Eigen::Vector3d::UnitZ());
      turn.values.push_back(q);
    }
    if (!moves && !turns) continue;
    skeleton::Channel channel;
    channel.joint = static_cast<int>(j);
    if (moves) channel.translation = translation;
    if (turns) channel.rotation = turn;
    clip.channels.push_back(channel);
  }
  return clip;
}

}  // namespace sinew::samples
