#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/SparseCore>

#include "fem/body/body.h"

namespace sinew::fem::detail {

/// The functions in which the blended step's systems are written, over all leaf vertices.
struct Coordinates {
  Eigen::SparseMatrix<double, Eigen::RowMajor> values;  ///< leaf vertices x functions.
  std::vector<int> vertex;                              ///< leaf vertex of a function.
  /// The coefficient is a position (it moves with a translation), not a detail.
  std::vector<std::uint8_t> is_value;
  std::vector<std::uint8_t> is_known;      ///< on a bone.
  std::vector<int> parent_start, parents;  ///< of details: leaf vertices whose mean is subtracted.

  int num_functions() const { return static_cast<int>(vertex.size()); }

  /// Coefficients are the values of all leaf vertices.
  bool is_nodal() const { return parents.empty() && num_functions() == values.rows(); }
  /// Coefficients of the functions from vertex values.
  void analyse(const lattice::Points& from, lattice::Points& to) const;
};

/// The hierarchical basis: right for every active set.
Coordinates hierarchical_coordinates(const Body& body);

/// Hats of the leaf vertices, which span the active functions' space where every leaf vertex but those on
/// bones is active; elsewhere (also on level 0 alone, whose leaf cells have vertices of level 1) the
/// hierarchical basis.
Coordinates nodal_coordinates(const Body& body);

}  // namespace sinew::fem::detail
