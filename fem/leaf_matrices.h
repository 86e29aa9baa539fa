#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "fem/cell_matrices.h"
#include "lattice/basis.h"

/// Mass, stiffness and tie matrices over the leaf vertices, one sparsity pattern for all three.
namespace sinew::fem {

/// Rows over leaf vertices in compressed form; entry e couples vertex `row` and vertex column[e]. All three
/// matrices are symmetric; both triangles are stored.
struct LeafMatrices {
  std::vector<int> row_start;              ///< num_vertices + 1.
  std::vector<int> column;                 ///< ascending in each row.
  std::vector<double> mass;                ///< M [kg], times the 3 x 3 identity.
  std::vector<double> tie;                 ///< P [N/m], times the 3 x 3 identity; zero until ties are added.
  std::vector<Eigen::Matrix3d> stiffness;  ///< K [N/m], 3 x 3 blocks.

  int num_vertices() const { return static_cast<int>(row_start.size()) - 1; }
  /// Index of the entry (row, col); it must exist.
  int entry(int row, int col) const;
};

/// Assembles M and K. `materials` and `fill`: one per leaf cell.
LeafMatrices assemble(const lattice::LeafMesh& mesh, std::span<const Material> materials,
                      std::span<const lattice::FillFractions> fill);

/// y = M x, K x or P x with x and y num_vertices x 3; for tests and energies, serial.
lattice::Points apply_mass(const LeafMatrices& matrices, const lattice::Points& x);
lattice::Points apply_stiffness(const LeafMatrices& matrices, const lattice::Points& x);
lattice::Points apply_tie(const LeafMatrices& matrices, const lattice::Points& x);

/// The three matrices in function coefficients, B^T A B with B = mesh.values_from_coefficients; dof 3 f + c.
Eigen::SparseMatrix<double> function_mass(const LeafMatrices& matrices, const lattice::LeafMesh& mesh);
Eigen::SparseMatrix<double> function_stiffness(const LeafMatrices& matrices, const lattice::LeafMesh& mesh);

}  // namespace sinew::fem
