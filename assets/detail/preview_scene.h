#pragma once

#include <vector>

#include "assets/detail/ray_mesh.h"
#include "lattice/points.h"

/// Camera, light and colours of the contact sheet. Everything here is right-handed with y up.
namespace sinew::assets::detail {

/// Perspective camera with a square picture.
class Camera {
 public:
  /// Three-quarter view from the front left, as close as shows all of `points` (num_points x 3 [m]).
  explicit Camera(const lattice::Points& points);

  /// Place in the picture, (0, 0) top left to (1, 1) bottom right; false for a point behind the camera.
  bool project(const Eigen::Vector3d& p, Eigen::Vector2d& place) const;
  /// Unit direction through that place.
  Eigen::Vector3d direction(const Eigen::Vector2d& place) const;
  const Eigen::Vector3d& eye() const { return eye_; }
  const Eigen::Vector3d& right() const { return right_; }
  const Eigen::Vector3d& up() const { return up_; }
  const Eigen::Vector3d& back() const { return back_; }  ///< from the scene to the camera.

 private:
  Eigen::Vector3d eye_, right_, up_, back_;
};

/// What does not change from tile to tile.
struct Stage {
  Camera camera;
  double ground;           ///< height of the ground [m].
  Eigen::Vector3d centre;  ///< of everything that moves [m].
  double radius;           ///< of a ball round it that holds everything [m].
  double grid;             ///< distance of the lines on the ground [m].
  Eigen::Vector3d light;   ///< unit, towards the middle of the light.
};

/// The stage for frames that visit `points`.
Stage make_stage(const lattice::Points& points);

/// One posed body, ready for shading.
struct Body {
  RayMesh mesh;
  lattice::Triangles triangles;
  lattice::Points corner_normals;  ///< 3 per triangle, unit, smooth except over sharp edges.
  lattice::Points colours;         ///< per vertex, linear RGB.
  Eigen::Vector3d centre;          ///< of a ball that holds the body [m].
  double radius;                   ///< of that ball [m].
};

/// Which vertices stand at the same place, as class indices: copies along seams must be shaded as one.
std::vector<int> coincident(const lattice::Points& points);

/// `same_place` from coincident().
Body make_body(const lattice::Points& points, const lattice::Triangles& triangles,
               const std::vector<int>& same_place, lattice::Points colours);

/// Linear RGB of flesh, and of flesh that is as far from plain skinning as the tint tells apart.
Eigen::Vector3d flesh_colour();
Eigen::Vector3d tint_colour();

/// Which of the light's samples a ray takes. The rays of one pixel share the shift and count on, so that
/// together they cover the light evenly.
struct LightSamples {
  Eigen::Vector2d shift;  ///< in the unit square.
  int ray;                ///< number of the ray in its pixel.
};

/// The shift of a pixel: neighbours differ, so that what is left of the noise is fine and even.
Eigen::Vector2d light_shift(int x, int y);

/// Linear light that arrives from `direction` (unit).
Eigen::Vector3d radiance(const Stage& stage, const Body& body, const Eigen::Vector3d& direction,
                         const LightSamples& samples);

/// sRGB in [0, 1] of linear light.
Eigen::Vector3d encode(const Eigen::Vector3d& linear);

}  // namespace sinew::assets::detail
