#pragma once

#include <memory>

#include "lattice/surface.h"

namespace sinew::lattice {

/// Distance to and winding number of a triangle surface. Built once, read by any number of threads.
/// One bounding-volume tree serves both questions.
class SurfaceQuery {
 public:
  /// Copies what it needs. `points` is num_vertices x 3 [m], `triangles` num_triangles x 3; triangles of no
  /// area are allowed. Throws std::invalid_argument where there is no triangle, an index is out of range or a
  /// coordinate is not finite.
  explicit SurfaceQuery(const Points& points, const Triangles& triangles);
  ~SurfaceQuery();
  SurfaceQuery(SurfaceQuery&&) noexcept;
  SurfaceQuery& operator=(SurfaceQuery&&) noexcept;

  struct Closest {
    Eigen::Vector3d point;  ///< closest point of the surface [m].
    int triangle = -1;
    double distance = 0.0;  ///< unsigned [m].
  };
  /// The closest point of the surface to `p` [m]. Where triangles are equally close, any of them, but always
  /// the same one.
  Closest closest(const Eigen::Vector3d& p) const;

  /// True where some point of the surface is nearer to `p` than `radius` [m]; cheaper than `closest`.
  bool is_within(const Eigen::Vector3d& p, double radius) const;

  /// Generalised winding number [Jacobson13]: about 1 inside an outward-oriented closed surface, 0 outside;
  /// evaluated on a hierarchy with dipole expansions for far clusters [Barill18]; error below 0.02.
  double winding_number(const Eigen::Vector3d& p) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Closest point of the triangle abc to p ([Ericson05, sec. 5.1.5]); triangles of no area count as their
/// edges.
Eigen::Vector3d closest_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                    const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// Signed solid angle of the triangle abc seen from p, in [-2 pi, 2 pi], positive where p is behind the
/// triangle
/// ([VanOosterom83]).
double solid_angle(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                   const Eigen::Vector3d& c);

}  // namespace sinew::lattice
