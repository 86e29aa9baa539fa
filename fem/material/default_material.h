#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "fem/material/material.h"
#include "lattice/surface.h"
#include "skeleton/skeleton.h"

/// How stiff flesh is where nobody says so.
namespace sinew::fem {

/// Flesh whose stiffness is asked for.
struct FleshLoad {
  double thickness = 0.0;       ///< t: of the limb, from the bone to the skin [m]; > 0.
  double half_thickness = 0.0;  ///< of what stands out from the bone [m]; > 0 where something does.
  double overhang = 0.0;        ///< how far it stands out [m].
  double tip = 0.0;             ///< how far flesh goes on beyond the end of the last bone [m].
  double motion = 0.0;          ///< acceleration of its bones [m/s^2].
  double frequency = 8.0;       ///< f: what it swings at [Hz].
  double density = 1000.0;      ///< rho [kg/m^3].
  double poisson = 0.45;        ///< nu [-].
  double gravity = 9.81;        ///< g [m/s^2].
};

/// E [Pa] of flesh that swings round its bone at about `frequency`, sags by about 6 % of its thickness under
/// gravity and by no more than a quarter of it under the motion:
///   mu >= 16 rho f^2 t^2, rho g t / 0.12, 2 rho a t;  E = 2 (1 + nu) mu;
/// and of which what stands out from the bone, a cantilever of length L and half thickness d, sinks by at
/// most a tenth of its length under gravity and a quarter under the motion: E >= 5 rho g L^3 / d^2, 2 rho a
/// L^3 / d^2. A sheet counts as at least 0.15 L thick: cells cannot hold a thinner one, and E would be
/// without bounds. What goes on beyond the last bone hangs on the end of a line and gives way there, too: a
/// round limb of L = 2.4 d sinks by 1.7 rho g L^4 / (E d^2), so of it E >= 17 rho g L^3 / d^2, 7 rho a L^3 /
/// d^2.
double default_young(const FleshLoad& load);

/// What flesh of a character of that size swings at [Hz]: 7 Hz at 1.8 m, like the root of its size, so that
/// large things move slowly; at most `fastest` (a quarter of the usual 30
/// frames per second: faster swings flicker; not of the rate asked for, as flesh does not depend on how often
/// one looks).
double default_frequency(double size, double fastest);

/// What default materials are made for. No lattice: the same rig has the same flesh in any.
struct DefaultMaterialInput {
  const lattice::Surface& skin;
  const skeleton::Skeleton& skeleton;
  /// Poses of the clip (pose_from_rest of every joint), `spacing` [s] apart; at least one.
  const std::vector<std::vector<Eigen::Affine3d>>& poses;
  double spacing = 1.0 / 30.0;
  /// Of every joint its mirror image, -1 where there is none: partners have the same flesh to the last bit,
  /// however their triangles are split. Empty: none is known.
  std::vector<int> partners = {};
  double size = 1.8;        ///< longest side of the character [m].
  double fastest = 7.5;     ///< of default_frequency [Hz].
  double density = 1000.0;  ///< [kg/m^3].
  double poisson = 0.45;    ///< [-].
  double gravity = 9.81;    ///< [m/s^2].
};

/// Flesh of one joint that is stiffer than the rest.
struct JointYoung {
  int joint = -1;      ///< of the skeleton.
  double young = 0.0;  ///< [Pa]; more than the base's.
};

struct DefaultMaterials {
  double thickness = 0.0;  ///< t: typical radius of the limbs [m].
  double frequency = 0.0;  ///< f: what flesh of this size is asked to swing at [Hz].
  Material base;           ///< of flesh t thick.
  /// Where flesh is thicker than t, stands out from its bones or is thrown about: a head or a belly many
  /// times thicker than the limbs would be a jelly at the limbs' stiffness, wings would hang down, and limbs
  /// that a clip whips would swell.
  std::vector<JointYoung> of_joints;
};
DefaultMaterials default_materials(const DefaultMaterialInput& input);

}  // namespace sinew::fem
