#include "assets/islands.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "assets/riding.h"
#include "tests/lattice/shapes.h"

namespace sinew::assets {
namespace {

using Eigen::Vector3d;
using lattice::Points;
using testing::HasSubstr;

skeleton::Joint joint(const std::string& name, int parent, const Vector3d& rest) {
  skeleton::Joint j;
  j.name = name;
  j.parent = parent;
  j.rest_from_joint.translation() = rest;
  return j;
}

/// A ball stretched to half axes, on one joint.
Part ball(const std::string& name, const Vector3d& centre, const Vector3d& half, int joint, int rings = 12) {
  const lattice::Surface unit =
      tests::blob(Vector3d::Zero(), rings, 2 * rings, [](const Vector3d&) { return 1.0; });
  Part part;
  part.name = name;
  part.role = PartRole::Simulated;
  part.points = (unit.points * half.asDiagonal()).rowwise() + centre.transpose();
  part.triangles = unit.triangles;
  part.weights.assign(static_cast<std::size_t>(part.points.rows()), {{joint, 1.0}});
  return part;
}

/// A trunk that bends in its middle, a head of its own on top, and one eye half inside the head's front. Feet
/// of the trunk at the origin, 1.8 m tall.
Rig doll() {
  Rig rig;
  rig.file = "doll.glb";
  rig.skeleton = skeleton::Skeleton({joint("hips", -1, {0, 0.2, 0}), joint("chest", 0, {0, 0.7, 0}),
                                     joint("head", 1, {0, 1.4, 0}), joint("hand", 1, {0.6, 1.1, 0}),
                                     joint("sword", 3, {0.7, 1.1, 0})});
  Part trunk = ball("trunk", {0, 0.7, 0}, {0.25, 0.75, 0.2}, 0);
  for (Eigen::Index v = 0; v < trunk.points.rows(); ++v) {
    const double up = std::clamp(trunk.points(v, 1) / 1.4, 0.0, 1.0);
    trunk.weights[static_cast<std::size_t>(v)] = {{0, 1.0 - up}, {1, up}};
  }
  // An arm that bends from the chest to the hand, and holds the hand's joint.
  Part arm = ball("arm", {0.4, 1.1, 0}, {0.35, 0.06, 0.06}, 1);
  for (Eigen::Index v = 0; v < arm.points.rows(); ++v) {
    const double along = std::clamp((arm.points(v, 0) - 0.3) / 0.4, 0.0, 1.0);
    arm.weights[static_cast<std::size_t>(v)] = {{1, 1.0 - along}, {3, along}};
  }
  rig.parts = {trunk, arm, ball("head", {0, 1.6, 0}, {0.14, 0.2, 0.14}, 2),
               ball("eye", {0.05, 1.65, 0.12}, {0.03, 0.03, 0.03}, 2, 8)};
  return rig;
}

const Island& island(const std::vector<Island>& islands, const std::string& name) {
  for (const Island& i : islands)
    if (i.name == name) return i;
  throw std::out_of_range(name);
}

/// One mesh of everything, as many files have it.
Part joined(const std::vector<Part>& parts) {
  Part all;
  all.name = "body";
  all.role = PartRole::Simulated;
  for (const Part& part : parts) {
    const Eigen::Index first = all.points.rows(), at = all.triangles.rows();
    all.points.conservativeResize(first + part.points.rows(), 3);
    all.points.bottomRows(part.points.rows()) = part.points;
    all.triangles.conservativeResize(at + part.triangles.rows(), 3);
    all.triangles.bottomRows(part.triangles.rows()) = part.triangles.array() + static_cast<int>(first);
    all.weights.insert(all.weights.end(), part.weights.begin(), part.weights.end());
  }
  return all;
}

// The doll's pieces are islands of one mesh; a seam (the same corner twice, with a triangle each) is none.
TEST(Islands, AreWhatTrianglesAndCoincidentPointsHoldTogether) {
  Rig rig = doll();
  Part split = joined(rig.parts);
  const std::size_t pieces = rig.parts.size();
  // Every triangle gets corners of its own: still the same pieces.
  Part soup = split;
  soup.points.resize(3 * split.triangles.rows(), 3);
  soup.weights.clear();
  for (Eigen::Index t = 0; t < split.triangles.rows(); ++t) {
    for (Eigen::Index c = 0; c < 3; ++c) {
      soup.points.row(3 * t + c) = split.points.row(split.triangles(t, c));
      soup.weights.push_back(split.weights[static_cast<std::size_t>(split.triangles(t, c))]);
      soup.triangles(t, c) = static_cast<int>(3 * t + c);
    }
  }
  for (const Part& part : {split, soup}) {
    rig.parts = {part};
    const std::vector<Island> islands = find_islands(rig);
    ASSERT_EQ(islands.size(), pieces);
    std::size_t vertices = 0;
    Eigen::Index triangles = 0;
    for (const Island& i : islands) {
      vertices += i.vertices.size();
      triangles += i.triangles.rows();
    }
    EXPECT_EQ(vertices, static_cast<std::size_t>(part.points.rows()));
    EXPECT_EQ(triangles, part.triangles.rows());
    EXPECT_EQ(islands[0].name, "body");
    EXPECT_EQ(islands[0].joint, -1);
    EXPECT_EQ(islands[1].name, "body/2");
    EXPECT_EQ(islands[2].name, "body/head");
    EXPECT_EQ(islands[3].name, "body/head/2");
    EXPECT_EQ(islands[3].joint, 2);
  }
}

// A ball of radius 3 cm and 8 rings has the area of its inscribed polyhedron, 2 % less than 4 pi r^2.
TEST(Islands, MeasureTheirArea) {
  const Rig rig = doll();
  const std::vector<Island> islands = find_islands(rig);
  const double sphere = 4.0 * std::numbers::pi * 0.03 * 0.03;
  EXPECT_LT(island(islands, "eye").area, sphere);
  EXPECT_GT(island(islands, "eye").area, 0.95 * sphere);
}

TEST(Roles, KeepWhatFillsALimbAsFlesh) {
  const Rig rig = doll();
  const std::vector<Island> islands = find_islands(rig);
  EXPECT_EQ(island(islands, "trunk").role, PartRole::Simulated);
  EXPECT_EQ(island(islands, "arm").role, PartRole::Simulated);
  // On the head's joint alone, and the only piece that is there.
  EXPECT_EQ(island(islands, "head").role, PartRole::Simulated);
}

TEST(Roles, LetEyesRide) {
  const Rig rig = doll();
  const Island eye = island(find_islands(rig), "eye");
  EXPECT_EQ(eye.role, PartRole::Riding);
  EXPECT_THAT(eye.reason, HasSubstr("rides on the flesh round it"));
}

// A metre long and 1 cm thick, in a hand of 6 cm: on the hand's joint, or on one of its own.
TEST(Roles, LeaveWeaponsToTheSkinning) {
  for (const int joint : {3, 4}) {
    Rig rig = doll();
    rig.parts.push_back(ball("blade", {1.2, 1.1, 0}, {0.5, 0.02, 0.005}, joint));
    const std::vector<Island> islands = find_islands(rig);
    EXPECT_EQ(island(islands, "blade").role, PartRole::Skinned) << joint;
    EXPECT_EQ(island(islands, "arm").role, PartRole::Simulated);
  }
}

// A hat of 8 % of the area over the head; as skin, and as a mesh that the file hangs under the joint.
TEST(Roles, LetAHatRideOnTheHead) {
  for (const bool is_skinned : {true, false}) {
    Rig rig = doll();
    Part hat = ball("hat", {0, 1.78, 0}, {0.13, 0.06, 0.13}, 2);
    if (!is_skinned) {
      hat.weights.clear();
      hat.role = PartRole::Rigid;
      hat.joint = 2;
    }
    rig.parts.push_back(hat);
    EXPECT_EQ(island(find_islands(rig), "hat").role, PartRole::Riding) << is_skinned;
  }
}

// Every piece holds the bone of its joint: nothing of a robot is a prop.
TEST(Roles, TakeNoPieceOfARobotForAProp) {
  Rig rig;
  rig.skeleton = skeleton::Skeleton({joint("base", -1, {0, 0, 0}), joint("upper", 0, {0, 0.5, 0}),
                                     joint("lower", 1, {0, 1.0, 0}), joint("hand", 2, {0, 1.5, 0})});
  for (int j = 0; j < 4; ++j)
    rig.parts.push_back(
        ball("piece" + std::to_string(j), {0, 0.5 * j + 0.25, 0}, {0.1, j == 3 ? 0.1 : 0.26, 0.1}, j));
  rig.parts[3].points.col(1).array() -= 0.15;
  for (const Island& i : find_islands(rig)) EXPECT_EQ(i.role, PartRole::Simulated) << i.name;
}

TEST(Roles, TakePropsOutOfThePhysics) {
  Rig rig = doll();
  const int all = num_vertices(rig);
  const Eigen::Index eye = rig.parts[3].points.rows();
  const PhysicsSkin before = physics_skin(rig);
  set_roles(rig, find_islands(rig));
  ASSERT_EQ(rig.props.size(), 1u);
  EXPECT_EQ(static_cast<Eigen::Index>(rig.props[0].vertices.size()), eye);
  const PhysicsSkin after = physics_skin(rig);
  EXPECT_EQ(after.surface.points.rows(), before.surface.points.rows() - eye);
  EXPECT_EQ(after.surface.triangles.rows(), before.surface.triangles.rows() - rig.parts[3].triangles.rows());
  ASSERT_EQ(after.surface_of_vertex.size(), static_cast<std::size_t>(all));
  for (int v = 0; v < all; ++v)
    EXPECT_EQ(after.surface_of_vertex[static_cast<std::size_t>(v)] < 0, v >= all - eye) << v;
  double sum = 0.0;
  for (const Anchor& anchor : rig.props[0].anchors) {
    sum += anchor.weight;
    EXPECT_GE(after.surface_of_vertex[static_cast<std::size_t>(anchor.vertex)], 0);
  }
  EXPECT_NEAR(sum, 1.0, 1e-12);  // a few hundred rounded additions
}

TEST(Roles, MakeFleshOfAMeshUnderAJoint) {
  Rig rig = doll();
  Part hat = ball("hat", {0, 1.78, 0}, {0.13, 0.06, 0.13}, 2);
  hat.weights.clear();
  hat.role = PartRole::Rigid;
  hat.joint = 2;
  rig.parts.push_back(hat);
  std::vector<Island> islands = find_islands(rig);
  for (Island& i : islands) i.role = PartRole::Simulated;
  set_roles(rig, islands);
  EXPECT_TRUE(rig.props.empty());
  EXPECT_EQ(rig.parts[4].role, PartRole::Simulated);
  ASSERT_EQ(rig.parts[4].weights.size(), static_cast<std::size_t>(hat.points.rows()));
  EXPECT_EQ(rig.parts[4].weights[5][0].frame, 2);
  EXPECT_EQ(physics_skin(rig).surface_of_vertex.back() >= 0, true);
}

TEST(Roles, RefuseWhatAnIslandCannotBe) {
  Rig rig = doll();
  std::vector<Island> islands = find_islands(rig);
  islands[0].role = PartRole::Rigid;  // the trunk hangs on two joints
  try {
    set_roles(rig, islands);
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_STREQ(error.what(),
                 "part 'trunk': cannot be rigid, as it hangs on several joints; hint: role = \"skinned\"");
  }
  for (Island& i : islands) i.role = PartRole::Riding;  // no flesh is left
  EXPECT_THROW(set_roles(rig, islands), ConfigError);
}

Eigen::Isometry3d some_motion() {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = Eigen::AngleAxisd(0.7, Vector3d(1, 2, -2).normalized()).toRotationMatrix();
  motion.translation() << 0.3, -0.2, 0.5;
  return motion;
}

TEST(Riding, FindsTheTurnOfWhatMovedRigidly) {
  std::mt19937_64 rng(20021);
  Points from(9, 3), to(9, 3);
  std::vector<Anchor> anchors;
  const Eigen::Isometry3d motion = some_motion();
  for (int i = 0; i < 9; ++i) {
    from.row(i) = tests::uniform_point(rng, -1.0, 1.0).transpose();
    to.row(i) = (motion * from.row(i).transpose()).transpose();
    anchors.push_back({i, (i + 1) / 45.0});
  }
  // The share kStay of a rest shape turns it back by 1e-9; the rest is rounding.
  EXPECT_LT((best_turn(anchors, from, to) - motion.linear()).norm(), 1e-8);
}

// Three points on the x axis say nothing about turns round it, and one point nothing about any.
TEST(Riding, DoesNotTurnWhereNothingSaysSo) {
  Points from(3, 3), to(3, 3);
  from << -1, 0, 0, 0, 0, 0, 1, 0, 0;
  to = from.rowwise() + Eigen::RowVector3d(0, 2, 0);
  const Eigen::Matrix3d along = best_turn({{0, 0.3}, {1, 0.3}, {2, 0.4}}, from, to);
  EXPECT_LT((along - Eigen::Matrix3d::Identity()).norm(), 1e-6);
  EXPECT_EQ(best_turn({{2, 1.0}}, from, to), Eigen::Matrix3d::Identity());
}

// The eye's own joint turns and grows it, then the head's flesh is moved away from its skinning: the eye
// follows both, a rigid one keeps its size, a skinned one stays where its joint has it.
TEST(Riding, AddsTheMotionOfTheFleshToTheSkinning) {
  Rig rig = doll();
  set_roles(rig, find_islands(rig));
  std::vector<Eigen::Affine3d> pose(5, Eigen::Affine3d::Identity());
  pose[2].linear() = 1.5 * Eigen::AngleAxisd(0.4, Vector3d::UnitY()).toRotationMatrix();
  pose[2].translation() << 0.1, 0.0, 0.2;
  const Points skinned = skin(rig, pose);
  const Eigen::Isometry3d motion = some_motion();
  const Points moved = (skinned * motion.linear().transpose()).rowwise() + motion.translation().transpose();
  Prop& eye = rig.props.at(0);
  for (const PartRole role : {PartRole::Riding, PartRole::Skinned, PartRole::Rigid}) {
    eye.role = role;
    Points frame = moved;
    for (const int v : eye.vertices) frame.row(v).setConstant(99.0);  // to be filled in
    PropMotion(rig).place(pose, skinned, frame);
    if (role == PartRole::Riding) {  // turned as the flesh, but for the 5 degrees that gaze keeps
      std::vector<Anchor> all;
      for (const int v : eye.vertices) all.push_back({v, 1.0 / static_cast<double>(eye.vertices.size())});
      const Eigen::AngleAxisd turned(best_turn(all, skinned, frame)), whole(motion.linear());
      EXPECT_NEAR(turned.angle(), whole.angle() - 5.0 * M_PI / 180.0, 1e-7);
      EXPECT_NEAR(turned.axis().dot(whole.axis()), 1.0, 1e-7);
      continue;
    }
    for (const int v : eye.vertices) {
      const Vector3d rest = rig.parts[3].points.row(v - eye.vertices.front()).transpose();
      Vector3d expected = moved.row(v).transpose();
      if (role == PartRole::Skinned) expected = pose[2] * rest;
      // About the joint, which is where its map takes it.
      if (role == PartRole::Rigid)
        expected = pose[2] * Vector3d(0, 1.4, 0) + pose[2].linear() / 1.5 * (rest - Vector3d(0, 1.4, 0));
      EXPECT_LT((frame.row(v).transpose() - expected).norm(), 1e-8) << v;
    }
  }
}

// Flesh that bulges and tilts at one eye carries that eye and turns neither: what turns them is the head as a
// whole.
TEST(Riding, KeepsTheGazeWhileFleshRipples) {
  Rig rig = doll();
  rig.parts.push_back(ball("other", {-0.05, 1.65, 0.12}, {0.03, 0.03, 0.03}, 2, 8));
  set_roles(rig, find_islands(rig));
  ASSERT_EQ(rig.props.size(), 2u);
  const std::vector<Eigen::Affine3d> pose(5, Eigen::Affine3d::Identity());
  const Points skinned = skin(rig, pose);
  const int head = static_cast<int>(rig.parts[0].points.rows() + rig.parts[1].points.rows());
  Points frame = skinned;
  for (int v = head; v < head + static_cast<int>(rig.parts[2].points.rows()); ++v) {
    const double away = (skinned.row(v).transpose() - Vector3d(0.05, 1.65, 0.12)).norm();
    const double tilted = 0.01 + 0.3 * (skinned(v, 0) - 0.05);
    frame(v, 2) += tilted * std::exp(-away * away / 0.002);
  }
  PropMotion(rig).place(pose, skinned, frame);
  const auto moved = [&](std::size_t prop) {
    const std::vector<int>& vertices = rig.props[prop].vertices;
    Points by(static_cast<Eigen::Index>(vertices.size()), 3);
    for (std::size_t i = 0; i < vertices.size(); ++i)
      by.row(static_cast<Eigen::Index>(i)) = frame.row(vertices[i]) - skinned.row(vertices[i]);
    return by;
  };
  // The bump's mean over the anchors lies well above this, its far side well below.
  EXPECT_GT(moved(0).col(2).mean(), 0.002);
  EXPECT_LT(moved(1).col(2).mean(), 0.5 * moved(0).col(2).mean());
  const auto angle = [](const Eigen::Matrix3d& turn) { return Eigen::AngleAxisd(turn).angle(); };
  const double locally = angle(best_turn(rig.props[0].anchors, skinned, frame));
  for (std::size_t prop = 0; prop < 2; ++prop) {
    const Points by = moved(prop);
    const double turn = (by.rowwise() - by.colwise().mean()).rowwise().norm().maxCoeff() / 0.03;
    EXPECT_LT(turn, 0.2 * locally) << prop;
  }
}

}  // namespace
}  // namespace sinew::assets
