#pragma once

#include <memory>
#include <optional>

#include "fem/linear/factor.h"

namespace sinew::fem {

/// Sparse Cholesky factors of matrices that share one pattern: the order is sought once (METIS or AMD), the
/// numbers are made anew each time.
class RepeatedFactor {
 public:
  /// `packed`: for many solves, from panels of this precision; left out: for few, from CHOLMOD's own.
  explicit RepeatedFactor(std::optional<Precision> packed = {});
  ~RepeatedFactor();
  RepeatedFactor(RepeatedFactor&&) noexcept;
  RepeatedFactor& operator=(RepeatedFactor&&) noexcept;

  /// Factors the matrix whose lower triangle is given; from the second call on the pattern must be the first
  /// one's. After a report that is not ok there is no factor to solve with.
  [[nodiscard]] Factor::Report factorise(const Eigen::SparseMatrix<double>& lower);

  bool ok() const;
  /// Solves A x = b in place; not thread-safe.
  void solve(Eigen::Ref<Eigen::VectorXd> b) const;

  /// Entries of the factor, padding of its panels included.
  std::size_t num_nonzeros() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew::fem
