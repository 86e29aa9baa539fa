// Limbs that are kin and lie in one place: a copy of the cell for each that flesh keeps apart.
#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <utility>

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
using lattice::ControlLattice;
using lattice::Points;

constexpr double kRadius = 0.1;  ///< of a thigh [m].

/// Two thighs under one pelvis joint that carries no skin, `gap` apart: each a closed piece on its own joint.
struct Thighs {
  tests::Character character;
  skeleton::Skeleton skeleton;
  std::array<std::vector<int>, 2> vertices;

  explicit Thighs(double gap) {
    const double x = kRadius + 0.5 * gap;
    character.add_joint("pelvis", -1, {0, 1.1, 0});
    for (int side = 0; side < 2; ++side) {
      const Vector3d hip(side == 0 ? -x : x, 1.0, 0.0), knee(hip.x(), 0.3, 0.0);
      const int first = static_cast<int>(character.skin.points.rows());
      const int joint = character.add_joint(side == 0 ? "left" : "right", 0, hip);
      character.add_capsule(joint, hip, knee, kRadius);
      for (int v = first; v < character.skin.points.rows(); ++v)
        vertices[static_cast<std::size_t>(side)].push_back(v);
    }
    std::vector<skeleton::Joint> joints;
    for (int j = 0; j < 3; ++j) {
      skeleton::Joint& joint = joints.emplace_back();
      const Vector3d at = character.joints.positions.row(j).transpose();
      joint.name = character.joints.names[static_cast<std::size_t>(j)];
      joint.parent = character.joints.parents[static_cast<std::size_t>(j)];
      joint.rest_from_joint.translation() = at;
      joint.parent_from_joint.translation() =
          j == 0 ? at : Vector3d(at - character.joints.positions.row(0).transpose());
      joint.local.translation = joint.parent_from_joint.translation();
    }
    skeleton = skeleton::Skeleton(joints);
  }

  /// The thighs swing forward to these angles within 0.35 s.
  Motion swing(double left, double right) const {
    return [this, left, right](double time) {
      std::vector<Eigen::Affine3d> pose{Eigen::Affine3d::Identity()};
      for (int j = 1; j < 3; ++j) {
        const Vector3d at = character.joints.positions.row(j).transpose();
        const double angle = (j == 1 ? left : right) * tests::smooth_step(time / 0.35);
        pose.emplace_back(Eigen::Translation3d(at) * Eigen::AngleAxisd(angle, Vector3d::UnitX()) *
                          Eigen::Translation3d(-at));
      }
      return pose;
    };
  }
};

/// The skin after 0.3 s, on the move: of bones that stand still the energy of all flesh is capped at once.
Points simulate(const Body& body, const Motion& motion, const std::string& model) {
  SimulationOptions options;
  options.model = model;
  options.settle_limit = 0.0;
  Simulation simulation(body, motion, 0.0, options);
  EXPECT_EQ(simulation.settle().status, SimulationStatus::Ok);
  EXPECT_EQ(simulation.advance_to(0.3).status, SimulationStatus::Ok);
  return simulation.skin_of(simulation.positions_at(0.3));
}

/// Gap in edges of the lattice, and the edge [m]: the grid lies elsewhere for each.
class FleshCopies : public testing::TestWithParam<std::tuple<double, double>> {
 protected:
  double edge_ = std::get<1>(GetParam());
  Thighs thighs_{std::get<0>(GetParam()) * edge_};
};

TEST_P(FleshCopies, AThighDoesNotFeelWhatTheOtherOneDoes) {
  const lattice::BuildResult built =
      lattice::build(thighs_.character.skin, thighs_.character.joints,
                     {.cell_size = edge_, .grade = lattice::Grade::Off, .symmetry = lattice::Symmetry::Off});
  const std::vector<std::vector<Eigen::Affine3d>> poses{thighs_.swing(0, 0)(1.0),
                                                        thighs_.swing(0.8, 0.8)(1.0)};
  BodyOptions options;
  options.material.young = 5e4;
  const Body body = make_body({built.lattice, thighs_.character.skin, thighs_.skeleton, poses}, options);
  const lattice::LeafLimbs limbs(built.lattice, body.hierarchy, body.mesh, thighs_.character.skin);
  EXPECT_GE(std::count_if(body.skin.cell.begin(), body.skin.cell.end(),
                          [&](int cell) { return limbs.is_copy(cell); }),
            15)
      << "the thighs do not share cells";
  EXPECT_THAT(body.skin.outside, testing::IsEmpty());
  // Newton's method finds the same bits. The conjugate gradients of the other stop where the forces of both
  // thighs are small: 3e-7 m is the most that was measured. (`blended` turns joints as a whole, hips too.)
  for (const auto& [model, bound] : {std::pair{"neo-hookean", 0.0}, {"blended-stiffness", 1e-6}}) {
    SCOPED_TRACE(model);
    const Points both = simulate(body, thighs_.swing(0.8, 0.8), model);
    const Points one = simulate(body, thighs_.swing(0.8, 0.0), model);
    double moved = 0.0, felt = 0.0;
    for (int v : thighs_.vertices[1]) moved = std::max(moved, (both.row(v) - one.row(v)).norm());
    for (int v : thighs_.vertices[0]) felt = std::max(felt, (both.row(v) - one.row(v)).norm());
    EXPECT_GT(moved, 0.2);
    EXPECT_LE(felt, bound);
  }
}

// A tenth of an edge apart, and touching. In cells of 0.3 m touching thighs hang on one node, as the bones of
// their pelvis are shorter than half a cell.
INSTANTIATE_TEST_SUITE_P(Gaps, FleshCopies,
                         testing::Combine(testing::Values(0.1), testing::Values(0.3, 0.23)));
INSTANTIATE_TEST_SUITE_P(Touching, FleshCopies,
                         testing::Combine(testing::Values(0.0), testing::Values(0.2, 0.22, 0.25)));
INSTANTIATE_TEST_SUITE_P(Grids, FleshCopies,
                         testing::Combine(testing::Values(0.1), testing::Values(0.21, 0.24, 0.26, 0.29)));

}  // namespace
}  // namespace sinew::fem
