#include "lattice/build.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <numbers>
#include <set>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lattice/detail/retries.h"
#include "lattice/detail/rig_input.h"
#include "tests/lattice/limbs.h"
#include "tests/lattice/mirrored.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

using Limb = tests::Character;

/// An ellipsoid along y from 0 to 2 with three joints and smooth weights between the first two.
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

/// Per cell the matrix that turns (x, y, z, 1) into barycentric coordinates, by a linear solve: independent
/// of the containment test of the library.
std::vector<Eigen::Matrix4d> barycentric_maps(const CellComplex& complex) {
  std::vector<Eigen::Matrix4d> maps;
  for (const Cell& cell : complex.cells) {
    Eigen::Matrix4d corners;
    for (int k = 0; k < 4; ++k) corners.col(k) << complex.points.row(cell.vertices[k]).transpose(), 1.0;
    maps.push_back(corners.inverse());
  }
  return maps;
}

void expect_sound(const ControlLattice& lattice, const Limb& limb) {
  EXPECT_NO_THROW(validate(lattice));
  const std::vector<Eigen::Matrix4d> maps = barycentric_maps(lattice.complex);
  for (int v = 0; v < limb.skin.points.rows(); ++v) {
    const Eigen::Vector4d p = Vector3d(limb.skin.points.row(v).transpose()).homogeneous();
    EXPECT_TRUE(
        std::any_of(maps.begin(), maps.end(), [&](const auto& m) { return (m * p).minCoeff() > -1e-9; }))
        << "skin vertex " << v;
  }
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

TEST(Build, HoldsRandomCharacters) {
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 rng(seed);
    const tests::Character character = tests::random_character(rng);
    const BuildResult result = build(character.skin, character.joints, {.cells = seed % 2 == 0 ? 150 : 500});
    for (const GateFailure& failure : result.failures) EXPECT_TRUE(failure.tolerable) << failure.what;
    expect_sound(result.lattice, character);
    for (const int frame : result.lattice.frame_of_joint) EXPECT_GE(frame, 0);
  }
}

TEST(Build, MovesEveryVertexWhereBonesMeetInOneWayOnly) {
  std::mt19937_64 rng(7);
  for (int i = 0; i < 8; ++i) {
    const tests::Character character = tests::random_character(rng);
    const ControlLattice lattice =
        build(character.skin, character.joints, {.cells = 200, .max_retries = 0}).lattice;
    std::map<int, int> joint_of_vertex;
    for (const LatticeBone& bone : lattice.bones) {
      if (bone.soft) continue;
      for (const auto& [vertex, anchor] :
           {std::pair(bone.chain.front(), bone.start), std::pair(bone.chain.back(), bone.end)}) {
        EXPECT_EQ(anchor.joint_a, anchor.joint_b);
        EXPECT_EQ(anchor.x_a, Vector3d(lattice.complex.points.row(vertex).transpose()));
        EXPECT_EQ(joint_of_vertex.emplace(vertex, anchor.joint_a).first->second, anchor.joint_a) << bone.name;
      }
    }
  }
}

TEST(Build, DoesNotGlueTwoLegsAcrossTheirGap) {
  const tests::Character legs = tests::two_legs();
  // Edges of about 0.14, a gap of 0.12: some cells hold skin of both legs, but most do not.
  const BuildResult result = build(legs.skin, legs.joints, {.cells = 500});
  EXPECT_THAT(result.failures, testing::IsEmpty());
  expect_sound(result.lattice, legs);
  const Points& points = result.lattice.complex.points;
  std::set<std::array<double, 3>> places;
  for (Eigen::Index v = 0; v < points.rows(); ++v) places.insert({points(v, 0), points(v, 1), points(v, 2)});
  EXPECT_LT(places.size(), static_cast<std::size_t>(points.rows())) << "no vertex was doubled";
}

