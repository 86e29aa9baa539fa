#pragma once

#include <memory>
#include <optional>

#include "lattice/points.h"

namespace sinew::assets::detail {

/// A triangle mesh to shoot rays at.
class RayMesh {
 public:
  RayMesh(const lattice::Points& points, const lattice::Triangles& triangles);
  ~RayMesh();
  RayMesh(RayMesh&&) noexcept;
  RayMesh& operator=(RayMesh&&) noexcept;

  struct Hit {
    int triangle;
    double distance;         ///< in lengths of `direction`.
    double u, v;             ///< barycentric weights of the triangle's second and third corner.
    Eigen::Vector3d normal;  ///< of the flat triangle, not unit; outward where it turns counter-clockwise.
  };
  std::optional<Hit> first_hit(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;
  /// Whether anything lies between the origin and `reach` lengths of `direction`.
  bool is_blocked(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double reach) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew::assets::detail
