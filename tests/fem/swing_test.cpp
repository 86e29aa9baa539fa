// What flesh of default stiffness swings at after a jolt: the lowest frequency of a limb round its bone.
#include <cmath>

#include <gtest/gtest.h>

#include "fem/material/default_material.h"
#include "lattice/build.h"
#include "tests/fem/bar.h"
#include "tests/lattice/limbs.h"

namespace sinew::fem {
namespace {

using Eigen::Vector3d;

/// Of the thigh of a character of that size [m], in Hz.
double swing(double size) {
  const double scale = size / 1.8;
  tests::Character character;
  const Vector3d hip(0.0, 0.9 * scale, 0.0), knee(0.0, 0.5 * scale, 0.0);
  const int joint = character.add_joint("thigh", -1, hip);
  character.add_capsule(joint, hip, knee, 0.09 * scale);
  skeleton::Joint root;
  root.name = "thigh";
  root.parent = -1;
  root.rest_from_joint.translation() = hip;
  root.parent_from_joint.translation() = hip;
  root.local.translation = hip;
  const skeleton::Skeleton skeleton({root});
  const std::vector<std::vector<Eigen::Affine3d>> still{{Eigen::Affine3d::Identity()}};
  DefaultMaterialInput input{character.skin, skeleton, still};
  input.size = size;
  const DefaultMaterials flesh = default_materials(input);
  BodyOptions options;
  options.material = flesh.base;
  for (const JointYoung& of_joint : flesh.of_joints)
    options.materials.push_back({of_joint.joint, {of_joint.young, flesh.base.poisson, flesh.base.density}});
  const lattice::BuildResult built = lattice::build(character.skin, character.joints, {.cells = 200});
  const Body body = make_body({built.lattice, character.skin, skeleton, still}, options);
  // Ties keep flesh from turning round its bone.
  return tests::natural_frequencies(tests::nodal_system(body.matrices, body.bones.is_bone), 1, 1.0)[0];
}

// Flesh of a character of 1.8 m is meant to swing at 4 to 8 Hz, of larger ones by the root of their size: at
// 30 m 1 to 2 Hz; all within a quarter. The lowest mode turns the limb round its bone: 3.4 and 0.84 Hz.
TEST(Swing, IsThatOfTheCharactersSize) {
  const double human = swing(1.8), dragon = swing(30.0);
  EXPECT_GE(human, 0.75 * 4.0);
  EXPECT_LE(human, 1.25 * 8.0);
  EXPECT_GE(dragon, 0.75 * 1.0);
  EXPECT_LE(dragon, 1.25 * 2.0);
  EXPECT_NEAR(dragon / human, std::sqrt(1.8 / 30.0), 0.25 * std::sqrt(1.8 / 30.0));
}

}  // namespace
}  // namespace sinew::fem
