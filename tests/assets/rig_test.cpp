#include "assets/rig.h"

#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "assets/lattice_input.h"

namespace sinew::assets {
namespace {

using testing::HasSubstr;

constexpr double kEps = std::numeric_limits<double>::epsilon();

skeleton::Joint joint(const std::string& name, int parent, const Eigen::Vector3d& rest) {
  skeleton::Joint j;
  j.name = name;
  j.parent = parent;
  j.rest_from_joint.translation() = rest;
  return j;
}

/// Three points of a plane; a fourth makes it a body.
Part triangle_part(const std::string& name, PartRole role) {
  Part part;
  part.name = name;
  part.role = role;
  part.points.resize(3, 3);
  part.points << 0, 0, 0, 2, 0, 0, 0, 1, 0;
  part.triangles.resize(1, 3);
  part.triangles << 0, 1, 2;
  return part;
}

/// A triangle half on the root and half on the tip, one that follows the tip rigidly and one that stands
/// still.
Rig small_rig() {
  Rig rig;
  rig.file = "small.glb";
  rig.skeleton = skeleton::Skeleton({joint("root", -1, {0, 0, 0}), joint("tip", 0, {1, 0, 0})});
  rig.parts = {triangle_part("flesh", PartRole::Simulated), triangle_part("hat", PartRole::Rigid),
               triangle_part("floor", PartRole::Rigid)};
  rig.parts[0].weights = {{{0, 1.0}}, {{0, 0.25}, {1, 0.75}}, {{1, 1.0}}};
  rig.parts[1].joint = 1;
  return rig;
}

TEST(Skin, BlendsTheJointsMapsByWeight) {
  const Rig rig = small_rig();
  std::vector<Eigen::Affine3d> maps(2, Eigen::Affine3d::Identity());
  maps[1].translation() << 0, 4, 0;
  const lattice::Points posed = skin(rig, maps);
  ASSERT_EQ(posed.rows(), 9);
  // flesh: the first corner stays, the second rises by 0.75 * 4, the third by 4; the hat rises; the floor
  // stays.
  lattice::Points expected(9, 3);
  expected << 0, 0, 0, 2, 3, 0, 0, 5, 0, 0, 4, 0, 2, 4, 0, 0, 5, 0, 0, 0, 0, 2, 0, 0, 0, 1, 0;
  EXPECT_EQ(posed, expected);
}

TEST(Skin, OfTheRestPoseIsTheRestMesh) {
  const Rig rig = small_rig();
  skeleton::Pose rest;
  for (const skeleton::Joint& j : rig.skeleton.joints()) rest.world_from_joint.push_back(j.rest_from_joint);
  const lattice::Points posed = skin(rig, skeleton::pose_from_rest(rig.skeleton, rest));
  for (int v = 0; v < 3; ++v) {
    EXPECT_LT((posed.row(v) - rig.parts[0].points.row(v)).norm(), 10 * kEps);
  }
}

TEST(Skin, RefusesTheWrongNumberOfJoints) { EXPECT_THROW(skin(small_rig(), {}), std::invalid_argument); }

/// A box of `n` x `n` quads a side, every triangle with corners of its own (as exporters write them), split
/// into two parts.
Rig exploded_box(int n, std::mt19937_64& rng) {
  Rig rig;
  rig.skeleton = skeleton::Skeleton({joint("root", -1, {0, 0, 0}), joint("tip", 0, {0, 1, 0})});
  std::vector<std::array<Eigen::Vector3d, 3>> soup;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      for (int i = 0; i < n; ++i) {
        for (int k = 0; k < n; ++k) {
          const auto corner = [&](int di, int dk) {
            Eigen::Vector3d p;
            p[axis] = side;
            p[(axis + 1) % 3] = -1.0 + 2.0 * (i + di) / n;
            p[(axis + 2) % 3] = -1.0 + 2.0 * (k + dk) / n;
            return p;
          };
          const Eigen::Vector3d a = corner(0, 0), b = corner(1, 0), c = corner(1, 1), d = corner(0, 1);
          soup.push_back(side > 0 ? std::array{a, b, c} : std::array{a, c, b});
          soup.push_back(side > 0 ? std::array{a, c, d} : std::array{a, d, c});
        }
      }
    }
  }
  for (int p = 0; p < 2; ++p) {
    Part part;
    part.name = "half" + std::to_string(p);
    part.role = PartRole::Simulated;
    const std::size_t half = soup.size() / 2;
    part.points.resize(static_cast<Eigen::Index>(3 * half), 3);
    part.triangles.resize(static_cast<Eigen::Index>(half), 3);
    for (std::size_t t = 0; t < half; ++t) {
      for (std::size_t c = 0; c < 3; ++c) {
        Eigen::Vector3d x = soup[static_cast<std::size_t>(p) * half + t][c];
        const double w = 0.5 + 0.5 * x.y();
        // Noise a hundred times below the welding distance of 1e-6 of the diagonal.
        for (int k = 0; k < 3; ++k) x[k] += 1e-8 * (static_cast<double>(rng() >> 11) * 0x1.0p-53 - 0.5);
        const auto v = static_cast<Eigen::Index>(3 * t + c);
        part.points.row(v) = x.transpose();
        part.triangles(static_cast<Eigen::Index>(t), static_cast<Eigen::Index>(c)) = static_cast<int>(v);
        // Influences in either order are the same weights.
        if (rng() % 2 == 0) {
          part.weights.push_back({{0, 1.0 - w}, {1, w}});
        } else {
          part.weights.push_back({{1, w}, {0, 1.0 - w}});
        }
      }
    }
    rig.parts.push_back(part);
  }
  return rig;
}

