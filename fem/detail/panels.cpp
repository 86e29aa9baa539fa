#include "fem/detail/panels.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <tbb/parallel_for.h>

namespace sinew::fem::detail {
namespace {

/// Columns of a panel are read in blocks of this many: three degrees of freedom per vertex make most panels
/// multiples of 3, and six broadcast values fit the registers.
constexpr int kBlock = 6;

// A block of w columns, whose first is column j of its panel:
//
//     [1/d          ]   its triangle by rows, with the reciprocals of the diagonal,
//     [ l  1/d      ]
//     [ l   l   1/d ]
//     [  rows below ]   then the rows below in groups of kCount lanes: w vectors per group, zeros at the end.

constexpr int triangle_size(int width) { return width * (width + 1) / 2; }

template <class Scalar>
constexpr int groups_below(int width, int height) {
  constexpr int kLanes = LanesOf<Scalar>::kCount;
  return (height - width + kLanes - 1) / kLanes;
}

template <class Scalar>
constexpr std::size_t block_size(int width, int height) {
  return static_cast<std::size_t>(triangle_size(width) +
                                  groups_below<Scalar>(width, height) * width * LanesOf<Scalar>::kCount);
}

/// t holds the right-hand side of the block's rows: solves for the first W, subtracts them from the rest.
template <int W, class Scalar>
SINEW_INLINE void forward_block(const Scalar* values, Scalar* t, int height) {
  using Lanes = typename LanesOf<Scalar>::Type;
  constexpr int kLanes = LanesOf<Scalar>::kCount;
  Lanes y[W] = {};
  for (int a = 0; a < W; ++a) {
    Scalar sum = t[a];
    for (int b = 0; b < a; ++b) sum -= values[triangle_size(a) + b] * t[b];
    t[a] = sum * values[triangle_size(a) + a];
    y[a] = Lanes{} + t[a];
  }
  const Scalar* below = values + triangle_size(W);
  Scalar* target = t + W;
  for (int g = groups_below<Scalar>(W, height); g > 0; --g, below += W * kLanes, target += kLanes) {
    Lanes sum, l;
    load(target, sum);
    for (int a = 0; a < W; ++a) {
      load(below + a * kLanes, l);
      sum -= l * y[a];
    }
    store(sum, target);
  }
}

/// t holds the solution in the rows below the block, and y in its own: solves for those.
template <int W, class Scalar>
SINEW_INLINE void backward_block(const Scalar* values, Scalar* t, int height) {
  using Lanes = typename LanesOf<Scalar>::Type;
  constexpr int kLanes = LanesOf<Scalar>::kCount;
  Lanes sums[W] = {};
  const Scalar* below = values + triangle_size(W);
  const Scalar* source = t + W;
  for (int g = groups_below<Scalar>(W, height); g > 0; --g, below += W * kLanes, source += kLanes) {
    Lanes x, l;
    load(source, x);
    for (int a = 0; a < W; ++a) {
      load(below + a * kLanes, l);
      sums[a] += l * x;
    }
  }
  for (int a = W - 1; a >= 0; --a) {
    Scalar parts[kLanes];
    store(sums[a], parts);
    for (int half = kLanes / 2; half > 0; half /= 2) {
      for (int i = 0; i < half; ++i) parts[i] += parts[i + half];
    }
    Scalar sum = t[a] - parts[0];
    for (int b = a + 1; b < W; ++b) sum -= values[triangle_size(b) + a] * t[b];
    t[a] = sum * values[triangle_size(a) + a];
  }
}

template <class Scalar>
SINEW_INLINE void forward_block_of(int width, const Scalar* values, Scalar* t, int height) {
  switch (width) {
    case 6:
      return forward_block<6>(values, t, height);
    case 5:
      return forward_block<5>(values, t, height);
    case 4:
      return forward_block<4>(values, t, height);
    case 3:
      return forward_block<3>(values, t, height);
    case 2:
      return forward_block<2>(values, t, height);
    default:
      return forward_block<1>(values, t, height);
  }
}

template <class Scalar>
SINEW_INLINE void backward_block_of(int width, const Scalar* values, Scalar* t, int height) {
  switch (width) {
    case 6:
      return backward_block<6>(values, t, height);
    case 5:
      return backward_block<5>(values, t, height);
    case 4:
      return backward_block<4>(values, t, height);
    case 3:
      return backward_block<3>(values, t, height);
    case 2:
      return backward_block<2>(values, t, height);
    default:
      return backward_block<1>(values, t, height);
  }
}

}  // namespace

/// Sweeps over one panel, compiled once for the processor at hand and once for any.
template <class Scalar>
struct Panels<Scalar>::Sweeps {
  /// Adds to `above` instead of x what belongs to columns from `column_end` on.
  SINEW_INLINE static void forward(const Panels& panels, std::size_t panel, Scalar* x, Scalar* t,
                                   int column_end, Scalar* above) {
    constexpr int kLanes = LanesOf<Scalar>::kCount;
    const Panel& p = panels.panels_[panel];
    const int* rows = panels.row_index_.data() + p.indices;
    std::copy(x + p.first, x + p.first + p.columns, t);
    std::fill(t + p.columns, t + p.rows + kLanes, Scalar(0));
    const Scalar* values = panels.values_.data() + p.values;
    for (int j = 0; j < p.columns; j += kBlock) {
      const int width = std::min(kBlock, p.columns - j);
      forward_block_of(width, values, t + j, p.rows - j);
      values += block_size<Scalar>(width, p.rows - j);
    }
    std::copy(t, t + p.columns, x + p.first);
    int i = p.columns;
    for (; i < p.rows && rows[i - p.columns] < column_end; ++i) x[rows[i - p.columns]] += t[i];
    for (; i < p.rows; ++i) above[panels.top_index_[static_cast<std::size_t>(rows[i - p.columns])]] += t[i];
  }
  SINEW_INLINE static void backward(const Panels& panels, std::size_t panel, Scalar* x, Scalar* t) {
    constexpr int kLanes = LanesOf<Scalar>::kCount;
    const Panel& p = panels.panels_[panel];
    if (!p.needed) return;
    const int* rows = panels.row_index_.data() + p.indices;
    std::copy(x + p.first, x + p.first + p.columns, t);
    for (int i = p.columns; i < p.rows; ++i) t[i] = x[rows[i - p.columns]];
    std::fill(t + p.rows, t + p.rows + kLanes, Scalar(0));
    const Scalar* end = panels.values_.data() + panels.values_end(panel);
    for (int j = (p.columns - 1) / kBlock * kBlock; j >= 0; j -= kBlock) {
      const int width = std::min(kBlock, p.columns - j);
      end -= block_size<Scalar>(width, p.rows - j);
      backward_block_of(width, end, t + j, p.rows - j);
    }
    std::copy(t, t + p.columns, x + p.first);
  }

