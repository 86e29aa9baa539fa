// A mirrored rig gets a mirrored lattice, and a mirrored motion moves its flesh like a mirror image.
#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "assets/lattice_input.h"
#include "assets/rig.h"
#include "fem/body/body.h"
#include "fem/material/default_material.h"
#include "fem/time/simulation.h"
#include "lattice/build.h"
#include "tests/lattice/limbs.h"
#include "tests/lattice/mirrored.h"

namespace sinew::fem {
namespace {

using Eigen::Affine3d;
using Eigen::AngleAxisd;
using Eigen::Vector3d;

/// A character that is its own mirror image in x = 0.
struct Rig {
  lattice::Surface skin;
  lattice::JointTree joints;
};

Rig two_legs() {
  const tests::Character legs = tests::two_legs();
  return {legs.skin, legs.joints};
}

Rig hopper() {
  assets::LoadOptions load;
  load.importer_executable = SINEW_IMPORTER;
  const assets::LatticeInput input = assets::lattice_input(
      assets::load_rig(std::string(SINEW_SOURCE_DIR) + "/assets/samples/hopper.glb", load));
  return {input.skin.surface, input.joints};
}

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

/// The root bobs; every other joint swings about x, and off the plane also about y and z, there the other way
/// on the other side.
std::vector<Affine3d> pose(const lattice::JointTree& tree, double time) {
  Affine3d root = Affine3d::Identity();
  root.translation().y() = 0.1 * std::sin(6.0 * time);
  std::vector<Affine3d> result(tree.parents.size(), root);
  for (std::size_t j = 0; j < result.size(); ++j) {
    if (tree.parents[j] < 0) continue;
    const Vector3d at = tree.positions.row(static_cast<Eigen::Index>(j)).transpose();
    const double side = std::abs(at.x()) < 1e-6 ? 0.0 : at.x() < 0.0 ? -1.0 : 1.0;
    const Vector3d turn(0.3 * std::sin(5.0 * time + at.y()), 0.1 * side * std::sin(3.0 * time),
                        0.15 * side * std::sin(4.0 * time));
    const double angle = turn.norm();
    result[j] = result[static_cast<std::size_t>(tree.parents[j])] * Eigen::Translation3d(at) *
                AngleAxisd(angle, angle > 0.0 ? Vector3d(turn / angle) : Vector3d::UnitX()) *
                Eigen::Translation3d(-at);
  }
  return result;
}

/// The largest distance between a skin vertex and the image of its partner after a quarter of a second, as a
/// share of the largest motion.
double asymmetry(const Rig& rig, const lattice::ControlLattice& lattice) {
  const skeleton::Skeleton skeleton = skeleton_of(rig.joints);
  const std::vector<std::vector<Affine3d>> poses{pose(rig.joints, 0.0), pose(rig.joints, 0.3)};
  BodyOptions options;
  DefaultMaterialInput flesh{rig.skin, skeleton, poses};
  flesh.spacing = 0.3;
  if (const std::optional<lattice::MirrorMap> map = lattice::find_mirror_map(lattice, rig.skin))
    flesh.partners = map->frames;
  const DefaultMaterials materials = default_materials(flesh);
  options.material = materials.base;
  for (const JointYoung& joint : materials.of_joints)
    options.materials.push_back({joint.joint, {joint.young, materials.base.poisson, materials.base.density}});
  const Body body = make_body({lattice, rig.skin, skeleton, poses}, options);
  SimulationOptions run;
  run.model = "blended";
  run.settle_limit = 0.5;
  Simulation simulation(
      body, [&](double time) { return pose(rig.joints, time); }, 0.0, run);
  EXPECT_EQ(simulation.settle().status, SimulationStatus::Ok);
  EXPECT_EQ(simulation.advance_to(0.25).status, SimulationStatus::Ok);
  const lattice::Points& rest = rig.skin.points;
  const lattice::Points skin = simulation.skin_of(simulation.flesh().x);
  double largest = 0.0, motion = 0.0;
  for (Eigen::Index v = 0; v < skin.rows(); ++v) {
    const Eigen::RowVector3d image(-rest(v, 0), rest(v, 1), rest(v, 2));
    Eigen::Index partner = 0;
    EXPECT_LT((rest.rowwise() - image).rowwise().norm().minCoeff(&partner), 1e-12);
    const Eigen::RowVector3d there(-skin(partner, 0), skin(partner, 1), skin(partner, 2));
    largest = std::max(largest, (skin.row(v) - there).norm());
    motion = std::max(motion, (skin.row(v) - rest.row(v)).norm());
  }
  EXPECT_GT(motion, 0.1);
  return largest / motion;
}

void expect_mirrored_motion(const Rig& rig, int cells, double bound = 1e-11) {
  SCOPED_TRACE(cells);
  const lattice::BuildResult mirrored = lattice::build(rig.skin, rig.joints, {.cells = cells});
  ASSERT_TRUE(mirrored.mirror) << mirrored.no_mirror;
  tests::expect_mirrored(mirrored.lattice, *mirrored.mirror);
  // Both sides have the same matrices but for rounding, in another order: measured 3e-15. The bound leaves
  // room for what a factor and 30 steps make of it elsewhere.
  EXPECT_LT(asymmetry(rig, mirrored.lattice), bound);
}

TEST(MirroredMotion, MovesTheFleshOfLegsLikeAMirrorImage) {
  for (const int cells : {100, 200, 400}) expect_mirrored_motion(two_legs(), cells);
}

TEST(MirroredMotion, MovesTheFleshOfAHopperLikeAMirrorImage) {
  const Rig rig = hopper();
  expect_mirrored_motion(rig, 200);
  // Which copy owns a sample of flesh is asked on each side by itself: 8e-5 of the motion where limbs share
  // cells.
  expect_mirrored_motion(rig, 600, 2e-4);
}

// A skin from a file is mirrored to single precision. Partners are measured by the skin of both, and so have
// the same radius to the bit.
TEST(MirroredMotion, MeasuresPartnersByTheSkinOfBoth) {
  Rig legs = two_legs();
  const lattice::ControlLattice lattice = lattice::build(legs.skin, legs.joints, {.cells = 150}).lattice;
  for (Eigen::Index v = 0; v < legs.skin.points.rows(); ++v)
    if (legs.skin.points(v, 0) < 0.0) legs.skin.points(v, 0) *= 1.0 + 1e-6;
  const std::optional<lattice::MirrorMap> map = lattice::find_mirror_map(lattice, legs.skin);
  ASSERT_TRUE(map);
  const FrameTree tree = frame_tree(lattice, skeleton_of(legs.joints));
  const LimbRadii own(lattice, tree, legs.skin, lattice.edge_length),
      shared(lattice, tree, legs.skin, lattice.edge_length, &*map);
  int differences = 0;
  for (int b = 0; b < static_cast<int>(lattice.bones.size()); ++b) {
    const int partner = map->bones[static_cast<std::size_t>(b)];
    EXPECT_EQ(shared.of_bone(b), shared.of_bone(partner)) << lattice.bones[static_cast<std::size_t>(b)].name;
    differences += own.of_bone(b) != own.of_bone(partner);
  }
  EXPECT_GT(differences, 0) << "there is nothing to share";
}

TEST(MirroredMotion, NeedsAMirroredLattice) {
  const Rig legs = two_legs();
  const lattice::BuildResult other =
      lattice::build(legs.skin, legs.joints, {.cells = 150, .symmetry = lattice::Symmetry::Off});
  EXPECT_GT(asymmetry(legs, other.lattice), 1e-2);
}

}  // namespace
}  // namespace sinew::fem
