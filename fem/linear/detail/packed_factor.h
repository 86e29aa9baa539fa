#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <variant>
#include <vector>

#include <Eigen/Core>
#include <cholmod.h>

#include "fem/linear/detail/panels.h"
#include "fem/linear/factor.h"

/// CHOLMOD's factor copied into panels of our own.
namespace sinew::fem::detail {

class PackedFactor {
 public:
  PackedFactor() = default;
  /// `factor`: supernodal, of S A S with S the diagonal matrix of `scale`. `wanted` as in Factor::factorise.
  PackedFactor(const cholmod_factor& factor, Eigen::VectorXd scale, Precision precision,
               std::span<const std::uint8_t> wanted = {});

  /// Solves A x = b in place; `workspace` is resized as needed. Thread-safe.
  void solve(Eigen::Ref<Eigen::VectorXd> b, Eigen::VectorXd& workspace) const;

  int size() const { return static_cast<int>(scale_.size()); }
  std::size_t num_values() const;
  std::size_t num_values_read() const;

 private:
  Eigen::VectorXd scale_;
  std::vector<int> permutation_;  ///< row of A at position i of the factor.
  std::variant<Panels<double>, Panels<float>, Panels<Pair>> panels_;
};

/// 1 / sqrt(diagonal): Jacobi scaling, so a nearly empty cell cannot spoil a float.
Eigen::VectorXd jacobi_scale(const Eigen::VectorXd& diagonal);

}  // namespace sinew::fem::detail