  SINEW_INLINE static void forward_part(const Panels& panels, const std::vector<Subtree>& part, Scalar* x,
                                        Scalar* t, Scalar* above) {
    std::fill(above, above + panels.num_top_columns_, Scalar(0));
    for (const Subtree& s : part) {
      for (std::size_t k = s.begin; k < s.end; ++k) forward(panels, k, x, t, s.column_end, above);
    }
  }
  SINEW_INLINE static void backward_part(const Panels& panels, const std::vector<Subtree>& part, Scalar* x,
                                         Scalar* t) {
    for (auto s = part.rbegin(); s != part.rend(); ++s) {
      for (std::size_t k = s->end; k-- > s->begin;) backward(panels, k, x, t);
    }
  }
  SINEW_INLINE static void top(const Panels& panels, Scalar* x, Scalar* t) {
    const int all = std::numeric_limits<int>::max();
    for (const std::size_t k : panels.top_) forward(panels, k, x, t, all, nullptr);
    for (auto k = panels.top_.rbegin(); k != panels.top_.rend(); ++k) backward(panels, *k, x, t);
  }

  SINEW_WIDE_LANES static void forward_wide(const Panels& panels, const std::vector<Subtree>& part, Scalar* x,
                                            Scalar* t, Scalar* above) {
    forward_part(panels, part, x, t, above);
  }
  SINEW_WIDE_LANES static void backward_wide(const Panels& panels, const std::vector<Subtree>& part,
                                             Scalar* x, Scalar* t) {
    backward_part(panels, part, x, t);
  }
  SINEW_WIDE_LANES static void top_wide(const Panels& panels, Scalar* x, Scalar* t) { top(panels, x, t); }
  static void forward_any(const Panels& panels, const std::vector<Subtree>& part, Scalar* x, Scalar* t,
                          Scalar* above) {
    forward_part(panels, part, x, t, above);
  }
  static void backward_any(const Panels& panels, const std::vector<Subtree>& part, Scalar* x, Scalar* t) {
    backward_part(panels, part, x, t);
  }
  static void top_any(const Panels& panels, Scalar* x, Scalar* t) { top(panels, x, t); }
};

template <class Scalar>
Panels<Scalar>::Panels(int size, const std::vector<Supernode>& supernodes, std::size_t divide_from) {
  // Parents come later: a needed panel passes the need on to the panel that holds its first row below.
  std::vector<std::uint8_t> needed(static_cast<std::size_t>(size), 0);
  std::size_t num_values = 0;
  for (const Supernode& s : supernodes) {
    const auto columns = needed.begin() + s.first;
    const bool need =
        s.wanted || std::any_of(columns, columns + s.columns, [](std::uint8_t n) { return n != 0; });
    if (need && s.rows > s.columns) needed[static_cast<std::size_t>(s.row_indices[s.columns])] = 1;
    panels_.push_back({s.first, s.columns, s.rows, need, num_values, row_index_.size()});
    row_index_.insert(row_index_.end(), s.row_indices + s.columns, s.row_indices + s.rows);
    work_size_ = std::max(work_size_, s.rows + LanesOf<Scalar>::kCount);
    for (int j = 0; j < s.columns; j += kBlock)
      num_values += block_size<Scalar>(std::min(kBlock, s.columns - j), s.rows - j);
  }
  values_.resize(num_values);
  for (std::size_t k = 0; k < supernodes.size(); ++k) pack(supernodes[k], values_.data() + panels_[k].values);
  top_index_.assign(static_cast<std::size_t>(size), -1);
  divide(divide_from);
}

/// Takes the largest subtrees apart until none is more than an eighth of the whole, then deals them out to
/// parts of about that size. What is left above them is the top.
template <class Scalar>
void Panels<Scalar>::divide(std::size_t divide_from) {
  const std::size_t n = panels_.size();
  std::vector<std::size_t> first(n), size(n);  // of the subtree under a panel: its first panel, its values
  std::vector<std::vector<std::size_t>> children(n + 1);  // the last: roots
  std::vector<std::size_t> panel_of_column(top_index_.size());
  for (std::size_t k = 0; k < n; ++k) {
    for (int j = 0; j < panels_[k].columns; ++j)
      panel_of_column[static_cast<std::size_t>(panels_[k].first + j)] = k;
  }
  for (std::size_t k = 0; k < n; ++k) {
    first[k] = children[k].empty() ? k : first[children[k].front()];
    size[k] = values_end(k) - panels_[k].values;
    for (const std::size_t child : children[k]) size[k] += size[child];
    const bool is_root = panels_[k].rows == panels_[k].columns;
    children[is_root ? n : panel_of_column[static_cast<std::size_t>(row_index_[panels_[k].indices])]]
        .push_back(k);
  }
  const std::size_t most = values_.size() / 8;
  std::vector<std::size_t> roots;
  std::vector<std::size_t> open = children[n];
  if (values_.size() <= divide_from) {
    open.clear();
    for (std::size_t k = 0; k < n; ++k) top_.push_back(k);
  }
  while (!open.empty()) {
    const std::size_t k = open.back();
    open.pop_back();
    if (size[k] <= most || children[k].empty()) {
      roots.push_back(k);
    } else {
      top_.push_back(k);
      open.insert(open.end(), children[k].begin(), children[k].end());
    }
  }
  std::sort(top_.begin(), top_.end());
  std::sort(roots.begin(), roots.end());
  std::size_t dealt = most;
  for (const std::size_t k : roots) {
    if (dealt >= most) {
      parts_.emplace_back();
      dealt = 0;
    }
    parts_.back().push_back({first[k], k + 1, panels_[k].first + panels_[k].columns});
    dealt += size[k];
  }
  for (const std::size_t k : top_) {
    for (int j = 0; j < panels_[k].columns; ++j)
      top_index_[static_cast<std::size_t>(panels_[k].first + j)] = num_top_columns_++;
  }
}

template <class Scalar>
void Panels<Scalar>::pack(const Supernode& s, Scalar* to) const {
  constexpr int kLanes = LanesOf<Scalar>::kCount;
  const auto entry = [&](int row, int column) {
    return s.values[static_cast<std::size_t>(column) * static_cast<std::size_t>(s.rows) +
                    static_cast<std::size_t>(row)];
  };
  for (int j = 0; j < s.columns; j += kBlock) {
    const int width = std::min(kBlock, s.columns - j);
    for (int a = 0; a < width; ++a) {
      for (int b = 0; b < a; ++b) *to++ = static_cast<Scalar>(entry(j + a, j + b));
      *to++ = static_cast<Scalar>(1.0 / entry(j + a, j + a));
    }
    for (int row = j + width; row < s.rows; row += kLanes) {
      for (int a = 0; a < width; ++a) {
        for (int i = row; i < row + kLanes; ++i)
          *to++ = i < s.rows ? static_cast<Scalar>(entry(i, j + a)) : Scalar(0);
      }
    }
  }
}

template <class Scalar>
void Panels<Scalar>::solve(Scalar* x, Scalar* work, Code code) const {
  const bool wide = code == Code::Wide;
  const auto part_work = [&](std::size_t i) {
    return work + work_size_ + static_cast<std::ptrdiff_t>(i) * part_work_size();
  };
  tbb::parallel_for(std::size_t{0}, parts_.size(), [&](std::size_t i) {
    Scalar *t = part_work(i), *above = t + work_size_;
    wide ? Sweeps::forward_wide(*this, parts_[i], x, t, above)
         : Sweeps::forward_any(*this, parts_[i], x, t, above);
  });
  // In the order of the parts: the same bits for any number of threads.
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Scalar* above = part_work(i) + work_size_;
    for (const std::size_t k : top_) {
      Scalar* column = x + panels_[k].first;
      for (int j = 0; j < panels_[k].columns; ++j) column[j] += *above++;
    }
  }
  wide ? Sweeps::top_wide(*this, x, work) : Sweeps::top_any(*this, x, work);
  tbb::parallel_for(std::size_t{0}, parts_.size(), [&](std::size_t i) {
    wide ? Sweeps::backward_wide(*this, parts_[i], x, part_work(i))
         : Sweeps::backward_any(*this, parts_[i], x, part_work(i));
  });
}

template <class Scalar>
std::size_t Panels<Scalar>::num_values_read() const {
  std::size_t read = values_.size();
  for (std::size_t k = 0; k < panels_.size(); ++k) {
    if (!panels_[k].needed) continue;
    read += values_end(k) - panels_[k].values;
  }
  return read;
}

template class Panels<float>;
template class Panels<double>;

}  // namespace sinew::fem::detail
