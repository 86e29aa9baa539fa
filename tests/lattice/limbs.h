#pragma once

#include <cmath>
#include <random>
#include <string>

#include <Eigen/Geometry>

#include "tests/lattice/shapes.h"

/// Characters made of capsules, one round every bone: closed, and crossing each other at the joints.
namespace sinew::tests {

struct Character {
  lattice::Surface skin;
  lattice::JointTree joints;

  int add_joint(const std::string& name, int parent, const Eigen::Vector3d& position) {
    const Eigen::Index n = joints.positions.rows();
    joints.positions.conservativeResize(n + 1, 3);
    joints.positions.row(n) = position.transpose();
    joints.parents.push_back(parent);
    joints.names.push_back(name);
    return static_cast<int>(n);
  }

  /// A capsule of `radius` from a to b that hangs on one joint.
  void add_capsule(int joint, const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius) {
    lattice::Surface part =
        blob(Eigen::Vector3d::Zero(), 12, 10, [&](const Eigen::Vector3d&) { return radius; });
    const double length = (b - a).norm();
    const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitY(), b - a);
    const Eigen::Index first = skin.points.rows();
    for (Eigen::Index v = 0; v < part.points.rows(); ++v) {
      Eigen::Vector3d p = part.points.row(v).transpose();
      if (p.y() > 0.0) p.y() += length;
      part.points.row(v) = (a + turn * p).transpose();
      skin.weights.push_back({{joint, 1.0}});
    }
    skin.points.conservativeResize(first + part.points.rows(), 3);
    skin.points.bottomRows(part.points.rows()) = part.points;
    const Eigen::Index t = skin.triangles.rows();
    skin.triangles.conservativeResize(t + part.triangles.rows(), 3);
    skin.triangles.bottomRows(part.triangles.rows()) = part.triangles.array() + static_cast<int>(first);
  }
};

/// A tree of 3 to 10 bones in random directions, with random radii; some joints carry no skin, some sit
/// outside.
inline Character random_character(std::mt19937_64& rng) {
  Character c;
  c.add_joint("root", -1, {0, 0, 0});
  const int bones = 3 + static_cast<int>(rng() % 8);
  for (int i = 0; i < bones; ++i) {
    const int parent = static_cast<int>(rng() % c.joints.parents.size());
    const Eigen::Vector3d from = c.joints.positions.row(parent).transpose();
    const Eigen::Vector3d to = from + uniform(rng, 0.15, 0.7) * uniform_point(rng, -1, 1).normalized();
    c.add_joint("joint_" + std::to_string(i), parent, to);
    if (rng() % 6 != 0) c.add_capsule(parent, from, to, uniform(rng, 0.06, 0.2));
  }
  c.add_capsule(0, {0, 0, 0}, {0, 0.1, 0}, 0.15);  // so that there is always some skin
  return c;
}

/// A pelvis with two legs side by side, a narrow gap between them.
inline Character two_legs() {
  Character c;
  const int pelvis = c.add_joint("pelvis", -1, {0, 2, 0});
  for (const double side : {-1.0, 1.0}) {
    const std::string name = side < 0 ? "left" : "right";
    const int hip = c.add_joint(name + "_hip", pelvis, {0.16 * side, 1.9, 0});
    const int knee = c.add_joint(name + "_knee", hip, {0.16 * side, 1.0, 0});
    const int ankle = c.add_joint(name + "_ankle", knee, {0.16 * side, 0.1, 0});
    c.add_capsule(pelvis, {0, 2, 0}, {0.16 * side, 1.9, 0}, 0.13);
    c.add_capsule(hip, {0.16 * side, 1.9, 0}, {0.16 * side, 1.0, 0}, 0.1);
    c.add_capsule(knee, {0.16 * side, 1.0, 0}, {0.16 * side, 0.1, 0}, 0.1);
    c.add_capsule(ankle, {0.16 * side, 0.1, 0}, {0.16 * side, 0.1, 0.1}, 0.08);
  }
  return c;
}

}  // namespace sinew::tests
