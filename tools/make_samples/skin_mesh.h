#pragma once

#include <vector>

#include "lattice/points.h"
#include "lattice/surface.h"
#include "tools/make_samples/solid.h"

namespace sinew::samples {

/// A closed triangle mesh, mirror-symmetric in the plane x = 0.
struct SkinMesh {
  lattice::Points points;        ///< num_vertices x 3 [m], on a grid of one micrometre.
  lattice::Triangles triangles;  ///< counter-clockwise seen from outside.
  std::vector<int> mirror;       ///< of every vertex: its image in the plane x = 0.
};

struct PolygoniseOptions {
  Eigen::Vector3d low, high;  ///< box that holds the solid with a margin [m].
  double spacing = 0.01;      ///< of the sampling grid [m]: about the edge length of the mesh.
  int relaxations = 12;       ///< rounds of evening out the vertices along the surface.
};

/// Meshes the surface of a solid that is symmetric in x = 0 by surface nets (one vertex per grid cell that
/// the surface crosses, one quad per crossed grid edge [Gibson98]), evens the vertices out along the surface
/// and splits the quads at their shorter diagonal.
SkinMesh polygonise(const Solid& solid, const PolygoniseOptions& options);

/// Area-weighted vertex normals, unit.
lattice::Points vertex_normals(const lattice::Points& points, const lattice::Triangles& triangles);

/// Thick segment that a joint moves.
struct WeightBone {
  int joint;
  Eigen::Vector3d start, end;       ///< [m].
  double radius_start, radius_end;  ///< of the flesh round it [m].
};

/// Skinning weights by heat equilibrium on the surface [Baran07, sec. 4]: each vertex is heated by the bone
/// whose flesh it belongs to, with strength 1/distance^2, and heat flows along the surface only, so nothing
/// bleeds across a gap. At most 4 influences per vertex, summing to 1; mirrored vertices get mirrored
/// weights. `mirror_joint` gives for every joint its partner on the other side (itself in the middle).
std::vector<std::vector<lattice::Influence>> heat_weights(const SkinMesh& mesh,
                                                          const std::vector<WeightBone>& bones,
                                                          const std::vector<int>& mirror_joint);

}  // namespace sinew::samples
