#include "lattice/mirror_map.h"

#include <gtest/gtest.h>

#include "lattice/build.h"
#include "tests/lattice/limbs.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

/// A trunk with a hand of two fingers at either side: they share cells. Its triangles are not mirrored, its
/// vertices are.
tests::Character two_hands() {
  tests::Character c;
  const int trunk = c.add_joint("trunk", -1, {0, 0, 0});
  c.add_joint("head", trunk, {0, 0.6, 0});
  c.add_capsule(trunk, {0, 0, 0}, {0, 0.6, 0}, 0.2);
  for (const double side : {-1.0, 1.0}) {
    const std::string name = side < 0 ? "left" : "right";
    const int hand = c.add_joint(name + "_hand", trunk, {0.5 * side, 0.3, 0});
    c.add_capsule(trunk, {0, 0.3, 0}, {0.5 * side, 0.3, 0}, 0.12);
    for (const double z : {-0.1, 0.1}) {
      const int finger = c.add_joint(name + (z < 0 ? "_back" : "_front"), hand, {0.6 * side, 0.3, z});
      c.add_joint(c.joints.names.back() + "_tip", finger, {1.3 * side, 0.3, z});
      c.add_capsule(finger, {0.5 * side, 0.3, z}, {1.3 * side, 0.3, z}, 0.08);
    }
  }
  return c;
}

class MirrorMapOfHands : public testing::Test {
 protected:
  tests::Character hands_ = two_hands();
  BuildResult built_ = build(hands_.skin, hands_.joints, {.cells = 250});
};

TEST_F(MirrorMapOfHands, PairsVerticesCellsCopiesAndBones) {
  const ControlLattice& lattice = built_.lattice;
  ASSERT_TRUE(built_.mirror) << built_.no_mirror;
  ASSERT_GE(lattice.copies.size(), 20u);
  const std::optional<MirrorMap> map = find_mirror_map(lattice, hands_.skin);
  ASSERT_TRUE(map);
  const auto image = [&](int vertex) -> Vector3d {
    return {-lattice.complex.points(vertex, 0), lattice.complex.points(vertex, 1),
            lattice.complex.points(vertex, 2)};
  };
  for (int v = 0; v < lattice.complex.points.rows(); ++v) {
    const int partner = map->vertices[static_cast<std::size_t>(v)];
    EXPECT_EQ(map->vertices[static_cast<std::size_t>(partner)], v);
    EXPECT_LT((lattice.complex.points.row(partner).transpose() - image(v)).norm(), 1e-9);
  }
  for (std::size_t c = 0; c < lattice.complex.cells.size(); ++c) {
    std::set<int> expected, partner;
    for (std::size_t k = 0; k < 4; ++k) {
      expected.insert(map->vertices[static_cast<std::size_t>(lattice.complex.cells[c].vertices[k])]);
      partner.insert(lattice.complex.cells[static_cast<std::size_t>(map->cells[c])].vertices[k]);
    }
    EXPECT_EQ(partner, expected) << "cell " << c;
  }
  for (std::size_t b = 0; b < lattice.bones.size(); ++b) {
    const LatticeBone& partner = lattice.bones[static_cast<std::size_t>(map->bones[b])];
    std::vector<int> chain;
    for (int v : lattice.bones[b].chain) chain.push_back(map->vertices[static_cast<std::size_t>(v)]);
    EXPECT_EQ(partner.chain, chain) << lattice.bones[b].name;
    EXPECT_EQ(map->frames[static_cast<std::size_t>(lattice.bones[b].frame)], partner.frame);
  }
}

TEST_F(MirrorMapOfHands, MatchesTheMeansOfParentsOnFinerLevels) {
  const Hierarchy hierarchy(built_.lattice.complex, 2);
  const std::optional<MirrorMap> map = find_mirror_map(built_.lattice, hands_.skin);
  ASSERT_TRUE(map);
  const std::vector<int> partner = mirrored_vertices(hierarchy, *map);
  ASSERT_EQ(partner.size(), static_cast<std::size_t>(hierarchy.num_vertices()));
  for (int v = 0; v < hierarchy.num_vertices(); ++v) {
    const Eigen::RowVector3d p = hierarchy.points().row(v);
    // A few roundings of coordinates of size 1.
    EXPECT_LT((hierarchy.points().row(partner[static_cast<std::size_t>(v)]) -
               Eigen::RowVector3d(-p.x(), p.y(), p.z()))
                  .norm(),
              1e-14);
  }
}

TEST_F(MirrorMapOfHands, FindsNoneWhereAVertexABoneOrAWeightDiffers) {
  ControlLattice moved = built_.lattice;
  moved.complex.points(moved.bones[0].chain[0] == 0 ? 1 : 0, 1) += 1e-6;
  EXPECT_FALSE(find_mirror_map(moved, hands_.skin));
  Surface painted = hands_.skin;
  std::fill(painted.weights.end() - 50, painted.weights.end(), std::vector<Influence>{{0, 1.0}});
  EXPECT_FALSE(find_mirror_map(built_.lattice, painted));
  ControlLattice bare = built_.lattice;
  bare.bones.pop_back();
  EXPECT_FALSE(find_mirror_map(bare, hands_.skin));
}

/// Two legs that overlap in the plane of symmetry, where their skin hangs on both thighs alike.
tests::Character touching_legs() {
  tests::Character c;
  const int pelvis = c.add_joint("pelvis", -1, {0, 1.2, 0});
  c.add_capsule(pelvis, {0, 1.0, 0}, {0, 1.4, 0}, 0.2);
  std::vector<int> thighs;
  for (const double side : {-1.0, 1.0}) {
    const std::string name = side < 0 ? "left" : "right";
    const int hip = c.add_joint(name + "_hip", pelvis, {0.1 * side, 1.0, 0});
    const int knee = c.add_joint(name + "_knee", hip, {0.1 * side, 0.5, 0});
    c.add_joint(name + "_foot", knee, {0.1 * side, 0.0, 0});
    c.add_capsule(hip, {0.1 * side, 1.0, 0}, {0.1 * side, 0.5, 0}, 0.14);
    c.add_capsule(knee, {0.1 * side, 0.5, 0}, {0.1 * side, 0.0, 0}, 0.14);
    thighs.push_back(hip);
  }
  for (std::size_t v = 0; v < c.skin.weights.size(); ++v)
    if (c.skin.weights[v][0].frame != pelvis && std::abs(c.skin.points(static_cast<int>(v), 0)) < 1e-9)
      c.skin.weights[v] = {{thighs[0], 0.5}, {thighs[1], 0.5}};
  return c;
}

// Of two thighs that weigh alike one comes first, and which triangles cross a cell depends on how they are
// split: unless both sides count, some cells get copies on one side only.
TEST(MirrorMap, PairsCellsWhereLimbsMeetInThePlane) {
  const tests::Character legs = touching_legs();
  for (const int cells : {320, 580}) {
    const BuildResult built = build(legs.skin, legs.joints, {.cells = cells});
    ASSERT_TRUE(built.mirror) << built.no_mirror;
    EXPECT_TRUE(find_mirror_map(built.lattice, legs.skin)) << cells;
  }
}

}  // namespace
}  // namespace sinew::lattice
