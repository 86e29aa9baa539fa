#pragma once

#include <vector>

#include "fem/body.h"

/// How stiff flesh is where nobody says so.
namespace sinew::fem {

/// E [Pa] of flesh of thickness t [m] that swings at about 8 Hz, sags by about 6 % of its thickness under
/// `gravity` [m/s^2], and by no more than a quarter of it under the acceleration `motion` [m/s^2] of its
/// bones: mu = max(16 rho f^2 t^2, rho g t / 0.12, 2 rho a t), E = 2 (1 + nu) mu.
double default_young(double thickness, double density, double poisson, double gravity, double motion);

/// What default materials are made for.
struct DefaultMaterialInput {
  const lattice::ControlLattice& lattice;
  const lattice::Surface& skin;
  const skeleton::Skeleton& skeleton;
  /// Poses of the clip (pose_from_rest of every joint), `spacing` [s] apart; at least one.
  const std::vector<std::vector<Eigen::Affine3d>>& poses;
  double spacing = 1.0 / 30.0;
  double density = 1000.0;  ///< [kg/m^3].
  double poisson = 0.45;    ///< [-].
  double gravity = 9.81;    ///< [m/s^2].
};

struct DefaultMaterials {
  double thickness = 0.0;  ///< t: median limb radius [m].
  Material base;           ///< of flesh t thick.
  /// Per frame, where the flesh is thicker than t or its bones are thrown about: a head or a belly many times
  /// thicker than the limbs would be a jelly at the limbs' stiffness, and limbs that a clip whips would
  /// swell.
  std::vector<JointMaterial> of_joints;
};
DefaultMaterials default_materials(const DefaultMaterialInput& input);

}  // namespace sinew::fem