TEST(Build, MirrorsTheLatticeOfAMirroredRig) {
  const tests::Character legs = tests::two_legs();
  for (const int cells : {150, 500}) {
    const BuildResult result = build(legs.skin, legs.joints, {.cells = cells});
    EXPECT_THAT(result.failures, testing::IsEmpty());
    ASSERT_TRUE(result.mirror) << result.no_mirror;
    EXPECT_EQ(result.mirror->normal, Vector3d(1, 0, 0));
    tests::expect_mirrored(result.lattice, *result.mirror);
    expect_sound(result.lattice, legs);
    // Bones of both sides are partners: the same names but for the side.
    std::multiset<std::string> left, right;
    for (const LatticeBone& bone : result.lattice.bones) {
      if (bone.name.find("left") != std::string::npos)
        left.insert(bone.name.substr(bone.name.find("left") + 4));
      if (bone.name.find("right") != std::string::npos)
        right.insert(bone.name.substr(bone.name.find("right") + 5));
    }
    EXPECT_EQ(left, right);
    EXPECT_FALSE(left.empty());
  }
}

TEST(Build, MirrorsInAnyPlane) {
  tests::Character legs = tests::two_legs();
  const Eigen::AngleAxisd turn(0.7, Vector3d(0.3, 0.8, -0.5).normalized());
  const Vector3d shift(3.0, -2.0, 1.0);
  for (Points* points : {&legs.skin.points, &legs.joints.positions})
    *points = ((*points * turn.toRotationMatrix().transpose()).rowwise() + shift.transpose()).eval();
  const BuildResult result = build(legs.skin, legs.joints, {.cells = 400});
  EXPECT_THAT(result.failures, testing::IsEmpty());
  ASSERT_TRUE(result.mirror) << result.no_mirror;
  // From the eigenvectors of the vertices' covariance: 1e-16 over the gap of its eigenvalues.
  EXPECT_NEAR(std::abs(result.mirror->normal.dot(turn * Vector3d::UnitX())), 1.0, 1e-12);
  tests::expect_mirrored(result.lattice, *result.mirror);
  expect_sound(result.lattice, legs);
}

// What stops a build comes from the poll alone, and while nothing stops it the poll changes nothing.
TEST(Build, StopsWhereverThePollThrows) {
  const tests::Character legs = tests::two_legs();
  for (const Construction construction : {Construction::Tetrahedra, Construction::Grid}) {
    long polls = 0;
    BuildOptions options{.cells = 100, .construction = construction};
    const BuildResult unwatched = build(legs.skin, legs.joints, options);
    options.poll.ask = [&] { ++polls; };
    const BuildResult watched = build(legs.skin, legs.joints, options);
    EXPECT_EQ(watched.lattice.complex.points, unwatched.lattice.complex.points);
    const long all = polls;
    EXPECT_GT(all, watched.lattice.complex.points.rows()) << "nothing long goes without one";
    struct Stop {};
    for (const double share : {0.0, 0.2, 0.5, 0.8, 1.0}) {
      const long last = 1 + std::lround(share * static_cast<double>(all - 1));
      polls = 0;
      options.poll.ask = [&] {
        if (++polls == last) throw Stop();
      };
      EXPECT_THROW(build(legs.skin, legs.joints, options), Stop) << last << " of " << all;
      EXPECT_EQ(polls, last) << "asked again after it had said no";
    }
  }
}

TEST(Build, SaysWhyALatticeIsNotMirrored) {
  tests::Character legs = tests::two_legs();
  EXPECT_EQ(build(legs.skin, legs.joints, {.cells = 150, .symmetry = Symmetry::Off}).no_mirror,
            "symmetry is off");
  legs.joints.positions(3, 2) += 0.01;  // one knee
  const BuildResult bent = build(legs.skin, legs.joints, {.cells = 150});
  EXPECT_FALSE(bent.mirror);
  EXPECT_THAT(bent.no_mirror, testing::HasSubstr("has no mirror image"));
}

