#pragma once

#include <vector>

#include "lattice/surface.h"
#include "lattice/surface_query.h"

namespace sinew::lattice::detail {

/// Where unit coordinates have their origin and axes [m].
struct MirrorFrame {
  Eigen::Vector3d origin{0, 0, 0};
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< rows; right-handed.
};

/// The skin as the builder sees it: centred on its bounding box (or on its plane of symmetry, then the plane
/// is x = 0), longest side of the box 1, welded, without degenerate and doubled triangles, every component
/// turned outward.
struct UnitSkin {
  Eigen::Vector3d centre{0, 0, 0};              ///< origin of the unit coordinates [m].
  Eigen::Matrix3d axes;                         ///< rows: the axes of the unit coordinates.
  double scale = 1.0;                           ///< longest side of the bounding box [m].
  Points points;                                ///< welded, unit coordinates.
  Triangles triangles;                          ///< at least one.
  std::vector<std::vector<Influence>> weights;  ///< per welded point.
  std::vector<Eigen::Vector3d> normals;  ///< per welded point, area weighted; zero where no triangle is.
  std::vector<double> areas;             ///< a third of the triangles round each welded point.
  std::vector<int> welded;               ///< per vertex of the caller's skin: its welded point.
  SurfaceQuery query;

  Eigen::Vector3d to_unit(const Eigen::Vector3d& p) const { return axes * (p - centre) / scale; }
  Eigen::Vector3d to_rest(const Eigen::Vector3d& p) const { return centre + scale * (axes.transpose() * p); }
  bool is_inside(const Eigen::Vector3d& p) const { return query.winding_number(p) > 0.5; }
};

/// With `frame`, in its coordinates. Throws std::invalid_argument where no triangle with an area is left or a
/// coordinate is not finite.
UnitSkin make_unit_skin(const Surface& skin, const MirrorFrame* frame = nullptr);

}  // namespace sinew::lattice::detail