TEST(PhysicsSkin, WeldsASoupOfTrianglesAcrossPartsIntoAClosedSurface) {
  std::mt19937_64 rng(20021);
  for (const int n : {1, 2, 5}) {
    const Rig rig = exploded_box(n, rng);
    const PhysicsSkin physics = physics_skin(rig);
    // Euler: a closed quad grid on a box has 6 n^2 quads, hence 6 n^2 + 2 points; each quad is two triangles.
    EXPECT_EQ(physics.surface.points.rows(), 6 * n * n + 2);
    EXPECT_EQ(physics.surface.triangles.rows(), 12 * n * n);
    std::map<std::pair<int, int>, int> balance;
    for (Eigen::Index t = 0; t < physics.surface.triangles.rows(); ++t) {
      for (int c = 0; c < 3; ++c) {
        const int a = physics.surface.triangles(t, c), b = physics.surface.triangles(t, (c + 1) % 3);
        balance[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
      }
    }
    for (const auto& [edge, sum] : balance) EXPECT_EQ(sum, 0) << "edge " << edge.first << " " << edge.second;
  }
}

TEST(PhysicsSkin, MapsEveryVertexBackToItsOwnPlace) {
  std::mt19937_64 rng(20022);
  const Rig rig = exploded_box(4, rng);
  const PhysicsSkin physics = physics_skin(rig);
  ASSERT_EQ(static_cast<int>(physics.surface_of_vertex.size()), num_vertices(rig));
  std::size_t v = 0;
  for (const Part& part : rig.parts) {
    for (Eigen::Index i = 0; i < part.points.rows(); ++i, ++v) {
      const int s = physics.surface_of_vertex[v];
      ASSERT_GE(s, 0);
      // Welding moves a point by at most its tolerance, 1e-6 of the diagonal 2 sqrt(3).
      EXPECT_LT((physics.surface.points.row(s) - part.points.row(i)).norm(), 3.5e-6);
    }
  }
}

TEST(PhysicsSkin, KeepsPointsApartWhoseWeightsDiffer) {
  Rig rig = small_rig();
  rig.parts[1] = rig.parts[0];
  rig.parts[1].name = "other";
  EXPECT_EQ(physics_skin(rig).surface.points.rows(), 3);
  rig.parts[1].weights[0] = {{1, 1.0}};
  EXPECT_EQ(physics_skin(rig).surface.points.rows(), 4);
}

TEST(PhysicsSkin, LeavesOutPartsThatAreNotSimulatedAndDegenerateTriangles) {
  Rig rig = small_rig();
  rig.parts[0].triangles.conservativeResize(2, 3);
  rig.parts[0].triangles.row(1) << 1, 1, 2;
  const PhysicsSkin physics = physics_skin(rig);
  EXPECT_EQ(physics.surface.points.rows(), 3);
  EXPECT_EQ(physics.surface.triangles.rows(), 1);
  EXPECT_EQ(physics.surface_of_vertex, (std::vector<int>{0, 1, 2, -1, -1, -1, -1, -1, -1}));
}

/// small_rig() with a fourth point above its flesh.
Rig solid_rig() {
  Rig rig = small_rig();
  Part& flesh = rig.parts[0];
  flesh.points.conservativeResize(4, 3);
  flesh.points.row(3) << 0, 0, 1;
  flesh.weights.push_back({{0, 1.0}});
  return rig;
}

TEST(Thickness, IsTheExtentAlongTheThinnestAxisWhicheverWayItStands) {
  // A box of 3 x 2 x 0.1 in random orientations: its principal axes are its edges.
  std::mt19937_64 rng(20023);
  const auto uniform = [&rng] { return static_cast<double>(rng() >> 11) * 0x1.0p-52 - 1.0; };
  for (int trial = 0; trial < 50; ++trial) {
    lattice::Points box(8, 3);
    for (int i = 0; i < 8; ++i) box.row(i) << 3.0 * (i & 1), 2.0 * ((i >> 1) & 1), 0.1 * ((i >> 2) & 1);
    const Eigen::Quaterniond q = Eigen::Quaterniond(uniform(), uniform(), uniform(), uniform()).normalized();
    const lattice::Points turned = box * q.toRotationMatrix();
    EXPECT_NEAR(thickness(turned), 0.1, 1e-12);  // an eigenvector good to 1e-15 over 4 m
    box.col(2).setZero();
    EXPECT_LT(thickness(box * q.toRotationMatrix()), 1e-12);
  }
}

TEST(LatticeInput, RefusesAFlatSkin) {
  try {
    lattice_input(small_rig());
    FAIL() << "accepted";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("small.glb: skin: is flat and holds no flesh, got a thickness of"));
  }
}