TEST(Build, IsTheSameInOtherUnits) {
  const Limb limb = arm();
  Limb scaled = limb;
  scaled.skin.points *= 128.0;  // a power of two: rounding scales with it
  scaled.joints.positions *= 128.0;
  const ControlLattice a = build(limb.skin, limb.joints, {.cells = 200}).lattice;
  const ControlLattice b = build(scaled.skin, scaled.joints, {.cells = 200}).lattice;
  ASSERT_EQ(a.complex.points.rows(), b.complex.points.rows());
  EXPECT_EQ(Points(128.0 * a.complex.points), b.complex.points);
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

TEST(Build, TakesACellSizeInMetres) {
  const Limb limb = arm();
  const auto cells_of_size = [&](double size) {
    const ControlLattice lattice = build(limb.skin, limb.joints, {.cell_size = size}).lattice;
    EXPECT_DOUBLE_EQ(lattice.edge_length, size);
    double sum = 0.0;
    for (const Cell& cell : lattice.complex.cells) sum += cell_volume(lattice.complex, cell);
    return sum / static_cast<double>(lattice.complex.cells.size());
  };
  // A cube of the body-centred grid has the side 2h/sqrt(3) and twelve cells; pulling the boundary to the
  // skin makes the outer ones smaller, by half at most.
  const double grid_cell = std::pow(2.0 / std::sqrt(3.0), 3) / 12.0;
  for (const double size : {0.2, 0.1, 0.05}) {
    const double volume = cells_of_size(size) / (size * size * size);
    EXPECT_GT(volume, 0.5 * grid_cell) << size;
    EXPECT_LT(volume, grid_cell) << size;
  }
}

/// Seven bones out of one point, neighbours 25 degrees apart: nothing to chain, but cells between three of
/// them are needles.
Limb fan() {
  Limb limb;
  limb.add_joint("palm", -1, {0, -0.5, 0});
  limb.add_joint("wrist", 0, {0, 0, 0});
  limb.add_capsule(0, {0, -0.5, 0}, {0, 0, 0}, 0.25);
  for (int i = 0; i < 7; ++i) {
    const double around = 2.0 * std::numbers::pi * i / 6, tilt = i == 6 ? 0.0 : 0.44;
    const Vector3d end = (1.0 + 0.05 * i) * Vector3d(std::sin(tilt) * std::cos(around), std::cos(tilt),
                                                     std::sin(tilt) * std::sin(around));
    const int finger = limb.add_joint("finger_" + std::to_string(i), 1, end);
    limb.add_capsule(1, {0, 0, 0}, end, 0.2);
    limb.add_capsule(finger, end, 1.3 * end, 0.2);
  }
  return limb;
}

TEST(Build, ReducesTheSkeletonFartherWhereTheGateRefuses) {
  const Limb limb = fan();
  // Between three directions 25 degrees apart the Jacobian is at most sin(25) sin(25) cos(12.5) = 0.17.
  BuildOptions options{
      .cells = 300, .construction = Construction::Tetrahedra, .max_retries = 0, .min_scaled_jacobian = 0.2};
  const BuildResult first = build(limb.skin, limb.joints, options);
  ASSERT_EQ(first.refused.size(), 1u);
  EXPECT_EQ(first.refused[0].name, "as asked");
  EXPECT_EQ(first.lattice.retries, 0);
  EXPECT_LT(first.lattice.quality.min_scaled_jacobian, 0.17);

  options.max_retries = 12;
  const BuildResult result = build(limb.skin, limb.joints, options);
  EXPECT_THAT(result.failures, testing::IsEmpty());
  EXPECT_GE(result.lattice.quality.min_scaled_jacobian, 0.2);
  ASSERT_FALSE(result.refused.empty());
  EXPECT_EQ(static_cast<std::size_t>(result.lattice.retries), result.refused.size());
  for (const RefusedAttempt& attempt : result.refused)
    EXPECT_EQ(attempt.name.find("h x"), std::string::npos) << "another grid cannot help here";
  // The fingers end side by side, so that none can go on behind another one.
  EXPECT_TRUE(std::any_of(result.lattice.changes.begin(), result.lattice.changes.end(),
                          [](const SkeletonChange& change) { return change.what == "soft"; }));
  expect_sound(result.lattice, limb);
}

TEST(Retries, FindTheBoneThatSpoilsACell) {
  const Limb limb = fan();
  const BuildOptions options{
      .cells = 300, .construction = Construction::Tetrahedra, .max_retries = 0, .min_scaled_jacobian = 0.2};
  const ControlLattice lattice = build(limb.skin, limb.joints, options).lattice;
  const detail::Inspection found = detail::inspect(lattice, limb.skin, detail::make_unit_skin(limb.skin));
  const std::optional<detail::SoftBone> bone = detail::offending_bone(lattice, found, options);
  ASSERT_TRUE(bone);
  EXPECT_EQ(bone->frame, 1);  // one of the wrist's
  const detail::RigInput input = detail::make_rig_input(limb.skin, limb.joints);
  detail::ReductionOptions reduction;
  reduction.soft_bones = {*bone};
  const detail::ReducedSkeleton skeleton =
      detail::reduce_skeleton(input.unit_skin, input.unit_joints, input.weights,
                              lattice.edge_length / input.unit_skin.scale, reduction);
  const auto soft = [](const detail::ReducedBone& b) { return b.soft; };
  EXPECT_EQ(std::count_if(skeleton.bones.begin(), skeleton.bones.end(), soft), 1);
  EXPECT_TRUE(detail::is_shaped_by_bones(lattice, found, options));
}

/// Names of the lattice's bones and of its soft frames.
std::vector<std::string> frames(const ControlLattice& lattice, const Limb& limb) {
  std::vector<std::string> names;
  for (const LatticeBone& bone : lattice.bones) names.push_back(bone.name);
  for (const SoftFrame& frame : lattice.soft_frames)
    names.push_back("soft " + limb.joints.names[frame.frame]);
  return names;
}

TEST(Build, LeavesExcludedJointsOut) {
  const Limb limb = arm();
  const ControlLattice lattice = build(limb.skin, limb.joints, {.cells = 200, .exclude = {1}}).lattice;
  // Without its elbow the arm is one straight bone from the shoulder to its end.
  EXPECT_THAT(frames(lattice, limb), testing::ElementsAre("upper"));
  EXPECT_EQ(lattice.bones[0].rest_start, Vector3d(0, 0.1, 0));
  EXPECT_TRUE(lattice.bones[0].tip);
  EXPECT_THAT(lattice.frame_of_joint, testing::ElementsAre(0, 0, 0));
  ASSERT_FALSE(lattice.changes.empty());
  EXPECT_EQ(lattice.changes[0].joint, "lower");
  EXPECT_EQ(lattice.changes[0].what, "excluded");
  const ControlLattice same = build(limb.skin, limb.joints, {.cells = 200, .include = {0, 2}}).lattice;
  EXPECT_EQ(lattice.complex.points, same.complex.points);
}

TEST(Build, HangsTheSkinAboveAllBonesOnTheNearestBelow) {
  const Limb limb = arm();
  const ControlLattice lattice = build(limb.skin, limb.joints, {.cells = 200, .exclude = {0}}).lattice;
  EXPECT_THAT(frames(lattice, limb), testing::ElementsAre("lower"));
  EXPECT_THAT(lattice.frame_of_joint, testing::ElementsAre(1, 1, 1));
}

TEST(Build, HoldsLeafJointsBySoftFramesWithoutTipBones) {
  const Limb limb = arm();
  const ControlLattice lattice =
      build(limb.skin, limb.joints, {.cells = 200, .tip_bones = TipBones::Off}).lattice;
  EXPECT_THAT(frames(lattice, limb), testing::ElementsAre("upper", "soft lower"));
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
  EXPECT_EQ(message(arm(), {.cell_size = -0.1}), "cell_size: got -0.1, expected a length above 0 [m]");
  EXPECT_EQ(message(arm(), {.size_factors = {{1, 0.1}}}),
            "size_factors: got 0.1, expected a factor in [0.25, 4]");
  EXPECT_EQ(message(arm(), {.size_factors = {{1, 0.5}, {1, 2.0}}}),
            "size_factors: got 1, expected every joint at most once");
  EXPECT_EQ(message(arm(), {.size_factors = {{3, 0.5}}}), "size_factors: got joint 3, expected 0 ... 2");
  EXPECT_EQ(message(arm(), {.include = {7}}), "include: got joint 7, expected 0 ... 2");
  EXPECT_EQ(message(arm(), {.exclude = {0, 1, 2}}), "exclude: all 3 joints, expected at least one left");
}

}  // namespace
}  // namespace sinew::lattice
