#pragma once

#include <memory>
#include <string>

#include <Eigen/SparseCore>

namespace sinew::fem {

/// Precision in which a factor is kept. Solves are bound by reading it, so float takes about half the time,
/// with a relative error near 3e-7 (the matrix is scaled to unit diagonal first).
enum class Precision { Double, Float };

/// Sparse Cholesky factor of a symmetric positive definite matrix: factored once by CHOLMOD (supernodal,
/// METIS), kept as our own dense panels and solved with them, so that one factor can be read by any number of
/// threads.
class Factor {
 public:
  Factor();
  ~Factor();
  Factor(Factor&&) noexcept;
  Factor& operator=(Factor&&) noexcept;

  /// What factoring found.
  struct Report {
    bool ok = false;
    int pivot = -1;       ///< first row whose pivot is not positive; -1 when ok.
    std::string message;  ///< one sentence.
  };

  /// Factors `matrix`; only the lower triangle is read. Replaces what was there.
  [[nodiscard]] Report factorise(const Eigen::SparseMatrix<double>& matrix,
                                 Precision precision = Precision::Double);

  /// Solves A x = b in place; `workspace` is resized as needed. Thread-safe: the factor is only read.
  void solve(Eigen::Ref<Eigen::VectorXd> b, Eigen::VectorXd& workspace) const;

  int size() const;
  /// Entries of the factor's panels, padding included.
  std::size_t num_nonzeros() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew::fem
