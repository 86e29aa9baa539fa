#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "fem/detail/lanes.h"

/// The supernodes of a Cholesky factor as dense panels, packed in the order in which a solve reads them.
namespace sinew::fem::detail {

/// One supernode as CHOLMOD keeps it: columns first .. first + columns - 1 of L.
struct Supernode {
  int first = 0, columns = 0, rows = 0;
  const double* values = nullptr;    ///< column-major, `rows` high; its top square is lower triangular.
  const int* row_indices = nullptr;  ///< of its rows, its own columns first.
  bool wanted = true;                ///< the solution in some of its columns is asked for.
};

template <class Scalar>
class Panels {
 public:
  Panels() = default;
  /// Copies a factor of `size` rows; supernodes in ascending order.
  Panels(int size, const std::vector<Supernode>& supernodes);

  /// Solves L y = b, then L^T x = y, in place. Where a panel neither is wanted nor has a wanted descendant,
  /// x is left at y: the backward sweep runs from the root down, and nothing wanted depends on it.
  /// `work`: work_size() numbers.
  void solve(Scalar* x, Scalar* work, Code code = best_code()) const;
  int work_size() const { return work_size_; }

  std::size_t num_values() const { return values_.size(); }
  /// Values that a solve reads: all once forward, those of needed panels once backward.
  std::size_t num_values_read() const;

 private:
  struct Panel {
    int first = 0, columns = 0, rows = 0;
    bool needed = false;      ///< wanted, or an ancestor of one that is.
    std::size_t values = 0;   ///< offset of its first block.
    std::size_t indices = 0;  ///< offset of the indices of its rows below the triangle.
  };
  void pack(const Supernode& supernode, Scalar* to) const;
  struct Sweeps;

  std::vector<Panel> panels_;
  std::vector<int> row_index_;
  std::vector<Scalar> values_;
  int work_size_ = 0;
};

extern template class Panels<float>;
extern template class Panels<double>;

}  // namespace sinew::fem::detail
