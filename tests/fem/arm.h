#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "fem/body/body.h"
#include "fem/time/simulation.h"
#include "lattice/box.h"

/// An arm of two hard bones along x in a box of flesh, 1 x 0.2 x 0.2 m: the smallest body with an elbow.
namespace sinew::tests {

/// The boundary of a box cut into squares of `edge`, outward triangles.
inline lattice::Surface box_skin(const Eigen::Vector3d& low, const Eigen::Vector3d& high, double edge) {
  const Eigen::Vector3i blocks = ((high - low) / edge).array().round().cast<int>().max(1);
  const lattice::CellComplex cells =
      lattice::box_lattice({low, high, blocks, lattice::CellType::Hexahedron, {}});
  std::map<std::vector<int>, std::vector<std::array<int, 4>>> owners;
  for (const lattice::Cell& cell : cells.cells) {
    for (std::array<int, 4> face : lattice::cell_faces(cell.type)) {
      for (int& k : face) k = cell.vertices[static_cast<std::size_t>(k)];
      std::vector<int> key(face.begin(), face.end());
      std::sort(key.begin(), key.end());
      owners[key].push_back(face);
    }
  }
  lattice::Surface skin;
  std::vector<int> index(static_cast<std::size_t>(cells.points.rows()), -1);
  std::vector<Eigen::RowVector3d> points;
  std::vector<Eigen::RowVector3i> triangles;
  for (const auto& [key, faces] : owners) {
    if (faces.size() > 1) continue;
    std::array<int, 4> q = faces[0];
    for (int& v : q) {
      int& i = index[static_cast<std::size_t>(v)];
      if (i < 0) {
        i = static_cast<int>(points.size());
        points.push_back(cells.points.row(v));
      }
      v = i;
    }
    triangles.emplace_back(q[0], q[1], q[2]);
    triangles.emplace_back(q[0], q[2], q[3]);
  }
  skin.points.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) skin.points.row(static_cast<Eigen::Index>(i)) = points[i];
  skin.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i)
    skin.triangles.row(static_cast<Eigen::Index>(i)) = triangles[i];
  return skin;
}

/// Joints "shoulder" at the origin, "elbow" at x = 0.5 and "wrist" at x = 1; bones "upper" and "lower".
struct Arm {
  skeleton::Skeleton skeleton;
  lattice::ControlLattice lattice;
  lattice::Surface skin;
};

/// `margin`: layers round the flesh, as thick as half of it, that hold none of it; `per_bone`: cells along
/// each bone; `through`: across the flesh, an even number as the bones are in the middle.
inline Arm make_arm(lattice::CellType type = lattice::CellType::Hexahedron, int margin = 0, int per_bone = 5,
                    int through = 2) {
  Arm arm;
  std::vector<skeleton::Joint> joints(3);
  const std::array<const char*, 3> names{"shoulder", "elbow", "wrist"};
  for (int j = 0; j < 3; ++j) {
    auto& joint = joints[static_cast<std::size_t>(j)];
    joint.name = names[static_cast<std::size_t>(j)];
    joint.parent = j - 1;
    joint.rest_from_joint.translation() = Eigen::Vector3d(0.5 * j, 0.0, 0.0);
    joint.parent_from_joint.translation() = Eigen::Vector3d(j > 0 ? 0.5 : 0.0, 0.0, 0.0);
    joint.local.translation = joint.parent_from_joint.translation();
  }
  arm.skeleton = skeleton::Skeleton(joints);

  // As many cells along the bones as wanted and one more at each end; y and z are cut at the bones.
  const double edge = 0.5 / per_bone;
  const double half = 0.12 * (1 + margin);
  const int across = through * (1 + margin);
  const lattice::BoxOptions box{
      {-edge, -half, -half}, {1.0 + edge, half, half}, {2 * per_bone + 2, across, across}, type, {}};
  arm.lattice.complex = lattice::box_lattice(box);
  arm.lattice.edge_length = std::max(0.24 / through, edge);
  arm.lattice.frame_of_joint = {0, 1, 1};
  const auto vertex = [&](int i) { return i + (2 * per_bone + 3) * (across / 2) * (across + 2); };
  for (int b = 0; b < 2; ++b) {
    lattice::LatticeBone bone;
    bone.name = b == 0 ? "upper" : "lower";
    bone.frame = b;
    bone.rest_start = {0.5 * b, 0.0, 0.0};
    bone.rest_end = {0.5 * (b + 1), 0.0, 0.0};
    bone.start = {b, b + 1, bone.rest_start, bone.rest_end};
    bone.end = bone.start;
    for (int i = 0; i <= per_bone; ++i) bone.chain.push_back(vertex(1 + per_bone * b + i));
    arm.lattice.bones.push_back(bone);
  }
  lattice::validate(arm.lattice);

  arm.skin = box_skin({0.0, -0.1, -0.1}, {1.0, 0.1, 0.1}, 0.05);
  for (Eigen::Index k = 0; k < arm.skin.points.rows(); ++k) {
    const double lower = std::clamp((arm.skin.points(k, 0) - 0.4) / 0.2, 0.0, 1.0);
    arm.skin.weights.push_back({{0, 1.0 - lower}, {1, lower}});
  }
  return arm;
}

/// pose_from_rest of the arm's joints: the elbow bent by `angle` about z, the forearm twisted by `twist`
/// about its bone, everything moved by `base`.
inline std::vector<Eigen::Affine3d> arm_pose(double angle,
                                             const Eigen::Affine3d& base = Eigen::Affine3d::Identity(),
                                             double twist = 0.0) {
  const Eigen::Vector3d elbow(0.5, 0.0, 0.0);
  const Eigen::Affine3d bent =
      base * Eigen::Translation3d(elbow) * Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()) *
      Eigen::AngleAxisd(twist, Eigen::Vector3d::UnitX()) * Eigen::Translation3d(-elbow);
  return {base, bent, bent};
}

/// A body of firm flesh (E = 5e4 Pa, nu = 0.45) whose regions are those of an elbow that bends by
/// `largest_bend`.
inline fem::Body arm_body(const Arm& arm, double largest_bend, fem::BodyOptions options = {}) {
  options.material.young = 5e4;
  const std::vector<std::vector<Eigen::Affine3d>> poses{arm_pose(0.0), arm_pose(largest_bend)};
  return fem::make_body({arm.lattice, arm.skin, arm.skeleton, poses}, options);
}

inline constexpr double kDegree = M_PI / 180.0;

/// 0 before 0, 1 after 1, smooth to the second derivative between.
inline double smooth_step(double t) {
  const double s = std::clamp(t, 0.0, 1.0);
  return s * s * s * (10.0 + s * (6.0 * s - 15.0));
}

}  // namespace sinew::tests
