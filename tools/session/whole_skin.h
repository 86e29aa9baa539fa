#pragma once

#include <string>

#include "assets/rig.h"

/// All vertices of a character, part by part: the order of every exported frame.
namespace sinew::tools {

/// At rest, num_vertices(rig) x 3 [m].
lattice::Points rest_points(const assets::Rig& rig);

/// Triangles of all parts over all vertices.
lattice::Triangles all_triangles(const assets::Rig& rig);

/// The whole character: `skinned`, but for the flesh, which lies where `surface` has the welded skin
/// (assets/lattice_input.h). num_vertices x 3 [m].
lattice::Points with_flesh(const assets::PhysicsSkin& skin, const lattice::Points& skinned,
                           const lattice::Points& surface);

/// Where a vertex is, in the user's names: the joint with most weight there, and the part where there are
/// several: "'LeftArm' (part 'Body')".
std::string place_of(const assets::Rig& rig, int vertex);

}  // namespace sinew::tools
