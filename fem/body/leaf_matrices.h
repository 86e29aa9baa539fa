#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "fem/body/cell_matrices.h"
#include "fem/body/ghost_penalty.h"
#include "lattice/basis.h"

/// Mass, stiffness, tie and ghost matrices over the leaf vertices, one sparsity pattern for all of them.
namespace sinew::fem {

/// Rows over leaf vertices in compressed form; entry e couples vertex `row` and vertex column[e]. All
/// matrices are symmetric; both triangles are stored.
struct LeafMatrices {
  std::vector<int> row_start;              ///< num_vertices + 1.
  std::vector<int> column;                 ///< ascending in each row.
  std::vector<double> mass;                ///< M [kg], times the 3 x 3 identity.
  std::vector<double> tie;                 ///< P [N/m], times the 3 x 3 identity; zero until ties are added.
  std::vector<double> ghost;               ///< S [N/m], times the 3 x 3 identity (fem/body/ghost_penalty.h).
  std::vector<Eigen::Matrix3d> stiffness;  ///< K + S [N/m], 3 x 3 blocks.

  int num_vertices() const { return static_cast<int>(row_start.size()) - 1; }
  /// Index of the entry (row, col); it must exist.
  int entry(int row, int col) const;
};

/// Assembles M, K and S. `materials` and `fill`: one per leaf cell.
LeafMatrices assemble(const lattice::LeafMesh& mesh, std::span<const Material> materials,
                      std::span<const lattice::FillFractions> fill, const GhostPenalty& penalty = {});

/// y = M x, (K + S) x, P x or S x with x and y num_vertices x 3; serial.
lattice::Points apply_mass(const LeafMatrices& matrices, const lattice::Points& x);
lattice::Points apply_stiffness(const LeafMatrices& matrices, const lattice::Points& x);
lattice::Points apply_tie(const LeafMatrices& matrices, const lattice::Points& x);
/// Of places counted from the first of them: S is zero for shifts, and far from the origin no digits are
/// lost.
lattice::Points apply_ghost(const LeafMatrices& matrices, const lattice::Points& x);

/// The three matrices in function coefficients, B^T A B with B = mesh.values_from_coefficients; dof 3 f + c.
Eigen::SparseMatrix<double> function_mass(const LeafMatrices& matrices, const lattice::LeafMesh& mesh);
Eigen::SparseMatrix<double> function_stiffness(const LeafMatrices& matrices, const lattice::LeafMesh& mesh);

}  // namespace sinew::fem
