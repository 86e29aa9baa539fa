#include "fem/report/measures.h"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "tests/fem/arm.h"
#include "tests/lattice/shapes.h"

namespace sinew::fem {
namespace {

using lattice::Points;

Points moved(const Points& x, const Eigen::Affine3d& map) {
  return (x * map.linear().transpose()).rowwise() + map.translation().transpose();
}

TEST(Measures, ARigidDisplacementHasNoElasticEnergy) {
  std::mt19937_64 rng(51);
  const Body body = tests::arm_body(tests::make_arm(), 2.0);
  const Points still = Points::Zero(body.mesh.num_vertices(), 3);
  for (double far : {0.0, 1.0, 1000.0}) {
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d axis = tests::uniform_point(rng, -1.0, 1.0).normalized();
      Eigen::Affine3d map(Eigen::AngleAxisd(tests::uniform(rng, -3.0, 3.0), axis));
      map.pretranslate(far * tests::uniform_point(rng, -1.0, 1.0));
      const PosedFrames posed = pose_frames(body.tree, tests::arm_pose(0.0, map), 0.0);
      const Measures m = measure(body, moved(body.mesh.points, map), still, posed, Eigen::Vector3d::Zero());
      // Positions are rounded to eps (1 + far); over cells of 0.05 m that is a strain of e, worth E V e^2.
      const double strain = 40.0 * 2.3e-16 * (1.0 + 2.0 * far) / 0.05;
      EXPECT_LE(m.elastic, 5e4 * body.volume * strain * strain) << "far = " << far;
      EXPECT_LE(m.largest_strain, strain);
      EXPECT_NEAR(m.min_det, 1.0, 3.0 * strain);
      EXPECT_EQ(m.inverted_cells, 0);
      EXPECT_LE(m.bone_residual, 1e-15 * (1.0 + 2.0 * far));
    }
  }
}

// Flesh moved with its bones strains no tie; shifted from there by d, each gives kappa V / 2 |d|^2, whatever
// the tubes' shapes: kappa V is the sum of the tie's forces on a unit shift.
TEST(Measures, TiesStoreWhatAShiftAgainstTheBonesTakes) {
  const Body body = tests::arm_body(tests::make_arm(), 2.0);
  ASSERT_FALSE(body.ties.empty());
  const Points still = Points::Zero(body.mesh.num_vertices(), 3);
  const Eigen::Vector3d shift(0.01, -0.02, 0.03);
  double unit = 0.0;
  for (const Tie& tie : body.ties) {
    for (double force : tie.zeroth) unit += force;
  }
  for (double far : {0.0, 1000.0}) {
    Eigen::Affine3d map(Eigen::AngleAxisd(2.0, Eigen::Vector3d(0.6, 0.0, 0.8)));
    map.pretranslate(Eigen::Vector3d(far, 0.0, -far));
    const PosedFrames posed = pose_frames(body.tree, tests::arm_pose(0.0, map), 0.0);
    const auto ties = [&](const Points& x) {
      return measure(body, x, still, posed, Eigen::Vector3d::Zero()).ties;
    };
    const Points home = moved(body.mesh.points, map);
    const double expected = 0.5 * unit * shift.squaredNorm();
    // A place's last digit is eps (1 + far) of 1 m; energies of unit / 2 cancel.
    const double rounding = 20.0 * 2.3e-16 * unit + 20.0 * 2.3e-16 * (1.0 + 2.0 * far) * unit * shift.norm();
    EXPECT_NEAR(ties(home), 0.0, rounding);
    EXPECT_NEAR(ties(home.rowwise() + shift.transpose()), expected, rounding);
  }
}

// A constant stretch diag(1 + a, 1 + b, 1 + c) in the frame: every measure has a closed form.
TEST(Measures, OfAConstantStretchAreThoseOfTheClosedForm) {
  const Body body = tests::arm_body(tests::make_arm(), 2.0);
  const Eigen::Vector3d strain(0.02, -0.01, 0.03);
  const Eigen::Affine3d turn(Eigen::AngleAxisd(1.1, Eigen::Vector3d(0.6, 0.0, 0.8)));
  Eigen::Affine3d stretch = Eigen::Affine3d::Identity();
  stretch.linear().diagonal() += strain;
  const Eigen::Vector3d velocity(1.0, -2.0, 0.5), gravity(0.0, -9.81, 0.0);
  const PosedFrames posed = pose_frames(body.tree, tests::arm_pose(0.0, turn), 0.0);
  const Points v = Points::Ones(body.mesh.num_vertices(), 3) * velocity.asDiagonal();
  const Measures m = measure(body, moved(body.mesh.points, turn * stretch), v, posed, gravity);
  const Material material = body.materials[0];
  const double energy = body.volume * (material.mu() * strain.squaredNorm() +
                                       0.5 * material.lambda() * std::pow(strain.sum(), 2));
  EXPECT_NEAR(m.elastic, energy, 1e-10 * energy);  // rounding over cells, 1e-13 relative in strain
  EXPECT_NEAR(m.kinetic, 0.5 * 1000.0 * body.volume * velocity.squaredNorm(), 1e-9);
  EXPECT_NEAR(m.largest_speed, velocity.norm(), 1e-15);
  EXPECT_NEAR(m.largest_strain, 0.03, 1e-12);
  EXPECT_NEAR(m.min_det, (strain.array() + 1.0).prod(), 1e-12);
  // The bones stay behind: the farthest point, 1 m out, moved by the strain along the bone.
  EXPECT_NEAR(m.bone_residual, 0.02, 1e-12);
}

/// The first cell that is full of flesh.
std::size_t full_cell(const Body& body) {
  const auto found = std::find_if(body.fill.begin(), body.fill.end(), [](const auto& fill) {
    return *std::min_element(fill.begin(), fill.end()) > 0.99;
  });
  return static_cast<std::size_t>(found - body.fill.begin());
}

TEST(Measures, CountInvertedCellsAndNameTheWorst) {
  const Body body = tests::arm_body(tests::make_arm(), 2.0);
  Points x = body.mesh.points;
  const std::size_t full = full_cell(body);
  ASSERT_LT(full, body.mesh.cells.size());
  const lattice::HexVertices& cell = body.mesh.cells[full];
  x.row(cell[0]) += 1.5 * (x.row(cell[6]) - x.row(cell[0]));  // a corner pushed through its opposite
  const PosedFrames posed = pose_frames(body.tree, tests::arm_pose(0.0), 0.0);
  const Measures m = measure(body, x, Points::Zero(x.rows(), 3), posed, Eigen::Vector3d::Zero());
  EXPECT_LT(m.min_det, 0.0);
  EXPECT_GE(m.inverted_cells, 1);
  const auto& worst = body.mesh.cells[static_cast<std::size_t>(m.min_det_cell)];
  EXPECT_NE(std::find(worst.begin(), worst.end(), cell[0]), worst.end());
}

// The same cell in flesh that fills less than half of it is as inverted as before, but nobody could see it.
TEST(Measures, DoNotCountCellsThatHoldHardlyAnyFlesh) {
  Body body = tests::arm_body(tests::make_arm(), 2.0);
  Points x = body.mesh.points;
  const lattice::HexVertices& cell = body.mesh.cells[7];
  x.row(cell[0]) += 1.5 * (x.row(cell[6]) - x.row(cell[0]));
  for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
    const lattice::HexVertices& v = body.mesh.cells[c];
    if (std::find(v.begin(), v.end(), cell[0]) != v.end()) body.fill[c].fill(0.49);
  }
  const PosedFrames posed = pose_frames(body.tree, tests::arm_pose(0.0), 0.0);
  const auto measures = [&] {
    return measure(body, x, Points::Zero(x.rows(), 3), posed, Eigen::Vector3d::Zero());
  };
  EXPECT_EQ(measures().inverted_cells, 0);
  EXPECT_NEAR(measures().min_det, 1.0, 1e-12);  // all that is left stands at rest
  EXPECT_NEAR(measures().largest_strain, 0.0, 1e-12);
  body.fill[7].fill(0.5);
  EXPECT_EQ(measures().inverted_cells, 1);
  EXPECT_EQ(measures().min_det_cell, 7);
  for (lattice::FillFractions& fill : body.fill) fill.fill(0.1);
  EXPECT_EQ(measures().min_det, std::numeric_limits<double>::infinity());
  EXPECT_EQ(measures().min_det_cell, -1);
}

}  // namespace
}  // namespace sinew::fem