TEST(LatticeInput, HasEveryJointAtItsRestPlace) {
  const LatticeInput input = lattice_input(solid_rig());
  EXPECT_EQ(input.joints.names, (std::vector<std::string>{"root", "tip"}));
  EXPECT_EQ(input.joints.parents, (std::vector<int>{-1, 0}));
  EXPECT_EQ(input.joints.positions.row(1), Eigen::RowVector3d(1, 0, 0));
}

TEST(LatticeInput, NeedsFlesh) {
  Rig rig = small_rig();
  rig.parts.erase(rig.parts.begin());
  try {
    lattice_input(rig);
    FAIL() << "accepted a rig without flesh";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("small.glb: skin: no triangle hangs on a joint"));
  }
  rig.parts.clear();
  EXPECT_THAT([&] { lattice_input(rig); },
              testing::ThrowsMessage<InputError>(HasSubstr("small.glb: mesh: there is none, expected")));
}

skeleton::Clip clip(const std::string& name, int num_keys, double end) {
  skeleton::Clip c;
  c.name = name;
  c.num_keys = num_keys;
  c.end = end;
  return c;
}

TEST(ChooseClip, TakesTheFirstThatMovesUnlessOneIsNamed) {
  Rig rig = small_rig();
  rig.clips = {clip("pose", 1, 0.0), clip("still", 2, 0.0), clip("walk", 2, 1.0), clip("run", 9, 2.0)};
  EXPECT_EQ(choose_clip(rig, ""), 2);
  EXPECT_EQ(choose_clip(rig, "run"), 3);
  EXPECT_EQ(choose_clip(rig, "pose"), 0);
  // Where nothing moves, the first with a key is a pose.
  rig.clips = {clip("empty", 0, 0.0), clip("pose", 1, 0.0), clip("other", 1, 0.0)};
  EXPECT_EQ(choose_clip(rig, ""), 1);
}

TEST(ChooseClip, SaysWhatIsWrongWithAFaultyOneWhenItIsAskedFor) {
  Rig rig = small_rig();
  rig.clips = {clip("walk", 2, 1.0)};
  rig.faulty_clips = {{"run", "clip 'run': torn; hint: mend it", 0}};
  EXPECT_EQ(choose_clip(rig, ""), 0);
  try {
    choose_clip(rig, "run");
    FAIL() << "took a faulty clip";
  } catch (const InputError& e) {
    EXPECT_STREQ(e.what(), "small.glb: clip 'run': torn; hint: mend it");
  }
}

TEST(ChooseClip, NamesTheClipsThereAre) {
  Rig rig = small_rig();
  rig.clips = {clip("pose", 1, 0.0), clip("walk", 2, 1.0)};
  try {
    choose_clip(rig, "wlak");
    FAIL() << "found a clip that is not there";
  } catch (const ConfigError& e) {
    EXPECT_STREQ(
        e.what(),
        "small.glb: clip 'wlak': not in the file, which has 'pose', 'walk'; hint: name one of these, or "
        "none for the first that moves");
  }
  rig.clips = {clip("empty", 0, 0.0)};
  try {
    choose_clip(rig, "");
    FAIL() << "took a clip without motion";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("small.glb: clips: no motion, got 'empty'"));
  }
}

}  // namespace
}  // namespace sinew::assets
