#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "lattice/basis.h"
#include "lattice/fill.h"

/// Holds cells that are mostly empty to their neighbours.
namespace sinew::fem {

/// Weak penalty on kinks between cells that hold little flesh and the cells beside them ([Burman10]):
///   S = sum over faces F of gamma mu h int_F [d_n x] . [d_n x] dA,
/// [d_n x] the jump of the normal derivative across F and h half the distance that the two cells take up
/// there. Vertices that hold hardly any flesh have hardly any stiffness of their own and would fly about; so
/// they go on as their neighbours do. S is a scalar matrix times the identity, constant, and zero for every
/// affine map, hence for every rigid motion.
struct GhostPenalty {
  /// gamma [-]; >= 0, 0 = none. From 0.1 on limbs one cell thick lock; 0.01 costs a bar two cells across a
  /// fifth of a percent in bending.
  double strength = 0.01;
  /// Faces count where one of their cells is filled less than this [-]. Cut cells that hold more are held by
  /// their own flesh.
  double below = 0.1;
};

/// A face of two leaf cells on which the penalty acts: the whole of it in the first cell; in the second,
/// which may be coarser, perhaps only a part.
struct GhostFace {
  std::array<int, 2> cell{-1, -1};           ///< leaf cells.
  std::array<int, 4> corner{};               ///< the face's corners among those of the first cell.
  std::array<Eigen::Vector3d, 4> in_second;  ///< their local coordinates in the second cell.
  double share = 1.0;                        ///< of the second cell's face that they span: 4^-levels.
};

/// The faces on which `penalty` acts; `fill`: one per leaf cell. Where a face belongs to more than two cells,
/// as where copies of a cell join, every pair from its two sides counts. Where levels meet, each of the finer
/// cells has its part of the coarser one's face; of cells that come from one coarser one all must be in the
/// mesh then.
std::vector<GhostFace> ghost_faces(const lattice::LeafMesh& mesh,
                                   std::span<const lattice::FillFractions> fill, const GhostPenalty& penalty);

/// S of one face: the leaf vertices that it couples and their matrix, in the order of `vertices` [N/m].
struct GhostMatrix {
  std::vector<int> vertices;
  Eigen::MatrixXd matrix;
};

/// `mu`: of the face's two cells in the mean [Pa].
GhostMatrix ghost_matrix(const lattice::LeafMesh& mesh, const GhostFace& face, double mu,
                         const GhostPenalty& penalty);

}  // namespace sinew::fem
