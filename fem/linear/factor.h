#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <Eigen/SparseCore>

namespace sinew::fem {

/// Precision in which a factor is kept; the matrix is scaled to unit diagonal first. Solves of large factors
/// are bound by reading it: float takes half of double's time, with a relative error near 3e-7, and Short, of
/// sixteen bits, half of float's, with one near 1e-4.
enum class Precision { Double, Float, Short };

/// Sparse Cholesky factor of a symmetric positive definite matrix: factored once by CHOLMOD (supernodal,
/// METIS), packed into our own dense panels and solved with them, so that one factor can be read by any
/// number of threads.
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

  /// Factors `matrix`; only the lower triangle is read. Replaces what was there. `wanted`: rows in which
  /// solutions are asked for, one flag per row; empty: all.
  [[nodiscard]] Report factorise(const Eigen::SparseMatrix<double>& matrix,
                                 Precision precision = Precision::Double,
                                 std::span<const std::uint8_t> wanted = {});

  /// Solves A x = b in place. In rows that are not wanted the result is finite but undefined: the backward
  /// sweep leaves out what no wanted row depends on. Wanted rows have the same bits whatever else is wanted.
  /// `workspace` is resized as needed. Thread-safe: the factor is only read.
  void solve(Eigen::Ref<Eigen::VectorXd> b, Eigen::VectorXd& workspace) const;

  int size() const;
  /// Entries of the factor's panels, padding included.
  std::size_t num_nonzeros() const;
  /// Entries that one solve reads: all forward, and backward those that wanted rows depend on.
  std::size_t num_read() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew::fem
