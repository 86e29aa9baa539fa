#pragma once

#include <vector>

#include "lattice/detail/cell_sizes.h"
#include "lattice/detail/skeleton_reduction.h"
#include "lattice/detail/unit_skin.h"

namespace sinew::lattice::detail {

/// The vertices of a lattice to be, unit coordinates.
struct LatticePoints {
  /// Where a vertex may go.
  struct Place {
    int bone = -1;       ///< the hard bone it lies on; -1 for free vertices and joints.
    double s = 0.0;      ///< parameter along that bone, in (0, 1).
    bool fixed = false;  ///< a joint: it stays.
  };
  std::vector<Eigen::Vector3d> points;
  std::vector<Place> places;  ///< one per point.
  /// Per bone of the reduced skeleton its vertices from start to end; empty for soft bones.
  std::vector<std::vector<int>> chains;
  /// True where these are the half x >= 0 of a mirrored lattice: vertices with x = 0 stay in that plane, and
  /// faces in it are no boundary.
  bool half = false;

  bool is_in_plane(int vertex) const { return half && points[vertex].x() == 0.0; }

  int add(const Eigen::Vector3d& p, const Place& place) {
    points.push_back(p);
    places.push_back(place);
    return static_cast<int>(points.size()) - 1;
  }
};

/// The point at parameter s of a bone, (1 - s) a + s b.
Eigen::Vector3d point_on_bone(const ReducedSkeleton& skeleton, int bone, double s);

/// How free points keep away from the bones.
struct PointOptions {
  double exclusion = 0.62;           ///< in units of min(h, max(l, h/2)), l the length of the bone piece.
  double shift = 0.0;                ///< of the grid, along all axes, in units of the side of its cubes.
  const CellSizes* sizes = nullptr;  ///< h of every place; null: the same everywhere.
  Poll poll = {};

  double edge_at(const Eigen::Vector3d& p, double h) const {
    return sizes == nullptr ? h : sizes->edge_at(p, h);
  }
  bool is_uniform(double h) const { return sizes == nullptr || sizes->is_uniform(h); }
};

/// True where a free point would come too close to a piece of some bone: the ball about the middle of each
/// piece stays empty, so that the piece is a Delaunay edge.
class BoneClearance {
 public:
  BoneClearance(const LatticePoints& points, double h, const PointOptions& options);
  bool is_too_close(const Eigen::Vector3d& p) const;
  /// To the nearest bone piece where it is nearer than 2 h, else infinite.
  double distance(const Eigen::Vector3d& p) const;

 private:
  struct Piece {
    Eigen::Vector3d a, b;
    double radius;         ///< about the piece.
    double middle_radius;  ///< about its midpoint.
  };
  const std::vector<int>& pieces_near(const Eigen::Vector3d& p) const;

  std::vector<Piece> pieces_;
  Eigen::Vector3d low_{0, 0, 0};
  double side_ = 1.0;
  Eigen::Vector3i count_{0, 0, 0};
  std::vector<std::vector<int>> bins_;  ///< pieces within reach of some point of each bin.
  std::vector<int> none_;
};

/// Joints, bone samples every 1.1 h, and a body-centred cubic grid of nearest distance h, symmetric about the
/// origin, inside the skin and within 1.2 h of it; where sizes vary, place_graded_points. Of a mirrored
/// skeleton the half x >= 0 alone, with points on the plane.
LatticePoints place_points(const UnitSkin& skin, const ReducedSkeleton& skeleton, double h,
                           const PointOptions& options);

}  // namespace sinew::lattice::detail
