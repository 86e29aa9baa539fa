#include "fem/material/default_material.h"

#include <algorithm>
#include <cmath>

#include "fem/material/joint_flesh.h"

namespace sinew::fem {
namespace {

/// Acceleration [m/s^2] that the ends of a joint's bones stay below for 95 % of the clip; 0 for fewer than
/// three poses. The rest are jerks: kinks between keys, which flesh should show rather than be built for.
double usual_acceleration(int joint, const std::vector<int>& ends, const DefaultMaterialInput& input) {
  std::vector<double> accelerations;
  for (const int end : ends) {
    // A bone's end moves with the joint there; its start is the first of the ends.
    const Eigen::Vector3d rest = input.skeleton.joint(end).rest_from_joint.translation();
    const auto at = [&](std::size_t k) -> Eigen::Vector3d {
      return input.poses[k][static_cast<std::size_t>(joint)] * rest;
    };
    for (std::size_t k = 1; k + 1 < input.poses.size(); ++k)
      accelerations.push_back((at(k + 1) - 2.0 * at(k) + at(k - 1)).norm() / (input.spacing * input.spacing));
  }
  if (accelerations.empty()) return 0.0;
  const auto nth = accelerations.begin() +
                   static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(accelerations.size() - 1));
  std::nth_element(accelerations.begin(), nth, accelerations.end());
  return *nth;
}

}  // namespace

double default_young(const FleshLoad& load) {
  const double t = load.thickness, rho = load.density;
  const double mu = std::max({16.0 * rho * load.frequency * load.frequency * t * t,
                              rho * load.gravity * t / 0.12, 2.0 * rho * load.motion * t});
  const double young = 2.0 * (1.0 + load.poisson) * mu;
  // rho L^3 / d^2 of a cantilever.
  const auto slender = [&](double length) {
    const double d = std::max(load.half_thickness, 0.15 * length);
    return length > 0.0 ? rho * length * length * length / (d * d) : 0.0;
  };
  const double side = slender(load.overhang), tip = slender(load.tip);
  return std::max({young, 5.0 * side * load.gravity, 2.0 * side * load.motion, 17.0 * tip * load.gravity,
                   7.0 * tip * load.motion});
}

double default_frequency(double size, double fastest) {
  constexpr double kHuman = 1.8, kSwing = 7.0;  // m, Hz
  return std::min(kSwing * std::sqrt(kHuman / size), fastest);
}

DefaultMaterials default_materials(const DefaultMaterialInput& input) {
  DefaultMaterials materials;
  materials.thickness = typical_radius(input.skin, input.skeleton);
  materials.frequency = default_frequency(input.size, input.fastest);
  FleshLoad load;
  load.thickness = materials.thickness;
  load.frequency = materials.frequency;
  load.density = input.density;
  load.poisson = input.poisson;
  load.gravity = input.gravity;
  materials.base = {default_young(load), input.poisson, input.density};
  const std::vector<JointFlesh> flesh = joint_flesh(input.skin, input.skeleton);
  std::vector<double> young(flesh.size(), 0.0);
  for (int j = 0; j < input.skeleton.num_joints(); ++j) {
    const JointFlesh& f = flesh[static_cast<std::size_t>(j)];
    if (!(f.area > 0.0)) continue;
    load.thickness = std::max(materials.thickness, f.radius);
    load.half_thickness = f.half_thickness;
    load.overhang = f.overhang;
    load.tip = f.tip;
    load.motion = usual_acceleration(j, f.ends, input);
    young[static_cast<std::size_t>(j)] = default_young(load);
  }
  for (int j = 0; j < input.skeleton.num_joints(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    const int partner = input.partners.empty() ? -1 : input.partners[i];
    const double of_both =
        partner < 0 ? young[i] : std::max(young[i], young[static_cast<std::size_t>(partner)]);
    if (of_both > materials.base.young) materials.of_joints.push_back({j, of_both});
  }
  return materials;
}

}  // namespace sinew::fem
