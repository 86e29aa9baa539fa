#pragma once

#include <vector>

#include <Eigen/SparseCore>

#include "fem/body/body.h"

/// The unknowns of models that solve the flesh as one system, and its matrices.
namespace sinew::fem {

/// Unknowns are the values at the active leaf vertices off the bones; inactive vertices are the mean of their
/// parents, which spans the same space as the hierarchical basis with far fewer couplings.
struct FreeVertices {
  std::vector<int> vertex;  ///< leaf vertex of every unknown, ascending.
  /// How a leaf vertex follows: unknowns and their weights, row_start[a] .. row_start[a + 1]; none on bones.
  std::vector<int> row_start, unknown;
  std::vector<double> weight;

  int num_unknowns() const { return static_cast<int>(vertex.size()); }
  /// The change of all leaf vertices for a change of the unknowns (num_unknowns x 3).
  lattice::Points spread(const lattice::Points& unknowns) const;
  /// Its transpose: forces on the unknowns.
  lattice::Points gather(const lattice::Points& leaf_forces) const;
};
FreeVertices free_vertices(const Body& body);

/// Symmetric matrix of 3 x 3 blocks over the unknowns, both triangles stored.
class BlockSystem {
 public:
  using Block = Eigen::Matrix3d;

  /// `body` and `free` must outlive the system.
  BlockSystem(const Body& body, const FreeVertices& free);

  /// What the constant matrices count.
  struct Shares {
    double mass = 0.0;   ///< of M.
    double tie = 0.0;    ///< of P.
    double ghost = 0.0;  ///< of S.
  };
  /// A = mass M + tie P + ghost S + the cells' matrices, one per leaf cell.
  void assemble(const Shares& shares, const std::vector<CellStiffness>& cells);

  /// y = A x; num_unknowns x 3.
  void apply(const lattice::Points& x, lattice::Points& y) const;
  /// Adds `shift` to the diagonal.
  void shift_diagonal(double shift);
  Eigen::VectorXd diagonal() const;
  /// Lower triangle, dof 3 * unknown + component; the pattern is the same every time.
  const Eigen::SparseMatrix<double>& lower();

 private:
  /// A cell's block that counts towards an entry.
  struct Part {
    int cell;
    std::int8_t row, column;  ///< corners.
    double weight;
  };

  std::vector<int> row_start_, column_;
  std::vector<double> mass_, tie_, ghost_;
  std::vector<int> part_start_;
  std::vector<Part> parts_;
  std::vector<Block> block_;
  Eigen::SparseMatrix<double> lower_;
};

}  // namespace sinew::fem
