#include "fem/body/body.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/fem/arm.h"
#include "tests/lattice/shapes.h"

namespace sinew::fem {
namespace {

using lattice::Points;
using tests::kDegree;

TEST(FrameWeights, AreBetweenZeroAndOneAndSumToOne) {
  for (lattice::CellType type :
       {lattice::CellType::Hexahedron, lattice::CellType::Wedge, lattice::CellType::Tetrahedron}) {
    const Body body = tests::arm_body(tests::make_arm(type), 2.0);
    for (int a = 0; a < body.mesh.num_vertices(); ++a) {
      double sum = 0.0;
      for (FrameWeights::InnerIterator it(body.weights, a); it; ++it) {
        EXPECT_GE(it.value(), 0.0);
        EXPECT_LE(it.value(), 1.0 + 1e-15);
        sum += it.value();
      }
      EXPECT_NEAR(sum, 1.0, 1e-14);  // two weights of at most eight terms each
    }
  }
}

TEST(FrameWeights, AreThoseOfTheirBonesAndShareAJoint) {
  const Body body = tests::arm_body(tests::make_arm(), 2.0);
  int on_bones = 0;
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    const auto x = body.mesh.points.row(a);
    if (x.tail<2>().norm() > 1e-12 || x[0] < -1e-9 || x[0] > 1.0 + 1e-9) continue;
    ++on_bones;
    // Level-0 bone vertices are fixed; between them the mean. So 1/2 at the joint, 3/4 and 1/4 half a piece
    // away.
    const double lower = std::abs(x[0] - 0.5) < 0.09 ? 0.5 + (x[0] - 0.5) * 5.0 : x[0] > 0.5 ? 1.0 : 0.0;
    EXPECT_NEAR(body.weights.coeff(a, 1), lower, 1e-12) << x;
  }
  EXPECT_EQ(on_bones, 21);
}

// (L + D) s = D sbar row by row, with the edges of the box and the skin's hats found here again. Weights
// under 1e-3 are dropped and the rest scaled up, which moves a row of about 6 edges by at most 7e-3.
TEST(FrameWeights, SolveTheirEquationAtFreeVertices) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 2.0);
  const int n = body.hierarchy.num_vertices(0);
  ASSERT_EQ(n, 13 * 3 * 3);
  const Points& x = body.hierarchy.points();
  Eigen::VectorXd s(n), d = Eigen::VectorXd::Zero(n), right = Eigen::VectorXd::Zero(n);
  // Cells beyond the wrist hold no flesh: their vertices are gone, and so are the edges to them.
  const auto leaf_of = [&](int a) { return body.mesh.leaf_of_vertex[static_cast<std::size_t>(a)]; };
  for (int a = 0; a < n; ++a) s[a] = leaf_of(a) < 0 ? 0.0 : body.weights.coeff(leaf_of(a), 1);
  const Eigen::Array3d cell(0.1, 0.12, 0.12);
  for (Eigen::Index k = 0; k < arm.skin.points.rows(); ++k) {
    for (int a = 0; a < n; ++a) {  // trilinear hats of a regular box
      const Eigen::Array3d offset = (arm.skin.points.row(k) - x.row(a)).transpose().array() / cell;
      const double hat = (1.0 - offset.abs()).max(0.0).prod();
      d[a] += hat;
      right[a] += hat * arm.skin.weights[static_cast<std::size_t>(k)][1].weight;
    }
  }
  for (int a = 0; a < n; ++a) {
    if (leaf_of(a) < 0 || body.bones.is_bone[static_cast<std::size_t>(leaf_of(a))]) continue;
    double residual = d[a] * s[a] - right[a];
    for (int b = 0; b < n; ++b) {
      const double distance = ((x.row(a) - x.row(b)).transpose().array() / cell).matrix().lpNorm<1>();
      if (leaf_of(b) >= 0 && std::abs(distance - 1.0) < 1e-6) residual += s[a] - s[b];
    }
    EXPECT_NEAR(residual, 0.0, 7e-3) << x.row(a);
  }
}

