// Two legs in one coarse cell, pulled apart: neither feels the other.
#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include <Eigen/Geometry>
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

constexpr double kGap = 0.08;                     ///< between the legs [m].
constexpr double kRadius = 0.1;                   ///< of a leg [m].
constexpr double kOffset = kRadius + 0.5 * kGap;  ///< of a leg's axis from the middle [m].

/// Two legs without a body: hips 0 and 2, knees 1 and 3; of each leg the vertices of the skin.
struct Legs {
  tests::Character character;
  skeleton::Skeleton skeleton;
  std::array<std::vector<int>, 2> vertices;

  Legs() {
    std::vector<skeleton::Joint> joints;
    for (int side = 0; side < 2; ++side) {
      const double x = side == 0 ? -kOffset : kOffset;
      const Vector3d hip(x, 1.0, 0.0), knee(x, 0.5, 0.0), foot(x, 0.0, 0.0);
      const int first = static_cast<int>(character.skin.points.rows());
      const int joint = character.add_joint(side == 0 ? "left_hip" : "right_hip", -1, hip);
      character.add_joint(side == 0 ? "left_knee" : "right_knee", joint, knee);
      character.add_capsule(joint, hip, foot, kRadius);
      for (int v = first; v < character.skin.points.rows(); ++v) {
        const double lower = std::clamp((0.6 - character.skin.points(v, 1)) / 0.2, 0.0, 1.0);
        character.skin.weights[static_cast<std::size_t>(v)] = {{joint, 1.0 - lower}, {joint + 1, lower}};
        vertices[static_cast<std::size_t>(side)].push_back(v);
      }
    }
    for (int j = 0; j < 4; ++j) {
      skeleton::Joint& joint = joints.emplace_back();
      joint.name = character.joints.names[static_cast<std::size_t>(j)];
      joint.parent = character.joints.parents[static_cast<std::size_t>(j)];
      joint.rest_from_joint.translation() = character.joints.positions.row(j).transpose();
      joint.parent_from_joint.translation() =
          joint.parent < 0
              ? Vector3d(joint.rest_from_joint.translation())
              : Vector3d((character.joints.positions.row(j) - character.joints.positions.row(joint.parent))
                             .transpose());
      joint.local.translation = joint.parent_from_joint.translation();
    }
    skeleton = skeleton::Skeleton(joints);
  }

  /// The hips swing outward to `angles` and the knees bend half as far, within 0.3 s.
  Motion swing(double left, double right) const {
    return [this, left, right](double time) {
      std::vector<Eigen::Affine3d> pose;
      for (int j = 0; j < 4; ++j) {
        const double angle = (j < 2 ? -left : right) * (j % 2 == 0 ? 1.0 : 0.5);
        const Vector3d at = character.joints.positions.row(j).transpose();
        const Eigen::Affine3d turn =
            Eigen::Translation3d(at) *
            Eigen::AngleAxisd(angle * tests::smooth_step(time / 0.3), Vector3d::UnitZ()) *
            Eigen::Translation3d(-at);
        pose.push_back(j % 2 == 0 ? turn : pose.back() * turn);
      }
      return pose;
    };
  }
};

/// The part of a lattice that hangs together with some vertices, renumbered; its bones and copies with it.
ControlLattice part_of(const ControlLattice& lattice, const std::vector<int>& seeds) {
  const auto& cells = lattice.complex.cells;
  std::set<int> reached(seeds.begin(), seeds.end());
  for (bool grows = true; grows;) {
    grows = false;
    for (const lattice::Cell& cell : cells) {
      const auto begin = cell.vertices.begin(), end = begin + num_corners(cell.type);
      if (std::none_of(begin, end, [&](int v) { return reached.contains(v); })) continue;
      const std::size_t before = reached.size();
      reached.insert(begin, end);
      grows = grows || reached.size() > before;
    }
  }
  ControlLattice part;
  part.edge_length = lattice.edge_length;
  part.frame_of_joint = lattice.frame_of_joint;
  std::map<int, int> vertex;
  part.complex.points.resize(static_cast<Eigen::Index>(reached.size()), 3);
  for (int v : reached) {
    const int index = static_cast<int>(vertex.size());
    vertex[v] = index;
    part.complex.points.row(index) = lattice.complex.points.row(v);
  }
  for (const lattice::Cell& cell : cells) {
    if (!vertex.contains(cell.vertices[0])) continue;
    lattice::Cell own = cell;
    for (int k = 0; k < num_corners(cell.type); ++k)
      own.vertices[static_cast<std::size_t>(k)] = vertex[cell.vertices[static_cast<std::size_t>(k)]];
    part.complex.cells.push_back(own);
  }
  for (lattice::LatticeBone bone : lattice.bones) {
    if (!vertex.contains(bone.chain.at(0))) continue;
    for (int& v : bone.chain) v = vertex.at(v);
    part.bones.push_back(bone);
  }
  return part;
}

