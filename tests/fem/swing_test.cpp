// What flesh of default stiffness swings at after a jolt: the lowest frequency of a limb round its bone.
#include <cmath>

#include <gtest/gtest.h>

#include "fem/default_material.h"
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
  // Unknowns are the values at the leaf vertices that no bone holds. Ties keep flesh from turning round its
  // bone.
  std::vector<int> row(static_cast<std::size_t>(body.mesh.num_vertices()), -1);
  int count = 0;
  for (int a = 0; a < body.mesh.num_vertices(); ++a)
    if (!body.bones.is_bone[static_cast<std::size_t>(a)]) row[static_cast<std::size_t>(a)] = count++;
  std::vector<Eigen::Triplet<double>> stiffness, mass;
  const LeafMatrices& m = body.matrices;
  for (int a = 0; a < m.num_vertices(); ++a)
    for (int e = m.row_start[static_cast<std::size_t>(a)]; e < m.row_start[static_cast<std::size_t>(a) + 1];
         ++e) {
      const auto entry = static_cast<std::size_t>(e);
      const int i = row[static_cast<std::size_t>(a)], k = row[static_cast<std::size_t>(m.column[entry])];
      for (int c = 0; i >= 0 && k >= 0 && c < 9; ++c) {
        stiffness.emplace_back(3 * i + c / 3, 3 * k + c % 3,
                               m.stiffness[entry](c / 3, c % 3) + (c / 3 == c % 3 ? m.tie[entry] : 0.0));
        if (c / 3 == c % 3) mass.emplace_back(3 * i + c / 3, 3 * k + c / 3, m.mass[entry]);
      }
    }
  tests::FreeSystem system;
  for (Eigen::SparseMatrix<double>* matrix : {&system.stiffness, &system.mass})
    matrix->resize(3 * count, 3 * count);
  system.stiffness.setFromTriplets(stiffness.begin(), stiffness.end());
  system.mass.setFromTriplets(mass.begin(), mass.end());
  return tests::natural_frequencies(system, 1, 1.0)[0];
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
