#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/SparseCore>

#include "fem/body/body.h"
#include "fem/models/detail/coordinates.h"
#include "fem/models/detail/couples.h"
#include "fem/models/integrator.h"

/// The systems of the blended step's regions: which unknowns, rows and neighbours each has, and its matrix.
namespace sinew::fem::detail {

/// Everything of one region that does not change with the step size, and buffers of the step.
struct RegionSystem {
  using RowSparse = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  const Region* region = nullptr;
  std::vector<int> functions;  ///< unknown ones first, then known neighbours.
  int num_unknown = 0;
  std::vector<int>
      vertices;  ///< leaf vertices: rows (where an unknown function lives) first, then their neighbours.
  int num_rows = 0;
  RowSparse values;                      ///< vertices x functions (local).
  bool values_are_coefficients = false;  ///< `values` is the identity: true in the nodal basis.
  RowSparse rows_to_unknown;   ///< num_unknown x num_rows: transpose of the unknown part of `values`.
  std::vector<int> row_start;  ///< of the rows' neighbours,
  std::vector<int> column;     ///< as local vertices;
  std::vector<int> entry;      ///< entries of the body's matrices start here, per row.
  std::vector<int> blended;    ///< local vertex of each of region->vertices, -1 for bone vertices.
  std::vector<std::pair<int, std::vector<std::pair<int, int>>>> ties;  ///< tie, (its entry, local row).

  // Buffers of the step, so that a step allocates nothing.
  std::vector<CoupleInputs> coefficients;  ///< per function.
  std::vector<CoupleInputs> inputs;        ///< per local vertex.
  lattice::Points row_force;               ///< per row.
  lattice::Points velocity;                ///< per function, in rotated axes.
  Eigen::VectorXd solution, workspace;
  lattice::Points result;  ///< contribution to the blended velocity, one row per region->vertices.
};

/// One system per region of the body, which must outlive them. Unknown are the functions, but those known on
/// bones, whose support meets a leaf cell with a vertex of weight > 0, and those whose own vertex lies in
/// `rings` rings of cells round such cells.
std::vector<RegionSystem> region_systems(const Body& body, const Coordinates& coordinates, int rings);

/// A_i = B_U^T (cM M + cK K + cP P) B_U over the region's rows; 3 num_unknown squared.
Eigen::SparseMatrix<double> region_matrix(const Body& body, const RegionSystem& system,
                                          const SystemFactors& factors);

/// Flags of the system's 3 num_unknown rows whose solution the blended vertices read; the rest, most of the
/// ring, is discarded.
std::vector<std::uint8_t> wanted_rows(const RegionSystem& system);

}  // namespace sinew::fem::detail