/// The skin after 0.5 s. Not settled: that ends when the whole body is slow, one leg or two.
Points simulate(const Body& body, const Motion& motion) {
  SimulationOptions options;
  options.model = "blended";
  options.settle_limit = 0.0;
  Simulation simulation(body, motion, 0.0, options);
  EXPECT_EQ(simulation.settle().status, SimulationStatus::Ok);
  EXPECT_EQ(simulation.advance_to(0.5).status, SimulationStatus::Ok);
  return simulation.skin_of(simulation.positions_at(0.5));
}

double skin_volume(const lattice::Surface& skin) {
  double volume = 0.0;
  for (Eigen::Index t = 0; t < skin.triangles.rows(); ++t) {
    const Vector3d a = skin.points.row(skin.triangles(t, 0)), b = skin.points.row(skin.triangles(t, 1)),
                   c = skin.points.row(skin.triangles(t, 2));
    volume += a.dot(b.cross(c)) / 6.0;
  }
  return volume;
}

class LimbCopiesInMotion : public testing::TestWithParam<int> {
 protected:
  Legs legs_;
  ControlLattice lattice_ = lattice::build(legs_.character.skin, legs_.character.joints,
                                           {.cells = GetParam(), .symmetry = lattice::Symmetry::Off})
                                .lattice;
  std::vector<std::vector<Eigen::Affine3d>> poses_{legs_.swing(0.7, 0.7)(0.0), legs_.swing(0.7, 0.7)(1.0)};
  BodyOptions options_ = [] {
    BodyOptions options;
    options.material.young = 5e4;
    return options;
  }();
  Body body_ = make_body({lattice_, legs_.character.skin, legs_.skeleton, poses_}, options_);
};

TEST_P(LimbCopiesInMotion, TheLegsDoShareCells) {
  const lattice::LeafLimbs limbs(lattice_, body_.hierarchy, body_.mesh, legs_.character.skin);
  int vertices = 0;
  for (int cell : body_.skin.cell) vertices += limbs.is_copy(cell);
  EXPECT_GE(vertices, 20) << "of " << body_.skin.cell.size();  // fewer where cells are smaller: 22 at 150
  EXPECT_TRUE(body_.skin.outside.empty());
}

TEST_P(LimbCopiesInMotion, ALegDoesNotFeelWhatTheOtherOneDoes) {
  const Points apart = simulate(body_, legs_.swing(0.7, 0.7));
  const Points alone = simulate(body_, legs_.swing(0.7, 0.0));
  double moved = 0.0;
  for (int v : legs_.vertices[1]) moved = std::max(moved, (apart.row(v) - alone.row(v)).norm());
  EXPECT_GT(moved, 0.3);
  // The factor sweeps through both legs at once: rounding on positions of size 1.
  for (int v : legs_.vertices[0]) EXPECT_LE((apart.row(v) - alone.row(v)).norm(), 1e-11) << "vertex " << v;
}

TEST_P(LimbCopiesInMotion, ALegMovesAsIfItWereAlone) {
  const Points both = simulate(body_, legs_.swing(0.7, 0.7));
  lattice::Surface left = legs_.character.skin;
  left.points = legs_.character.skin.points(legs_.vertices[0], Eigen::all);
  left.triangles.conservativeResize(left.triangles.rows() / 2, 3);  // the first capsule's
  left.weights.resize(legs_.vertices[0].size());
  const auto of_left = std::find_if(lattice_.bones.begin(), lattice_.bones.end(),
                                    [](const lattice::LatticeBone& bone) { return bone.frame < 2; });
  ASSERT_NE(of_left, lattice_.bones.end());
  const ControlLattice half = part_of(lattice_, of_left->chain);
  ASSERT_EQ(2 * half.bones.size(), lattice_.bones.size());
  const Body alone = make_body({half, left, legs_.skeleton, poses_}, options_);
  const Points single = simulate(alone, legs_.swing(0.7, 0.7));
  // Another order of sums in the factor and rounding of 60 steps, on positions of size 1.
  EXPECT_LE((both(legs_.vertices[0], Eigen::all) - single).rowwise().norm().maxCoeff(), 1e-9);
}

// With 40 cells of 1.3 m a knee is contracted into its hip, and each leg has one bone.
INSTANTIATE_TEST_SUITE_P(Cells, LimbCopiesInMotion, testing::Values(40, 60, 80, 100, 120, 150));

using LimbCopiesOfEightyCells = LimbCopiesInMotion;

TEST_P(LimbCopiesOfEightyCells, TheMassIsThatOfTheSkinsVolume) {
  const double volume = skin_volume(legs_.character.skin);
  BodyOptions fine = options_;
  fine.shell = 0.0;  // the flesh ends at the skin
  fine.levels = 2;
  const Body body = make_body({lattice_, legs_.character.skin, legs_.skeleton, poses_}, fine);
  // 64 samples in a leaf cell, and a floor where the skin grazes an octant: measured 0.9 % too much.
  EXPECT_NEAR(body.volume, volume, 0.02 * volume);
  const double mass = std::accumulate(body.vertex_mass.begin(), body.vertex_mass.end(), 0.0);
  EXPECT_NEAR(mass, 1000.0 * volume, 0.02 * 1000.0 * volume);
}

INSTANTIATE_TEST_SUITE_P(Cells, LimbCopiesOfEightyCells, testing::Values(80));

}  // namespace
}  // namespace sinew::fem
