#pragma once

#include <memory>

#include "lattice/surface.h"

namespace sinew::lattice {

/// Distance to and winding number of a triangle surface. Built once, read by any number of threads.
class SurfaceQuery {
 public:
  /// Copies what it needs. Throws std::invalid_argument where there is no triangle.
  explicit SurfaceQuery(const Points& points, const Triangles& triangles);
  ~SurfaceQuery();
  SurfaceQuery(SurfaceQuery&&) noexcept;
  SurfaceQuery& operator=(SurfaceQuery&&) noexcept;

  struct Closest {
    Eigen::Vector3d point;  ///< closest point of the surface [m].
    int triangle = -1;
    double distance = 0.0;  ///< unsigned [m].
  };
  Closest closest(const Eigen::Vector3d& p) const;

  /// Generalised winding number [Jacobson13]: about 1 inside an outward-oriented closed surface, 0 outside;
  /// evaluated on a hierarchy with dipole expansions for far clusters [Barill18]; error below 0.02.
  double winding_number(const Eigen::Vector3d& p) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew::lattice
