// Closed shells of flesh that the file winds the wrong way round.
#include "assets/detail/turned_shells.h"

#include <array>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sinew::assets::detail {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// A cube of unit side about `centre`, scaled; every side has points of its own and weights of its own, so
/// that only its places are closed.
void add_cube(Rig& rig, const std::string& name, const Eigen::Vector3d& centre, double side) {
  Part part;
  part.name = name;
  part.role = PartRole::Simulated;
  part.points.resize(24, 3);
  part.triangles.resize(12, 3);
  for (int axis = 0; axis < 3; ++axis) {
    for (const int sign : {-1, 1}) {
      const int face = 2 * axis + (sign > 0 ? 1 : 0);
      // Counter-clockwise seen from outside.
      const std::array<std::array<int, 2>, 4> corners{{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}};
      for (int k = 0; k < 4; ++k) {
        Eigen::Vector3d p;
        p[axis] = sign;
        p[(axis + 1) % 3] = sign * corners[static_cast<std::size_t>(k)][0];
        p[(axis + 2) % 3] = corners[static_cast<std::size_t>(k)][1];
        part.points.row(4 * face + k) = centre + 0.5 * side * p;
        part.weights.push_back({{face % 2, 1.0}});
      }
      part.triangles.row(2 * face) << 4 * face, 4 * face + 1, 4 * face + 2;
      part.triangles.row(2 * face + 1) << 4 * face, 4 * face + 2, 4 * face + 3;
    }
  }
  rig.parts.push_back(part);
}

void turn_all(Part& part) { part.triangles.col(1).swap(part.triangles.col(2)); }

/// Volume within the surface that physics sees, by the divergence theorem [m^3].
double physics_volume(const Rig& rig) {
  const lattice::Surface surface = physics_skin(rig).surface;
  double volume = 0.0;
  for (Eigen::Index t = 0; t < surface.triangles.rows(); ++t) {
    Eigen::Matrix3d corners;
    for (int c = 0; c < 3; ++c) corners.col(c) = surface.points.row(surface.triangles(t, c)).transpose();
    volume += corners.determinant() / 6.0;
  }
  return volume;
}

/// 12 triangles of numbers near 1.
constexpr double kRounding = 1e-13;

TEST(TurnedShells, AreNoneWhereTheFileIsRight) {
  Rig rig;
  add_cube(rig, "body", {0, 0, 0}, 1.0);
  turn_shells(rig);
  EXPECT_TRUE(rig.parts[0].turned.empty());
  EXPECT_TRUE(rig.findings.empty());
  EXPECT_NEAR(physics_volume(rig), 1.0, kRounding);
}

TEST(TurnedShells, GiveTheVolumeBackAndLeaveTheFilesOwnWinding) {
  Rig rig;
  add_cube(rig, "body", {0, 0, 0}, 1.0);
  add_cube(rig, "ball", {3, 0, 0}, 1.0);
  turn_all(rig.parts[1]);
  const lattice::Triangles before = rig.parts[1].triangles;
  EXPECT_NEAR(physics_volume(rig), 0.0, kRounding);
  turn_shells(rig);
  EXPECT_NEAR(physics_volume(rig), 2.0, kRounding);
  EXPECT_TRUE(rig.parts[0].turned.empty());
  EXPECT_EQ(rig.parts[1].triangles, before);
  ASSERT_EQ(rig.findings.size(), 1u);
  EXPECT_EQ(rig.findings[0].code, "shells-inside-out");
  EXPECT_EQ(rig.findings[0].where, "ball");
  EXPECT_THAT(rig.findings[0].message, HasSubstr("1 closed shell inside out"));
}

TEST(TurnedShells, LeaveCavitiesHollow) {
  Rig rig;
  add_cube(rig, "hull", {0, 0, 0}, 2.0);
  add_cube(rig, "hollow", {0, 0, 0}, 1.0);
  turn_all(rig.parts[1]);
  turn_shells(rig);
  EXPECT_NEAR(physics_volume(rig), 7.0, 10 * kRounding);
  EXPECT_TRUE(rig.findings.empty());
}

TEST(TurnedShells, TurnSingleTrianglesAgainstTheirNeighbours) {
  Rig rig;
  add_cube(rig, "body", {0, 0, 0}, 1.0);
  for (const int t : {0, 7}) std::swap(rig.parts[0].triangles(t, 1), rig.parts[0].triangles(t, 2));
  turn_shells(rig);
  EXPECT_THAT(rig.parts[0].turned, ElementsAre(0, 7));
  EXPECT_NEAR(physics_volume(rig), 1.0, kRounding);
  EXPECT_EQ(rig.findings[0].code, "faces-turned");
}

TEST(TurnedShells, LeaveOpenOnesAlone) {
  Rig rig;
  add_cube(rig, "cup", {0, 0, 0}, 1.0);
  turn_all(rig.parts[0]);
  rig.parts[0].triangles.conservativeResize(11, 3);
  turn_shells(rig);
  EXPECT_TRUE(rig.parts[0].turned.empty());
  EXPECT_TRUE(rig.findings.empty());
}

}  // namespace
}  // namespace sinew::assets::detail
