#include "lattice/build.h"

#include <limits>
#include <set>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/lattice/shapes.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

/// A limb along y from 0 to `length`, elliptic, with joints and smooth weights between them.
struct Limb {
  Surface skin;
  JointTree joints;
};

Limb arm() {
  Limb limb;
  limb.skin = tests::blob({0, 1, 0}, 40, 24, [](const Vector3d& d) {
    return 1.0 / std::sqrt(d.y() * d.y() + (d.x() * d.x() + d.z() * d.z()) / (0.2 * 0.2));  // an ellipsoid
  });
  limb.joints.positions.resize(3, 3);
  limb.joints.positions << 0, 0.1, 0, 0, 1, 0.02, 0, 1.85, 0;
  limb.joints.parents = {-1, 0, 1};
  limb.joints.names = {"upper", "lower", "end"};
  for (int v = 0; v < limb.skin.points.rows(); ++v) {
    const double w = std::clamp((limb.skin.points(v, 1) - 0.8) / 0.4, 0.0, 1.0);
    limb.skin.weights.push_back({{0, 1.0 - w}, {1, w}});
  }
  return limb;
}

/// Barycentric coordinates by a linear solve: independent of the containment test of the library.
bool is_in_some_cell(const CellComplex& complex, const Vector3d& p) {
  for (const Cell& cell : complex.cells) {
    Eigen::Matrix4d corners;
    for (int k = 0; k < 4; ++k) corners.col(k) << complex.points.row(cell.vertices[k]).transpose(), 1.0;
    const Eigen::Vector4d weights = corners.partialPivLu().solve(p.homogeneous());
    if (weights.minCoeff() > -1e-9) return true;
  }
  return false;
}

void expect_sound(const ControlLattice& lattice, const Limb& limb) {
  EXPECT_NO_THROW(validate(lattice));
  for (int v = 0; v < limb.skin.points.rows(); ++v)
    EXPECT_TRUE(is_in_some_cell(lattice.complex, limb.skin.points.row(v).transpose())) << "skin vertex " << v;
  for (const LatticeBone& bone : lattice.bones) {
    if (bone.soft) continue;
    EXPECT_EQ(Vector3d(lattice.complex.points.row(bone.chain.front()).transpose()), bone.rest_start)
        << bone.name;
    EXPECT_EQ(Vector3d(lattice.complex.points.row(bone.chain.back()).transpose()), bone.rest_end)
        << bone.name;
  }
}

TEST(Build, PutsBothBonesOfAnArmOnEdges) {
  const Limb limb = arm();
  const BuildResult result = build(limb.skin, limb.joints, {.cells = 300});
  EXPECT_THAT(result.failures, testing::IsEmpty());
  const ControlLattice& lattice = result.lattice;
  expect_sound(lattice, limb);
  EXPECT_NEAR(static_cast<double>(lattice.complex.cells.size()), 300.0, 60.0);
  ASSERT_EQ(lattice.bones.size(), 2u);
  EXPECT_EQ(lattice.bones[0].name, "upper");
  EXPECT_EQ(lattice.bones[0].rest_start, Vector3d(0, 0.1, 0));
  EXPECT_EQ(lattice.bones[0].rest_end, Vector3d(0, 1, 0.02));
  EXPECT_EQ(lattice.bones[0].frame, 0);
  EXPECT_EQ(lattice.bones[1].frame, 1);
  // "end" carries no skin, so the forearm ends in a tip bone of its own.
  EXPECT_TRUE(lattice.bones[1].tip);
  EXPECT_EQ(lattice.bones[1].start.joint_a, 1);
  EXPECT_EQ(lattice.bones[0].end.joint_a, 1);
  EXPECT_THAT(lattice.frame_of_joint, testing::ElementsAre(0, 1, 1));
}

TEST(Build, GivesTheSameBitsTwice) {
  const Limb limb = arm();
  const ControlLattice a = build(limb.skin, limb.joints, {.cells = 200}).lattice;
  const ControlLattice b = build(limb.skin, limb.joints, {.cells = 200}).lattice;
  EXPECT_EQ(a.complex.points, b.complex.points);
  ASSERT_EQ(a.complex.cells.size(), b.complex.cells.size());
  for (std::size_t c = 0; c < a.complex.cells.size(); ++c)
    EXPECT_EQ(a.complex.cells[c].vertices, b.complex.cells[c].vertices);
}

TEST(Build, RefusesWhatItCannotUse) {
  const auto message = [](const Limb& limb, const BuildOptions& options = {}) -> std::string {
    try {
      build(limb.skin, limb.joints, options);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  Limb limb = arm();
  limb.skin.triangles.resize(0, 3);
  EXPECT_EQ(message(limb), "lattice: the skin has no triangle");
  limb = arm();
  limb.joints = {};
  EXPECT_EQ(message(limb), "lattice: there is no joint");
  limb = arm();
  limb.skin.weights.clear();
  EXPECT_EQ(message(limb), "lattice: no skin vertex has a weight");
  limb = arm();
  limb.joints.positions(1, 2) = std::numeric_limits<double>::infinity();
  EXPECT_EQ(message(limb), "lattice: joint 'lower' has a position that is not finite");
  limb = arm();
  limb.joints.parents[1] = 2;
  EXPECT_EQ(message(limb), "lattice: joint 'lower' does not come after its parent");
  limb = arm();
  limb.skin.weights[5] = {{9, 1.0}};
  EXPECT_EQ(message(limb), "lattice: skin vertex 5 hangs on joint 9, which does not exist");
  EXPECT_EQ(message(arm(), {.cells = 3}), "cells: got 3, expected at least 20");
}

}  // namespace
}  // namespace sinew::lattice
