#pragma once

#include "fem/body/body.h"

/// Where the pose alone puts leaf vertices.
namespace sinew::fem {

/// x = sum_f s_f T_f X: the skinned lattice [m], num_vertices x 3, with bone vertices exactly on the clip and
/// inactive vertices at the mean of their parents.
lattice::Points skinned_positions(const Body& body, const PosedFrames& posed);

/// The same without bones and parents put right: where the flesh is at home, for measuring distances.
lattice::Points skinned_frames(const Body& body, const PosedFrames& posed);

/// x = sum_f s_f T_f^to (T_f^from)^-1 x: moved with the frames; inactive vertices and bones are not put
/// right.
lattice::Points carried(const Body& body, const lattice::Points& x, const PosedFrames& from,
                        const PosedFrames& to);

/// v = sum_f s_f R_f^to R_f^from^T v: velocities turned with the frames.
lattice::Points turned(const Body& body, const lattice::Points& v, const PosedFrames& from,
                       const PosedFrames& to);

/// Puts bone vertices exactly on the clip.
void place_bones(const Body& body, const PosedFrames& posed, lattice::Points& x);

/// Inactive vertices, but those on bones, at the mean of their parents, coarse to fine, so that `values` lies
/// in the space of the active functions.
void fill_inactive_leaves(const Body& body, lattice::Points& values);

}  // namespace sinew::fem
