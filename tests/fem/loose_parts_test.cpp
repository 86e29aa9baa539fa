// Parts of the skin that no bone reaches: a hat above the head, a button without weights.
#include <algorithm>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fem/time/simulation.h"
#include "lattice/build.h"
#include "tests/fem/arm.h"
#include "tests/lattice/limbs.h"

namespace sinew::fem {
namespace {

using Eigen::Vector3d;
using lattice::Points;

/// A limb of one bone along y from 0 to 0.8, and a ball above it.
struct WithBall {
  tests::Character character;
  int first = 0;  ///< vertex of the ball.

  explicit WithBall(bool weighted) {
    const int joint = character.add_joint("limb", -1, {0, 0, 0});
    character.add_joint("end", joint, {0, 0.8, 0});
    character.add_capsule(joint, {0, 0, 0}, {0, 0.8, 0}, 0.15);
    first = static_cast<int>(character.skin.points.rows());
    character.add_capsule(joint, {0, 1.6, 0}, {0, 1.65, 0}, 0.12);
    if (weighted) return;
    for (std::size_t v = static_cast<std::size_t>(first); v < character.skin.weights.size(); ++v)
      character.skin.weights[v].clear();
  }
};

TEST(LooseParts, AreTiedToTheJointThatMovesTheirSkin) {
  const WithBall scene(true);
  lattice::BuildOptions options;
  options.cells = 250;
  const lattice::BuildResult result = lattice::build(scene.character.skin, scene.character.joints, options);
  EXPECT_THAT(result.failures, testing::IsEmpty());
  ASSERT_EQ(result.lattice.soft_frames.size(), 1u);
  const lattice::SoftFrame& frame = result.lattice.soft_frames[0];
  EXPECT_EQ(frame.frame, 0);
  EXPECT_LT((frame.position - Vector3d(0, 1.625, 0)).norm(), 0.15) << "outside the ball";
  const auto& changes = result.lattice.changes;
  EXPECT_TRUE(std::any_of(changes.begin(), changes.end(), [](const lattice::SkeletonChange& change) {
    return change.joint == "limb" && change.what == "soft frame" &&
           change.reason.find("a separate part") != std::string::npos;
  }));

  // It goes with its joint: a quarter turn about z.
  std::vector<skeleton::Joint> joints(2);
  joints[0].name = "limb";
  joints[0].parent = -1;
  joints[1].name = "end";
  joints[1].parent = 0;
  for (Eigen::Affine3d* map : {&joints[1].rest_from_joint, &joints[1].parent_from_joint})
    map->translation() = Vector3d(0, 0.8, 0);
  joints[1].local.translation = Vector3d(0, 0.8, 0);
  const skeleton::Skeleton skeleton(joints);
  const Motion turn = [](double time) {
    const Eigen::Affine3d t(
        Eigen::AngleAxisd(0.5 * M_PI * tests::smooth_step(time / 0.5), Vector3d::UnitZ()));
    return std::vector<Eigen::Affine3d>(2, t);
  };
  BodyOptions flesh;
  flesh.material.young = 1e5;
  const std::vector<std::vector<Eigen::Affine3d>> poses{turn(0.0), turn(1.0)};
  const Body body = make_body({result.lattice, scene.character.skin, skeleton, poses}, flesh);
  Simulation simulation(body, turn, 0.0, {});
  ASSERT_EQ(simulation.settle().status, SimulationStatus::Ok);
  ASSERT_EQ(simulation.advance_to(1.5).status, SimulationStatus::Ok);
  const Points x = simulation.skin_of(simulation.positions_at(1.5));
  const Eigen::Index ball = x.rows() - scene.first;
  const Vector3d middle = x.bottomRows(ball).colwise().mean().transpose();
  const Vector3d rest = scene.character.skin.points.bottomRows(ball).colwise().mean().transpose();
  // Gravity and what is left of the swing: a quarter of the ball's radius.
  EXPECT_LT((middle - Vector3d(-rest.y(), rest.x(), rest.z())).norm(), 0.03);
}

TEST(LooseParts, WithoutAWeightAreReported) {
  const WithBall scene(false);
  lattice::BuildOptions options;
  options.cells = 250;
  options.max_retries = 0;
  const lattice::BuildResult result = lattice::build(scene.character.skin, scene.character.joints, options);
  ASSERT_FALSE(result.failures.empty());
  EXPECT_FALSE(result.failures[0].tolerable);
  EXPECT_THAT(result.failures[0].what,
              testing::HasSubstr("1 of 2 components hold neither a bone nor a soft frame"));
}

}  // namespace
}  // namespace sinew::fem
