#pragma once

#include <optional>
#include <vector>

#include "lattice/control_lattice.h"
#include "lattice/hierarchy.h"
#include "lattice/surface.h"

/// Lattices that are their own mirror image.
namespace sinew::lattice {

/// The plane normal . x = offset [m].
struct MirrorPlane {
  Eigen::Vector3d normal{1, 0, 0};  ///< of length 1.
  double offset = 0.0;

  /// Signed distance [m].
  double side(const Eigen::Vector3d& p) const { return normal.dot(p) - offset; }
  Eigen::Vector3d image(const Eigen::Vector3d& p) const { return p - 2.0 * side(p) * normal; }
};

/// Which parts of a lattice are each other's mirror images; what lies on the plane is its own. Every list is
/// its own inverse.
struct MirrorMap {
  MirrorPlane plane;
  std::vector<int> vertices;  ///< of the lattice.
  std::vector<int> cells;
  std::vector<int> bones;
  std::vector<int> frames;  ///< per joint; -1 where it owns neither bone nor soft frame.
};

/// The mirror image of a lattice to 1e-9 of its size, copies and the frames they hold included, round a skin
/// whose vertices are mirrored as well, to 1e-5 of that size, and their weights in the mean to 0.02. Planes
/// normal to an axis are tried, then those normal to a principal axis of the lattice. Nothing where there is
/// none, or where the skin has no weights.
std::optional<MirrorMap> find_mirror_map(const ControlLattice& lattice, const Surface& skin);

/// The partner of every vertex of the hierarchy over the lattice of `mirror`: that of a new vertex has the
/// partners of its parents for parents.
std::vector<int> mirrored_vertices(const Hierarchy& hierarchy, const MirrorMap& mirror);

}  // namespace sinew::lattice