TEST(Regions, WeightsAreNotNegativeAndSumToOne) {
  const tests::Arm arm = tests::make_arm();
  for (const auto& [degrees, count] : {std::pair{5.0, 1u}, {25.0, 2u}, {60.0, 3u}, {89.0, 3u}, {91.0, 4u}}) {
    // Frames that turn less than 10 degrees share a region, less than 30 have no joint region, and beyond 90
    // two.
    const Body body = tests::arm_body(arm, degrees * kDegree);
    EXPECT_EQ(body.regions.size(), count) << degrees;
    std::vector<double> sums(static_cast<std::size_t>(body.mesh.num_vertices()), 0.0);
    for (const Region& region : body.regions) {
      EXPECT_TRUE(std::is_sorted(region.vertices.begin(), region.vertices.end()));
      for (std::size_t k = 0; k < region.vertices.size(); ++k) {
        EXPECT_GT(region.weights[k], 0.0);
        sums[static_cast<std::size_t>(region.vertices[k])] += region.weights[k];
      }
    }
    for (double sum : sums) EXPECT_NEAR(sum, 1.0, 1e-15);
  }
}

double weight_at(const Region& region, int vertex) {
  const auto found = std::lower_bound(region.vertices.begin(), region.vertices.end(), vertex);
  if (found == region.vertices.end() || *found != vertex) return 0.0;
  return region.weights[static_cast<std::size_t>(found - region.vertices.begin())];
}

// The elbow's plane is x = 1/2; the skin's median distance from the bone is that of points at (0.1, 0.05),
// 0.1118 m. Along the bone w_J = 1 - |z|/L with one joint region; with two, hats that peak at -1/3 and 1/3 of
// L.
TEST(Regions, FallOffLinearlyAcrossAJoint) {
  const tests::Arm arm = tests::make_arm();
  const double half_width = std::hypot(0.1, 0.05);
  for (double degrees : {60.0, 120.0}) {
    const Body body = tests::arm_body(arm, degrees * kDegree);
    for (int a = 0; a < body.mesh.num_vertices(); ++a) {
      const auto x = body.mesh.points.row(a);
      if (x.tail<2>().norm() > 0.15) continue;  // inside the joint's reach
      const double theta = std::clamp((x[0] - 0.5) / half_width, -1.0, 1.0);
      const auto hat = [&](double peak) { return std::max(0.0, 1.0 - 1.5 * std::abs(theta - peak)); };
      const std::vector<double> expected =
          degrees < 90.0
              ? std::vector<double>{std::max(-theta, 0.0), std::max(theta, 0.0), 1.0 - std::abs(theta)}
              : std::vector<double>{hat(-1.0), hat(1.0), hat(-1.0 / 3.0), hat(1.0 / 3.0)};
      for (std::size_t i = 0; i < expected.size(); ++i)
        EXPECT_NEAR(weight_at(body.regions[i], a), expected[i], 1e-9) << x << ", region " << i;
    }
  }
}

// Away from the joints, where nothing but the frame weights tells whose flesh it is: as they go from one
// frame to the other, region weights follow in small steps. With a single owner they jump by 1.
TEST(Regions, GoFromOneOwnerToTheNextWithoutAJump) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 120 * kDegree);
  const LimbRadii radii(arm.lattice, body.tree, arm.skin, arm.lattice.edge_length);
  const FrameBends bends = judge_bends(body.tree, {pose_frames(body.tree, tests::arm_pose(0.0), 0.0),
                                                   pose_frames(body.tree, tests::arm_pose(2.1), 0.0)});
  RegionOptions options;
  options.joints = false;
  const int n = body.mesh.num_vertices();
  Eigen::MatrixXd first, last;
  double widest = 0.0;
  for (int step = 0; step <= 100; ++step) {
    const double share = 0.01 * step;
    FrameWeights weights(n, 2);
    for (int a = 0; a < n; ++a) {
      if (step < 100) weights.insert(a, 0) = 1.0 - share;
      if (step > 0) weights.insert(a, 1) = share;
    }
    Eigen::MatrixXd now = Eigen::MatrixXd::Zero(n, 2);
    for (const Region& region :
         make_regions(arm.lattice, body.tree, radii, body.mesh, weights, bends, options)) {
      for (std::size_t k = 0; k < region.vertices.size(); ++k)
        now(region.vertices[k], region.first) = region.weights[k];
    }
    if (step == 0) first = now;
    if (step > 0) widest = std::max(widest, (now - last).cwiseAbs().maxCoeff());
    last = now;
  }
  EXPECT_NEAR((last - first).col(1).minCoeff(), 1.0, 1e-12);  // all of them have gone over
  EXPECT_LE(widest, 0.1);  // measured 0.08: steepest where both weigh alike
}

