#pragma once

#include <optional>
#include <vector>

#include "fem/body/body.h"
#include "fem/body/growth.h"

namespace sinew::fem {

/// What a frame reports about the flesh at one instant; strains, det F and energy from the shape free of
/// strain, which has grown where the clip scales joints.
struct Measures {
  double kinetic = 0.0;        ///< 1/2 v^T M v [J].
  double elastic = 0.0;        ///< 1/2 u^T K u, u of each cell in the rotation of its dominant frames [J].
  double potential = 0.0;      ///< -m g . x, relative to the rest pose's [J].
  double ties = 0.0;           ///< sum over ties of kappa/2 int |p - T_b r|^2 dV [J].
  double ghost = 0.0;          ///< 1/2 x^T S x, of the ghost penalty [J].
  double largest_speed = 0.0;  ///< [m/s].
  double bone_residual = 0.0;  ///< largest distance of a bone vertex from the clip [m].
  // At Gauss points of octants that are at least half full: where there is hardly any flesh, nothing turns
  // inside out that anybody could see.
  double largest_strain = 0.0;  ///< largest |principal stretch - 1| [-].
  double min_det = 0.0;         ///< smallest det F [-]; infinite where no octant is half full.
  int min_det_cell = -1;        ///< leaf cell; -1 where no octant is half full.
  int inverted_cells = 0;       ///< leaf cells with det F <= 0.
};

/// 1/2 v^T M v [J]; v: num_vertices x 3 [m/s].
double kinetic_energy(const Body& body, const lattice::Points& v);

/// Elastic energy, ties, ghost penalty and potential as Measures has them, together, of any flesh in one
/// pose.
class StoredEnergy {
 public:
  /// `body` must outlive it.
  StoredEnergy(const Body& body, const PosedFrames& posed, const Eigen::Vector3d& gravity);
  /// x: leaf vertices, num_vertices x 3 [m]; the result in [J].
  double of(const lattice::Points& x) const;

 private:
  const Body* body_;
  PosedFrames posed_;
  Eigen::Vector3d gravity_;
  std::optional<Growth> grown_;
  std::vector<Eigen::Matrix3d> rotations_;  ///< of the cells' frames.
};

/// x and v: leaf vertices, num_vertices x 3.
Measures measure(const Body& body, const lattice::Points& x, const lattice::Points& v,
                 const PosedFrames& posed, const Eigen::Vector3d& gravity);

}  // namespace sinew::fem
