#include "fem/linear/detail/panels.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#include <tbb/parallel_for.h>

namespace sinew::fem::detail {
namespace {

/// Columns of a panel are read in blocks of this many: three degrees of freedom per vertex make most panels
/// multiples of 3, and six broadcast values fit the registers.
constexpr int kBlock = 6;

// A block of w columns, whose first is column j of its panel:
//
//     [ inverse of ]   of its triangle, by rows: a product waits for nothing, where a substitution would wait
//     [ triangle   ]   six times for the entry before; then, of pairs, what a unit is worth in every column,
//     [ rows below ]   in groups of kLanes rows: a vector per column or pair of columns, zeros at the end.

template <class Stored>
using ScalarOf = typename ComputedIn<Stored>::Type;
template <class Stored>
using Lanes = typename LanesOf<ScalarOf<Stored>>::Type;
template <class Stored>
constexpr int kLanes = LanesOf<ScalarOf<Stored>>::kCount;
template <class Stored>
constexpr bool kPairs = std::is_same_v<Stored, Pair>;

constexpr int triangle_size(int width) { return width * (width + 1) / 2; }

template <class Stored>
constexpr int head_size(int width) {
  return triangle_size(width) + (kPairs<Stored> ? width : 0);
}

template <class Stored>
constexpr int group_size(int width) {
  return (kPairs<Stored> ? (width + 1) / 2 : width) * kLanes<Stored>;
}

template <class Stored>
constexpr int groups_below(int width, int height) {
  return (height - width + kLanes<Stored> - 1) / kLanes<Stored>;
}

template <class Stored>
constexpr std::size_t block_size(int width, int height) {
  return static_cast<std::size_t>(head_size<Stored>(width) +
                                  groups_below<Stored>(width, height) * group_size<Stored>(width));
}

/// What stands before a block's rows below.
template <int W, class Stored>
struct Head {
  const Stored* triangle;
  SINEW_INLINE explicit Head(const Stored* values) : triangle(values) {}
  SINEW_INLINE Stored worth(int) const { return Stored(1); }
};
template <int W>
struct Head<W, Pair> {
  float triangle[head_size<Pair>(W)];
  SINEW_INLINE explicit Head(const Pair* values) { std::memcpy(triangle, values, sizeof(triangle)); }
  SINEW_INLINE float worth(int column) const { return triangle[triangle_size(W) + column]; }
};

/// Calls use(column, its entries in a group of rows below) for every column.
template <int W, class Scalar, class Use>
SINEW_INLINE void for_columns(const Scalar* group, const Use& use) {
  for (int a = 0; a < W; ++a) {
    Lanes<Scalar> l;
    load(group + a * kLanes<Scalar>, l);
    use(a, l);
  }
}
template <int W, class Use>
SINEW_INLINE void for_columns(const Pair* group, const Use& use) {
  for (int a = 0; a < W; a += 2) {
    Float8 upper, lower;
    load_pairs(group + a / 2 * kLanes<Pair>, upper, lower);
    use(a, upper);
    if (a + 1 < W) use(a + 1, lower);
  }
}

/// t holds the right-hand side of the block's rows: solves for the first W, subtracts them from the rest.
template <int W, class Stored>
SINEW_INLINE void forward_block(const Stored* values, ScalarOf<Stored>* t, int height) {
  using Scalar = ScalarOf<Stored>;
  const Head<W, Stored> head(values);
  Scalar y[W];
  Lanes<Stored> factors[W];
  for (int a = 0; a < W; ++a) {
    y[a] = Scalar(0);
    for (int b = 0; b <= a; ++b) y[a] += head.triangle[triangle_size(a) + b] * t[b];
    factors[a] = Lanes<Stored>{} + head.worth(a) * y[a];
  }
  std::copy(y, y + W, t);
  const Stored* group = values + head_size<Stored>(W);
  Scalar* target = t + W;
  for (int g = groups_below<Stored>(W, height); g > 0; --g) {
    Lanes<Stored> sum;
    load(target, sum);
    for_columns<W>(group, [&](int a, const Lanes<Stored>& l) { sum -= l * factors[a]; });
    store(sum, target);
    group += group_size<Stored>(W);
    target += kLanes<Stored>;
  }
}

/// t holds the solution in the rows below the block, and y in its own: solves for those. Reads the block from
/// its end to its begin, where the one that is read next ends.
template <int W, class Stored>
SINEW_INLINE void backward_block(const Stored* values, ScalarOf<Stored>* t, int height) {
  using Scalar = ScalarOf<Stored>;
  Lanes<Stored> sums[W] = {};
  int g = groups_below<Stored>(W, height);
  const Stored* group = values + head_size<Stored>(W) + std::ptrdiff_t{g} * group_size<Stored>(W);
  for (; g > 0; --g) {
    group -= group_size<Stored>(W);
    Lanes<Stored> x;
    load(t + W + (g - 1) * kLanes<Stored>, x);
    for_columns<W>(group, [&](int a, const Lanes<Stored>& l) { sums[a] += l * x; });
  }
  const Head<W, Stored> head(values);
  Scalar rest[W];
  for (int a = 0; a < W; ++a) {
    Scalar parts[kLanes<Stored>];
    store(sums[a], parts);
    for (int half = kLanes<Stored> / 2; half > 0; half /= 2) {
      for (int i = 0; i < half; ++i) parts[i] += parts[i + half];
    }
    rest[a] = t[a] - head.worth(a) * parts[0];
  }
  for (int a = 0; a < W; ++a) {
    t[a] = Scalar(0);
    for (int b = a; b < W; ++b) t[a] += head.triangle[triangle_size(b) + a] * rest[b];
  }
}

template <class Stored>
SINEW_INLINE void forward_block_of(int width, const Stored* values, ScalarOf<Stored>* t, int height) {
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

template <class Stored>
SINEW_INLINE void backward_block_of(int width, const Stored* values, ScalarOf<Stored>* t, int height) {
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
template <class Stored>
struct Panels<Stored>::Sweeps {
  /// Adds to `above` instead of x what belongs to columns from `column_end` on.
  SINEW_INLINE static void forward(const Panels& panels, std::size_t panel, Scalar* x, Scalar* t,
                                   int column_end, Scalar* above) {
    const Panel& p = panels.panels_[panel];
    const int* rows = panels.row_index_.data() + p.indices;
    std::copy(x + p.first, x + p.first + p.columns, t);
    std::fill(t + p.columns, t + p.rows + kLanes<Stored>, Scalar(0));
    const Stored* values = panels.values_.data() + p.values;
    for (int j = 0; j < p.columns; j += kBlock) {
      const int width = std::min(kBlock, p.columns - j);
      forward_block_of(width, values, t + j, p.rows - j);
      values += block_size<Stored>(width, p.rows - j);
    }
    std::copy(t, t + p.columns, x + p.first);
    int i = p.columns;
    for (; i < p.rows && rows[i - p.columns] < column_end; ++i) x[rows[i - p.columns]] += t[i];
    for (; i < p.rows; ++i) above[panels.top_index_[static_cast<std::size_t>(rows[i - p.columns])]] += t[i];
  }
  SINEW_INLINE static void backward(const Panels& panels, std::size_t panel, Scalar* x, Scalar* t) {
    const Panel& p = panels.panels_[panel];
    if (!p.needed) return;
    const int* rows = panels.row_index_.data() + p.indices;
    std::copy(x + p.first, x + p.first + p.columns, t);
    for (int i = p.columns; i < p.rows; ++i) t[i] = x[rows[i - p.columns]];
    std::fill(t + p.rows, t + p.rows + kLanes<Stored>, Scalar(0));
    const Stored* end = panels.values_.data() + panels.values_end(panel);
    for (int j = (p.columns - 1) / kBlock * kBlock; j >= 0; j -= kBlock) {
      const int width = std::min(kBlock, p.columns - j);
      end -= block_size<Stored>(width, p.rows - j);
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

template <class Stored>
Panels<Stored>::Panels(int size, const std::vector<Supernode>& supernodes, std::size_t divide_from) {
  // Parents come later: a needed panel passes the need on to the panel that holds its first row below.
  std::vector<std::uint8_t> needed(static_cast<std::size_t>(size), 0);
  std::size_t num_stored = 0;
  for (const Supernode& s : supernodes) {
    const auto columns = needed.begin() + s.first;
    const bool need =
        s.wanted || std::any_of(columns, columns + s.columns, [](std::uint8_t n) { return n != 0; });
    if (need && s.rows > s.columns) needed[static_cast<std::size_t>(s.row_indices[s.columns])] = 1;
    panels_.push_back({s.first, s.columns, s.rows, need, num_stored, row_index_.size()});
    row_index_.insert(row_index_.end(), s.row_indices + s.columns, s.row_indices + s.rows);
    work_size_ = std::max(work_size_, s.rows + kLanes<Stored>);
    for (int j = 0; j < s.columns; j += kBlock) {
      const int width = std::min(kBlock, s.columns - j);
      num_stored += block_size<Stored>(width, s.rows - j);
      const auto entries = static_cast<std::size_t>(
          triangle_size(width) + groups_below<Stored>(width, s.rows - j) * kLanes<Stored> * width);
      num_values_ += entries;
      if (need) num_needed_values_ += entries;
    }
  }
  values_.resize(num_stored);
  for (std::size_t k = 0; k < supernodes.size(); ++k) pack(supernodes[k], values_.data() + panels_[k].values);
  top_index_.assign(static_cast<std::size_t>(size), -1);
  divide(divide_from);
}

/// Takes the largest subtrees apart until none is more than an eighth of the whole, then deals them out to
/// parts of about that size. What is left above them is the top.
template <class Stored>
void Panels<Stored>::divide(std::size_t divide_from) {
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

/// One word of a pair; |upper|, |lower| <= 32767 in units of their columns. The upper half is chosen for what
/// the word is as a whole.
Pair pair_of(double upper, double lower) {
  const auto low = static_cast<std::uint16_t>(static_cast<std::int16_t>(std::lround(lower)));
  const double high = std::nearbyint(upper - low / 65536.0);
  return static_cast<Pair>(static_cast<std::int32_t>(high)) << 16 | low;
}

template <class Stored>
void Panels<Stored>::pack(const Supernode& s, Stored* to) const {
  const auto entry = [&](int row, int column) {
    return s.values[static_cast<std::size_t>(column) * static_cast<std::size_t>(s.rows) +
                    static_cast<std::size_t>(row)];
  };
  for (int j = 0; j < s.columns; j += kBlock) {
    const int width = std::min(kBlock, s.columns - j);
    Scalar head[head_size<Pair>(kBlock)];
    double unit[kBlock + 1];
    for (int b = 0; b < width; ++b) {
      double inverse[kBlock];
      inverse[b] = 1.0 / entry(j + b, j + b);
      for (int a = b + 1; a < width; ++a) {
        double sum = 0.0;
        for (int c = b; c < a; ++c) sum += entry(j + a, j + c) * inverse[c];
        inverse[a] = -sum / entry(j + a, j + a);
      }
      for (int a = b; a < width; ++a) head[triangle_size(a) + b] = static_cast<Scalar>(inverse[a]);
      double largest = std::numeric_limits<double>::min();
      for (int row = j + width; row < s.rows; ++row) largest = std::max(largest, std::abs(entry(row, j + b)));
      unit[b] = largest / std::numeric_limits<std::int16_t>::max();
      if (kPairs<Stored>) head[triangle_size(width) + b] = static_cast<Scalar>(unit[b] / 65536.0);
    }
    std::memcpy(to, head, sizeof(Stored) * static_cast<std::size_t>(head_size<Stored>(width)));
    to += head_size<Stored>(width);
    for (int row = j + width; row < s.rows; row += kLanes<Stored>) {
      for (int a = 0; a < width; a += kPairs<Stored> ? 2 : 1) {
        for (int i = row; i < row + kLanes<Stored>; ++i) {
          const auto at = [&](int b) { return i < s.rows && b < width ? entry(i, j + b) : 0.0; };
          if constexpr (kPairs<Stored>) {
            *to++ = pair_of(at(a) / unit[a], a + 1 < width ? at(a + 1) / unit[a + 1] : 0.0);
          } else {
            *to++ = static_cast<Stored>(at(a));
          }
        }
      }
    }
  }
}

template <class Stored>
void Panels<Stored>::solve(Scalar* x, Scalar* work, Code code) const {
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
  // From the last on, which the caches may still hold.
  tbb::parallel_for(std::size_t{0}, parts_.size(), [&](std::size_t k) {
    const std::size_t i = parts_.size() - 1 - k;
    wide ? Sweeps::backward_wide(*this, parts_[i], x, part_work(i))
         : Sweeps::backward_any(*this, parts_[i], x, part_work(i));
  });
}

template class Panels<Pair>;
template class Panels<float>;
template class Panels<double>;

}  // namespace sinew::fem::detail
