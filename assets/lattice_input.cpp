#include "assets/lattice_input.h"

#include "assets/detail/text.h"
#include "assets/error.h"

namespace sinew::assets {

LatticeInput lattice_input(const Rig& rig) {
  LatticeInput input;
  input.skin = physics_skin(rig);
  if (rig.parts.empty())
    throw InputError(
        rig.file,
        "mesh: there is none, expected a mesh that is bound to the skeleton; hint: the file holds "
        "a motion or a skeleton alone; export the character together with it");
  if (input.skin.surface.triangles.rows() == 0) {
    throw InputError(rig.file,
                     "skin: no triangle hangs on a joint, got " + std::to_string(rig.parts.size()) +
                         " parts without flesh, expected a mesh with skin weights; hint: bind the mesh "
                         "to the skeleton before exporting");
  }
  const lattice::Points& points = input.skin.surface.points;
  const double diagonal = (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
  const double thin = thickness(points);
  if (!(thin > kFlatSkin * diagonal)) {
    throw InputError(rig.file, "skin: is flat and holds no flesh, got a thickness of " +
                                   detail::number(thin) + " m, expected more than " +
                                   detail::number(kFlatSkin * diagonal) + " m; hint: give the mesh a volume");
  }
  const skeleton::Skeleton& skeleton = rig.skeleton;
  input.joints.positions.resize(skeleton.num_joints(), 3);
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    const skeleton::Joint& joint = skeleton.joint(j);
    input.joints.positions.row(j) = joint.rest_from_joint.translation().transpose();
    input.joints.parents.push_back(joint.parent);
    input.joints.names.push_back(joint.name);
  }
  return input;
}

}  // namespace sinew::assets
