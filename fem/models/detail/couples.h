#pragma once

#include <span>

#include "fem/body/leaf_matrices.h"
#include "fem/linear/lanes.h"
#include "fem/linear/large_pages.h"

/// M, K and P of a body, packed for the one pass over all three that a step makes.
namespace sinew::fem::detail {

/// What M, K and P are applied to at one vertex; four lanes each, of which three are used.
struct CoupleInputs {
  Eigen::Vector4d inertia = Eigen::Vector4d::Zero();
  Eigen::Vector4d elastic = Eigen::Vector4d::Zero();
  Eigen::Vector4d tie = Eigen::Vector4d::Zero();
};

/// Entry e couples two leaf vertices, as in LeafMatrices. Always in double: rows of K sum to zero, and in
/// float they would not by so much that a stiff bar is 0.3 mm off.
class Couples {
 public:
  Couples() = default;
  explicit Couples(const LeafMatrices& matrices);

  /// sum over k of M inertia + K elastic + P tie with entry first + k and inputs[columns[k]].
  Eigen::Vector3d apply(std::size_t first, std::span<const int> columns, const CoupleInputs* inputs,
                        Code code = best_code()) const;

 private:
  /// Ten numbers per entry: the three columns of K, then M.
  LargeVector<double> values_;
  LargeVector<double> ties_;  ///< P; empty where no entry has any.
};

}  // namespace sinew::fem::detail
