#include "fem/default_material.h"

#include <algorithm>
#include <optional>

namespace sinew::fem {
namespace {

/// Acceleration [m/s^2] that the ends of a bone stay below for 95 % of the clip; 0 for fewer than three
/// poses. The rest are jerks: kinks between keys, which flesh should show rather than be built for.
double usual_acceleration(const lattice::LatticeBone& bone, const DefaultMaterialInput& input) {
  std::vector<double> accelerations;
  const auto at = [&](std::size_t k, const lattice::BoneAnchor& anchor, bool end) -> Eigen::Vector3d {
    const auto& pose = input.poses[k];
    return end ? pose[static_cast<std::size_t>(anchor.joint_b)] * anchor.x_b
               : pose[static_cast<std::size_t>(anchor.joint_a)] * anchor.x_a;
  };
  for (std::size_t k = 1; k + 1 < input.poses.size(); ++k) {
    for (const bool end : {false, true}) {
      const lattice::BoneAnchor& anchor = end ? bone.end : bone.start;
      const Eigen::Vector3d second =
          at(k + 1, anchor, end) - 2.0 * at(k, anchor, end) + at(k - 1, anchor, end);
      accelerations.push_back(second.norm() / (input.spacing * input.spacing));
    }
  }
  if (accelerations.empty()) return 0.0;
  const auto nth = accelerations.begin() +
                   static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(accelerations.size() - 1));
  std::nth_element(accelerations.begin(), nth, accelerations.end());
  return *nth;
}

}  // namespace

double default_young(double thickness, double density, double poisson, double gravity, double motion) {
  constexpr double kSwing = 8.0;  // f [Hz]
  const double mu = std::max({16.0 * density * kSwing * kSwing * thickness * thickness,
                              density * gravity * thickness / 0.12, 2.0 * density * motion * thickness});
  return 2.0 * (1.0 + poisson) * mu;
}

DefaultMaterials default_materials(const DefaultMaterialInput& input) {
  const FrameTree tree = frame_tree(input.lattice, input.skeleton);
  const std::optional<lattice::MirrorMap> mirror = lattice::find_mirror_map(input.lattice, input.skin);
  const LimbRadii radii(input.lattice, tree, input.skin, input.lattice.edge_length,
                        mirror ? &*mirror : nullptr);
  DefaultMaterials materials;
  materials.thickness = radii.typical();
  const auto young = [&](double thickness, double motion) {
    return default_young(thickness, input.density, input.poisson, input.gravity, motion);
  };
  materials.base = {young(materials.thickness, 0.0), input.poisson, input.density};
  for (const Frame& frame : tree.frames) {
    double thickness = materials.thickness, motion = 0.0;
    for (std::size_t b = 0; b < input.lattice.bones.size(); ++b) {
      const auto& bone = input.lattice.bones[b];
      if (bone.frame != frame.joint) continue;
      thickness = std::max(thickness, radii.of_bone(static_cast<int>(b)));
      motion = std::max(motion, usual_acceleration(bone, input));
    }
    Material material = materials.base;
    material.young = young(thickness, motion);
    if (material.young > materials.base.young) materials.of_joints.push_back({frame.joint, material});
  }
  return materials;
}

}  // namespace sinew::fem