TEST(Regions, StandBetweenTheirFrames) {
  const Body body = tests::arm_body(tests::make_arm(), 120 * kDegree);
  Eigen::Affine3d base(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitY()));
  base.pretranslate(Eigen::Vector3d(1.0, 2.0, 3.0));
  const PosedFrames posed = pose_frames(body.tree, tests::arm_pose(1.2, base), 0.0);
  for (const Region& region : body.regions) {
    const RegionTransform t = transform_of(region, posed);
    const double share = region.first == region.second ? region.first : region.t;
    const Eigen::Matrix3d expected =
        base.linear() * Eigen::AngleAxisd(1.2 * share, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    EXPECT_LE((t.rotation - expected).cwiseAbs().maxCoeff(), 1e-14);
    EXPECT_LE((t.from_rest.linear() - expected).cwiseAbs().maxCoeff(), 1e-14);
    const Eigen::Vector3d origin =
        base * region.origin_rest;  // shoulder or elbow: neither moves with the bend
    EXPECT_LE((t.origin - origin).norm(), 1e-14);
    EXPECT_LE((t.from_rest * region.origin_rest - origin).norm(), 1e-14);
  }
}

TEST(PolarRotation, IsTheRotationOfAStretchedOrMirroredMap) {
  std::mt19937_64 rng(61);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d axis = tests::uniform_point(rng, -1.0, 1.0).normalized();
    const Eigen::Matrix3d rotation =
        Eigen::AngleAxisd(tests::uniform(rng, -3.0, 3.0), axis).toRotationMatrix();
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(tests::uniform(rng, -3.0, 3.0), axis).toRotationMatrix();
    // Condition below 10, so rounding is some 100 eps.
    const Eigen::Vector3d stretch = tests::uniform_point(rng, 0.2, 2.0);
    const Eigen::Matrix3d symmetric = turn * stretch.asDiagonal() * turn.transpose();
    EXPECT_LE((polar_rotation(rotation * symmetric) - rotation).cwiseAbs().maxCoeff(), 1e-13);
    EXPECT_NEAR(polar_rotation(-rotation * symmetric).determinant(), 1.0, 1e-14);
  }
}

TEST(Ties, PullNothingThatMovesWithItsBoneAndWeighTheTube) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 2.0);
  ASSERT_EQ(body.ties.size(), 2u);
  // Everything moves by one affine map: P x is then the sum of the ties' targets.
  Eigen::Affine3d map(Eigen::AngleAxisd(0.9, Eigen::Vector3d(0.0, 0.6, 0.8)));
  map.pretranslate(Eigen::Vector3d(0.3, -2.0, 1.0));
  const Points x = (body.mesh.points * map.linear().transpose()).rowwise() + map.translation().transpose();
  const Points pulled = apply_tie(body.matrices, x);
  Points target = Points::Zero(x.rows(), 3);
  double stiffness = 0.0;
  for (const Tie& tie : body.ties) {
    for (std::size_t k = 0; k < tie.vertices.size(); ++k) {
      target.row(tie.vertices[k]) +=
          (tie.zeroth[k] * (map * tie.centre_rest) + map.linear() * tie.first[k]).transpose();
      stiffness += tie.zeroth[k];
    }
  }
  EXPECT_LE((pulled - target).cwiseAbs().maxCoeff(), 1e-12 * pulled.cwiseAbs().maxCoeff());
  // r = max(0.25 * 0.1118, 0.25 * 0.12) = 0.03, kappa = 10 mu / r^2 over two tubes of 0.5 m with round ends.
  // Samples stand 0.015 apart, half a radius: the tube's volume is good to a third.
  const double radius = 0.03, mu = body.materials[0].mu();
  const double tubes = M_PI * radius * radius * (1.0 + 8.0 / 3.0 * radius);
  EXPECT_NEAR(stiffness, 10.0 * mu / (radius * radius) * tubes, stiffness / 3.0);
}

