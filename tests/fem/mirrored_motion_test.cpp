// A mirrored rig gets a mirrored lattice, and a mirrored motion moves its flesh like a mirror image.
#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "fem/body.h"
#include "fem/simulation.h"
#include "lattice/build.h"
#include "tests/lattice/limbs.h"

namespace sinew::fem {
namespace {

using Eigen::Affine3d;
using Eigen::AngleAxisd;
using Eigen::Vector3d;

skeleton::Skeleton skeleton_of(const lattice::JointTree& tree) {
  std::vector<skeleton::Joint> joints(tree.parents.size());
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const Vector3d here = tree.positions.row(static_cast<Eigen::Index>(j)).transpose();
    joints[j].name = tree.names[j];
    joints[j].parent = tree.parents[j];
    joints[j].rest_from_joint.translation() = here;
    joints[j].parent_from_joint.translation() =
        tree.parents[j] < 0 ? here : Vector3d(here - tree.positions.row(tree.parents[j]).transpose());
    joints[j].local.translation = joints[j].parent_from_joint.translation();
  }
  return skeleton::Skeleton(joints);
}

/// The pelvis bobs; both legs swing forward together and apart, the knees bend.
std::vector<Affine3d> pose(const lattice::JointTree& tree, double time) {
  Affine3d pelvis = Affine3d::Identity();
  pelvis.translation().y() = 0.1 * std::sin(6.0 * time);
  std::vector<Affine3d> result(tree.parents.size(), pelvis);
  for (std::size_t j = 1; j < result.size(); ++j) {
    const Vector3d at = tree.positions.row(static_cast<Eigen::Index>(j)).transpose();
    const double side = at.x() < 0.0 ? -1.0 : 1.0;
    const auto turned = [&](double about_x, double about_z) -> Affine3d {
      return Eigen::Translation3d(at) * AngleAxisd(about_x, Vector3d::UnitX()) *
             AngleAxisd(side * about_z, Vector3d::UnitZ()) * Eigen::Translation3d(-at);
    };
    const Affine3d& parent = result[static_cast<std::size_t>(tree.parents[j])];
    const bool hip = tree.names[j].find("hip") != std::string::npos;
    result[j] = parent * (hip ? turned(0.4 * std::sin(5.0 * time), 0.15 * std::sin(4.0 * time))
                              : turned(-0.2 * std::sin(5.0 * time), 0.0));
  }
  return result;
}

/// The largest distance between a skin vertex and the image of its partner after half a second, as a share of
/// the largest motion.
double asymmetry(const tests::Character& legs, const lattice::ControlLattice& lattice) {
  BodyOptions options;
  options.material.young = 2e4;
  const std::vector<std::vector<Affine3d>> poses{pose(legs.joints, 0.0), pose(legs.joints, 0.3)};
  const Body body = make_body({lattice, legs.skin, skeleton_of(legs.joints), poses}, options);
  Simulation simulation(body, [&](double time) { return pose(legs.joints, time); }, 0.0, {});
  EXPECT_EQ(simulation.settle().status, SimulationStatus::Ok);
  EXPECT_EQ(simulation.advance_to(0.5).status, SimulationStatus::Ok);
  const lattice::Points skin = simulation.skin_of(simulation.state().x);
  double largest = 0.0, motion = 0.0;
  for (Eigen::Index v = 0; v < skin.rows(); ++v) {
    const Eigen::RowVector3d image(-legs.skin.points(v, 0), legs.skin.points(v, 1), legs.skin.points(v, 2));
    Eigen::Index partner = 0;
    EXPECT_LT((legs.skin.points.rowwise() - image).rowwise().norm().minCoeff(&partner), 1e-12);
    const Eigen::RowVector3d there(-skin(partner, 0), skin(partner, 1), skin(partner, 2));
    largest = std::max(largest, (skin.row(v) - there).norm());
    motion = std::max(motion, (skin.row(v) - legs.skin.points.row(v)).norm());
  }
  EXPECT_GT(motion, 0.1);
  return largest / motion;
}

TEST(MirroredMotion, MovesTheFleshLikeAMirrorImage) {
  const tests::Character legs = tests::two_legs();
  const lattice::BuildResult mirrored = lattice::build(legs.skin, legs.joints, {.cells = 150});
  ASSERT_TRUE(mirrored.mirror) << mirrored.no_mirror;
  const lattice::BuildResult other =
      lattice::build(legs.skin, legs.joints, {.cells = 150, .symmetry = lattice::Symmetry::Off});
  const double with = asymmetry(legs, mirrored.lattice), without = asymmetry(legs, other.lattice);
  // Measured 3.4e-5 and 0.28. What is left comes from the sampling of the flesh: a sample on the border of
  // two cells counts for one of them.
  EXPECT_LT(with, 5e-4);
  EXPECT_GT(without, 10.0 * with);
}

}  // namespace
}  // namespace sinew::fem
