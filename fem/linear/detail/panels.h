#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "fem/linear/lanes.h"
#include "fem/linear/large_pages.h"

/// The supernodes of a Cholesky factor as dense panels, packed in the order in which a solve reads them.
namespace sinew::fem::detail {

/// One supernode as CHOLMOD keeps it: columns first .. first + columns - 1 of L.
struct Supernode {
  int first = 0, columns = 0, rows = 0;
  const double* values = nullptr;    ///< column-major, `rows` high; its top square is lower triangular.
  const int* row_indices = nullptr;  ///< of its rows, its own columns first.
  bool wanted = true;                ///< the solution in some of its columns is asked for.
};

/// Two entries of sixteen bits: shares of the largest that their column of L has below its block, to 1.5e-5.
using Pair = std::uint32_t;

/// What a solve computes in where panels are kept in `Stored`.
template <class Stored>
struct ComputedIn {
  using Type = Stored;
};
template <>
struct ComputedIn<Pair> {
  using Type = float;
};

/// Stored: double, float or Pair.
template <class Stored>
class Panels {
 public:
  using Scalar = typename ComputedIn<Stored>::Type;

  Panels() = default;
  /// Copies a factor of `size` rows; supernodes in ascending postorder. Factors of more than `divide_from`
  /// values are divided into subtrees that threads solve side by side.
  Panels(int size, const std::vector<Supernode>& supernodes, std::size_t divide_from = kDivideFrom);

  /// Solves L y = b, then L^T x = y, in place. Where a panel neither is wanted nor has a wanted descendant,
  /// x is left at y: the backward sweep runs from the root down, and nothing wanted depends on it.
  /// `work`: work_size() numbers. The bits do not depend on the number of threads.
  void solve(Scalar* x, Scalar* work, Code code = best_code()) const;
  int work_size() const { return work_size_ + num_parts() * part_work_size(); }
  /// Parts of the factor that are solved side by side; 0: the whole of it in one go.
  int num_parts() const { return static_cast<int>(parts_.size()); }

  /// Entries of the panels, padding included.
  std::size_t num_values() const { return num_values_; }
  /// Values that a solve reads: all once forward, those of needed panels once backward.
  std::size_t num_values_read() const { return num_values_ + num_needed_values_; }

 private:
  struct Panel {
    int first = 0, columns = 0, rows = 0;
    bool needed = false;      ///< wanted, or an ancestor of one that is.
    std::size_t values = 0;   ///< offset of its first block.
    std::size_t indices = 0;  ///< offset of the indices of its rows below the triangle.
  };
  /// A subtree: panels begin .. end - 1, with the columns below `column_end`.
  struct Subtree {
    std::size_t begin = 0, end = 0;
    int column_end = 0;
  };
  void pack(const Supernode& supernode, Stored* to) const;
  std::size_t values_end(std::size_t panel) const {
    return panel + 1 < panels_.size() ? panels_[panel + 1].values : values_.size();
  }
  void divide(std::size_t divide_from);
  int part_work_size() const { return work_size_ + num_top_columns_; }
  struct Sweeps;

  /// Half a megabyte of floats takes as long as starting a few tasks twice does.
  static constexpr std::size_t kDivideFrom = std::size_t{1} << 18;

  std::vector<Panel> panels_;
  std::vector<int> row_index_;
  LargeVector<Stored> values_;
  std::size_t num_values_ = 0, num_needed_values_ = 0;
  int work_size_ = 0;
  std::vector<std::vector<Subtree>> parts_;
  std::vector<std::size_t> top_;  ///< panels above all subtrees, ascending.
  std::vector<int> top_index_;    ///< of a column: its place among the columns of `top_`, or -1.
  int num_top_columns_ = 0;
};

extern template class Panels<Pair>;
extern template class Panels<float>;
extern template class Panels<double>;

}  // namespace sinew::fem::detail
