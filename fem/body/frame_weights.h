#pragma once

#include <Eigen/SparseCore>

#include "fem/body/bone_constraints.h"
#include "lattice/embedding.h"
#include "lattice/surface.h"

namespace sinew::fem {

/// Skinning weights s_f of the leaf vertices, num_vertices x num_frames: rows are non-negative and sum to 1.
/// On level 0 (L + D) s_f = D sbar_f with L the uniform graph Laplacian of the lattice's
/// edges, D_aa = sum_k phi_a(x_k) over the skin vertices and sbar their mean weights; bone vertices are fixed
/// to their frame, shared equally at a joint. Finer vertices take the mean of their parents. Weights below
/// 1e-3 are dropped and the row normalised: they cost time and move nothing visibly.
using FrameWeights = Eigen::SparseMatrix<double, Eigen::RowMajor>;

FrameWeights frame_weights(const lattice::Hierarchy& hierarchy, const lattice::LeafMesh& mesh,
                           const lattice::Embedding& skin, const lattice::Surface& surface,
                           const FrameTree& tree, const BoneConstraints& bones);

/// Weights by which what is known at the hard bones' vertices spreads over the leaf vertices, num_vertices x
/// bones.vertices.size(): on level 0 (L + D) e = 0 off the bones, L and D as above, so that little of it
/// arrives at the skin. Rows sum to at most 1; a vertex on a bone has its own value. Columns of vertices
/// finer than level 0 are empty.
FrameWeights bone_extension(const lattice::Hierarchy& hierarchy, const lattice::LeafMesh& mesh,
                            const lattice::Embedding& skin, const BoneConstraints& bones);

/// Index of the largest weight of each row (the smaller index on a tie).
std::vector<int> dominant_frames(const FrameWeights& weights);

}  // namespace sinew::fem
