#pragma once

#include <string>
#include <vector>

#include "assets/rig.h"
#include "lattice/points.h"

/// Frames in the vertex order of the user's own mesh (--output-mesh).
namespace sinew::assets {

struct MatchOptions {
  /// How far a vertex may be from its partner [-], in diagonals of the rig's box; in (0, 0.01). The default
  /// leaves room for text files with six decimals.
  double tolerance = 1e-5;

  /// Throws std::invalid_argument naming the field.
  void validate() const;
};

/// Numbers for the vertices of a rig (part by part) such that vertices with equal numbers stand together at
/// rest and move alike: the copies along texture seams. Parts that are not simulated keep to themselves.
std::vector<int> moving_together(const Rig& rig, const PhysicsSkin& skin);

/// For every vertex of the user's mesh the vertex of the rig at the same rest position, the first of several
/// that move together. Both in one space; `together` from moving_together. Throws InputError naming `file`
/// and the vertex where there is none within the tolerance, or several that do not move together.
std::vector<int> match_rest_positions(const std::string& file, const lattice::Points& mesh_points,
                                      const lattice::Points& rig_points, const std::vector<int>& together,
                                      const MatchOptions& options = {});

}  // namespace sinew::assets
