#include "assets/output_mesh.h"

#include <algorithm>
#include <numeric>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"

namespace sinew::assets {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

lattice::Points random_points(int n) {
  std::mt19937_64 rng(20021);
  lattice::Points points(n, 3);
  for (Eigen::Index i = 0; i < points.size(); ++i)
    points.data()[i] = static_cast<double>(rng() % 1000003) / 1000003.0;
  return points;
}

std::vector<int> all_apart(Eigen::Index n) {
  std::vector<int> together(static_cast<std::size_t>(n));
  std::iota(together.begin(), together.end(), 0);
  return together;
}

TEST(MatchRestPositions, FindsAnyShuffledOrderAgain) {
  const lattice::Points rig = random_points(500);
  std::vector<int> order = all_apart(500);
  std::shuffle(order.begin(), order.end(), std::mt19937_64(7));
  // Text with six decimals: half a unit of the sixth in each coordinate, below 1e-5 of the diagonal of
  // about 1.7.
  lattice::Points mesh = rig(order, Eigen::all);
  for (Eigen::Index i = 0; i < mesh.size(); ++i) mesh.data()[i] = std::round(mesh.data()[i] * 1e6) / 1e6;
  EXPECT_EQ(match_rest_positions("mesh.obj", mesh, rig, all_apart(500)), order);
}

TEST(MatchRestPositions, NamesTheVertexThatHasNoPartner) {
  const lattice::Points rig = random_points(50);
  lattice::Points mesh = rig;
  mesh(17, 1) += 1e-3;
  EXPECT_THAT(
      [&] { match_rest_positions("mesh.obj", mesh, rig, all_apart(50)); },
      ThrowsMessage<InputError>(AllOf(HasSubstr("mesh.obj: vertex 17 at ("),
                                      HasSubstr("the nearest, 17, is 0.001 away"), HasSubstr("hint:"))));
}

TEST(MatchRestPositions, TakesOneOfSeveralThatMoveTogetherButRefusesThoseThatDoNot) {
  lattice::Points rig(4, 3);
  rig << 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0;
  const lattice::Points mesh = rig.topRows(2);
  EXPECT_THAT(match_rest_positions("m.ply", mesh, rig, {0, 1, 1, 2}), ElementsAre(0, 1));
  EXPECT_THAT(
      [&] {
        match_rest_positions("m.ply", mesh, rig, {0, 1, 3, 2});
      },
      ThrowsMessage<InputError>(
          AllOf(HasSubstr("vertex 1 at (1, 0, 0)"), HasSubstr("vertices 1 and 2"), HasSubstr("move apart"))));
}

TEST(MatchRestPositions, LooksJustAsFarAsItsTolerance) {
  lattice::Points rig(2, 3);
  rig << 0, 0, 0, 1, 0, 0;  // diagonal 1
  lattice::Points mesh(1, 3);
  mesh << 0.99e-4, 0, 0;
  EXPECT_THAT(match_rest_positions("m.obj", mesh, rig, {0, 1}, {.tolerance = 1e-4}), ElementsAre(0));
  mesh << 1.01e-4, 0, 0;
  EXPECT_THROW(match_rest_positions("m.obj", mesh, rig, {0, 1}, {.tolerance = 1e-4}), InputError);
  EXPECT_THROW(match_rest_positions("m.obj", mesh, rig, {0, 1}, {.tolerance = 0.0}), std::invalid_argument);
}

TEST(MovingTogether, JoinsSeamCopiesOfAPartButNotDifferentParts) {
  Rig rig;
  for (int p = 0; p < 3; ++p) {
    Part part;
    part.points.resize(3, 3);
    part.points << 0, 0, 0, 1, 0, 0, 1, 0, 0;  // the last two are copies
    rig.parts.push_back(part);
  }
  rig.parts[0].role = PartRole::Simulated;
  PhysicsSkin skin;
  skin.surface.points.resize(2, 3);
  skin.surface_of_vertex = {0, 1, 1, -1, -1, -1, -1, -1, -1};
  rig.parts[2].weights = {{{0, 1.0}}, {{0, 1.0}}, {{1, 1.0}}};  // its copies follow different joints
  EXPECT_THAT(moving_together(rig, skin), ElementsAre(0, 1, 1, 2, 3, 3, 4, 5, 6));
}

}  // namespace
}  // namespace sinew::assets
