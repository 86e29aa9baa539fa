// What a user says of single bones and regions of the lattice: pulls, regions of the flesh, materials.
#include <gtest/gtest.h>

#include "tests/fem/arm.h"

namespace sinew::fem {
namespace {

double total(const Tie& tie) {
  double sum = 0.0;
  for (const double p : tie.zeroth) sum += p;
  return sum;
}

TEST(Painting, GivesOneBoneAThickerAndStifferPull) {
  const tests::Arm arm = tests::make_arm();
  const Body plain = tests::arm_body(arm, 2.0);
  BodyOptions options;
  options.ties.joints = {{1, 0.02, 1.0}, {1, 0.06, 30.0}};
  const Body body = tests::arm_body(arm, 2.0, options);
  ASSERT_EQ(body.ties.size(), 2u);
  EXPECT_EQ(body.ties[0].zeroth, plain.ties[0].zeroth) << "the other bone";
  // kappa = c mu / r^2 times the volume of a tube of 0.5 m with round ends, of which one lies in the flesh
  // beyond the wrist's end and one in the upper arm. Samples stand 0.015 apart, a quarter of the radius.
  const double r = 0.06,
               expected = 30.0 * body.materials[0].mu() / (r * r) * M_PI * r * r * (0.5 + 4.0 / 3.0 * r);
  EXPECT_NEAR(total(body.ties[1]), expected, 0.1 * expected);
  options.ties.joints = {{1, -0.1, {}}};
  EXPECT_THROW(tests::arm_body(arm, 2.0, options), std::invalid_argument);
}

TEST(Painting, RefusesJointsThatAreNotThere) {
  const tests::Arm arm = tests::make_arm();  // of three joints
  for (const int joint : {-1, 3}) {
    BodyOptions of_material, of_tie, of_region;
    of_material.materials = {{joint, {}}};
    of_tie.ties.joints = {{joint, 0.1, {}}};
    of_region.regions.groups = {{0, joint}};
    for (const BodyOptions& options : {of_material, of_tie, of_region})
      EXPECT_THROW(tests::arm_body(arm, 1.0, options), std::invalid_argument) << joint;
  }
}

TEST(Painting, PutsBonesInTheRegionsThatTheUserWants) {
  const tests::Arm arm = tests::make_arm();
  EXPECT_EQ(tests::arm_body(arm, 1.0).regions.size(), 3u) << "both bones and the elbow between them";
  BodyOptions options;
  options.regions.groups = {{0, 1}};
  const Body one = tests::arm_body(arm, 1.0, options);
  ASSERT_EQ(one.regions.size(), 1u);
  EXPECT_EQ(one.regions[0].first, 0) << "the topmost leads";
  EXPECT_EQ(tests::arm_body(arm, 0.0).regions.size(), 1u) << "nothing turns";
  options.regions.groups = {{1}};
  EXPECT_EQ(tests::arm_body(arm, 0.0, options).regions.size(), 2u);
}

TEST(Painting, GivesTheCellsOfARegionTheirMaterial) {
  tests::Arm arm = tests::make_arm();
  for (const lattice::Cell& cell : arm.lattice.complex.cells) {
    double x = 0.0;
    for (int k = 0; k < 8; ++k) x += 0.125 * arm.lattice.complex.points(cell.vertices[k], 0);
    arm.lattice.regions.push_back(x < 0.2 ? 7 : x < 0.8 ? -1 : 9);
  }
  BodyOptions options;
  options.materials = {{0, {3e4, 0.4, 900.0}}};
  options.region_materials = {{7, 1e4, {}, {}}, {9, {}, 0.3, 1200.0}, {9, {}, 0.35, {}}};
  const Body body = tests::arm_body(arm, 2.0, options);
  int sevens = 0, nines = 0;
  for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
    const double x = lattice::hex_corners(body.mesh.points, body.mesh.cells[c]).col(0).mean();
    const Material& m = body.materials[c];
    if (x < 0.2) {
      ++sevens;
      EXPECT_EQ(m.young, 1e4);
      EXPECT_EQ(m.poisson, 0.4) << "of the bone's flesh";
      EXPECT_EQ(m.density, 900.0);
    } else if (x > 0.8) {
      ++nines;
      EXPECT_EQ(m.young, 5e4);
      EXPECT_EQ(m.poisson, 0.35) << "the later one";
      EXPECT_EQ(m.density, 1200.0);
    } else {
      EXPECT_EQ(m.young, x < 0.5 ? 3e4 : 5e4);
    }
  }
  EXPECT_GT(sevens, 0);
  EXPECT_GT(nines, 0);
  // Their mass follows: 900, 1000 and 1200 kg/m^3 over 0.5, 0.3 and 0.2 m instead of 1000 everywhere. Cells
  // at the ends hold a little more flesh than those between.
  const auto mass = [](const Body& of) {
    double sum = 0.0;
    for (const double m : of.vertex_mass) sum += m;
    return sum;
  };
  EXPECT_NEAR(mass(body) / mass(tests::arm_body(arm, 2.0)), 0.5 * 0.9 + 0.3 + 0.2 * 1.2, 0.01);
}

TEST(Painting, ShowsWhatABodyIsMadeOf) {
  const tests::Arm arm = tests::make_arm();
  const std::vector<std::vector<Eigen::Affine3d>> poses{tests::arm_pose(0.0), tests::arm_pose(1.0)};
  BodyOptions options;
  options.materials = {{1, {3e4, 0.4, 900.0}}};
  const BodyInput input{arm.lattice, arm.skin, arm.skeleton, poses};
  const Body whole = make_body(input, options), painted = paint_body(input, options);
  EXPECT_EQ(painted.fill, whole.fill);
  ASSERT_EQ(painted.materials.size(), whole.materials.size());
  for (std::size_t c = 0; c < whole.materials.size(); ++c)
    EXPECT_EQ(painted.materials[c].young, whole.materials[c].young);
  ASSERT_EQ(painted.regions.size(), whole.regions.size());
  for (std::size_t r = 0; r < whole.regions.size(); ++r)
    EXPECT_EQ(painted.regions[r].weights, whole.regions[r].weights);
  EXPECT_TRUE(painted.matrices.stiffness.empty());
}

}  // namespace
}  // namespace sinew::fem