TEST(LimbRadii, AreTheMedianDistanceOfTheSkin) {
  const tests::Arm arm = tests::make_arm();
  const FrameTree tree = frame_tree(arm.lattice, arm.skeleton);
  const LimbRadii radii(arm.lattice, tree, arm.skin, 0.12);
  // Round a square of half-width 0.1, points every 0.05: distances 0.1 (a quarter of them), 0.1118 (half),
  // 0.1414.
  EXPECT_NEAR(radii.of_bone(0), std::hypot(0.1, 0.05), 1e-12);
  EXPECT_NEAR(radii.near(1, 0.25), std::hypot(0.1, 0.05), 1e-12);
  lattice::Surface bare = arm.skin;
  for (auto& influences : bare.weights) influences = {{0, 1.0}};
  // No skin counts for the forearm: a tenth of its length.
  EXPECT_NEAR(LimbRadii(arm.lattice, tree, bare, 0.12).of_bone(1), 0.05, 1e-15);
}

TEST(MakeBody, DropsCellsWithoutFlesh) {
  const Body tight = tests::arm_body(tests::make_arm(), 2.0);
  const Body wide = tests::arm_body(tests::make_arm(lattice::CellType::Hexahedron, 2), 2.0);
  const auto centre_distance = [](const Body& body) {
    double farthest = 0.0;
    for (const auto& cell : body.mesh.cells) {
      const Eigen::RowVector3d centre = lattice::hex_corners(body.mesh.points, cell).colwise().mean();
      farthest = std::max(farthest, centre.tail<2>().cwiseAbs().maxCoeff());
    }
    return farthest;
  };
  EXPECT_LT(centre_distance(wide), 0.12);  // nothing beyond the cells round the flesh
  EXPECT_EQ(wide.mesh.cells.size(), tight.mesh.cells.size());
  EXPECT_NEAR(wide.volume, tight.volume, 1e-12);
  // 0.04 m^3 of box. Samples every 0.025 and 0.03 m, the faces between them: a fifth at most.
  EXPECT_NEAR(tight.volume, 0.04, 0.2 * 0.04);
}

TEST(MakeBody, NamesTheOptionAtFault) {
  const auto message = [](const auto& change) -> std::string {
    BodyOptions options;
    change(options);
    try {
      options.validate();
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message([](BodyOptions&) {}), "");
  EXPECT_EQ(message([](BodyOptions& o) { o.levels = 4; }), "levels: got 4.000000, expected 0 to 3");
  EXPECT_EQ(message([](BodyOptions& o) { o.material.young = 0.0; }),
            "young: got 0.000000, expected a positive number of pascals");
  EXPECT_EQ(message([](BodyOptions& o) { o.material.poisson = 0.5; }),
            "poisson: got 0.500000, expected -1 < nu < 0.5");
  EXPECT_EQ(message([](BodyOptions& o) { o.material.density = std::nan(""); }),
            "density: got nan, expected a positive number of kg/m^3");
  EXPECT_EQ(message([](BodyOptions& o) { o.damping.ratio = -0.1; }), "damping: got -0.100000, expected >= 0");
}

TEST(MakeBody, RefusesASkinWithoutItsWeights) {
  const tests::Arm good = tests::make_arm();
  const auto message = [](const tests::Arm& arm,
                          std::vector<std::vector<Eigen::Affine3d>> poses) -> std::string {
    try {
      make_body({arm.lattice, arm.skin, arm.skeleton, poses});
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message(good, {tests::arm_pose(0.0)}), "");
  tests::Arm arm = good;
  arm.skin.weights.clear();
  EXPECT_THAT(message(arm, {tests::arm_pose(0.0)}),
              testing::HasSubstr("skin weights: got 0.000000, expected one list per vertex, "));
  arm = good;
  arm.skin.weights[7][0].frame = 3;
  EXPECT_EQ(message(arm, {tests::arm_pose(0.0)}), "skin weight's joint: got 3.000000, expected 0 to 2");
  EXPECT_EQ(message(good, {{}}), "pose: got 0.000000, expected one transform per joint, 3");
  arm = good;
  for (auto& bone : arm.lattice.bones) bone.frame = 9;
  EXPECT_EQ(message(arm, {tests::arm_pose(0.0)}), "lattice bone names joint 9, expected 0 to 2");
}

TEST(Damping, HasItsRatioAtItsFrequency) {
  const Damping damping{0.07, 5.0};
  const double w = 2.0 * M_PI * 5.0;
  EXPECT_NEAR(0.5 * (damping.alpha() / w + damping.beta() * w), 0.07, 1e-16);
}

}  // namespace
}  // namespace sinew::fem
