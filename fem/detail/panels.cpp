#include "fem/detail/panels.h"

#include <algorithm>
#include <cstdint>

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

/// Both sweeps, compiled once for the processor at hand and once for any.
template <class Scalar>
struct Panels<Scalar>::Sweeps {
  SINEW_INLINE static void run(const Panels& panels, Scalar* x, Scalar* t) {
    constexpr int kLanes = LanesOf<Scalar>::kCount;
    for (const Panel& p : panels.panels_) {
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
      for (int i = p.columns; i < p.rows; ++i) x[rows[i - p.columns]] += t[i];
    }
    for (auto p = panels.panels_.rbegin(); p != panels.panels_.rend(); ++p) {
      if (!p->needed) continue;
      const int* rows = panels.row_index_.data() + p->indices;
      std::copy(x + p->first, x + p->first + p->columns, t);
      for (int i = p->columns; i < p->rows; ++i) t[i] = x[rows[i - p->columns]];
      std::fill(t + p->rows, t + p->rows + kLanes, Scalar(0));
      const Scalar* end = p == panels.panels_.rbegin() ? panels.values_.data() + panels.values_.size()
                                                       : panels.values_.data() + (p - 1)->values;
      for (int j = (p->columns - 1) / kBlock * kBlock; j >= 0; j -= kBlock) {
        const int width = std::min(kBlock, p->columns - j);
        end -= block_size<Scalar>(width, p->rows - j);
        backward_block_of(width, end, t + j, p->rows - j);
      }
      std::copy(t, t + p->columns, x + p->first);
    }
  }
  SINEW_WIDE_LANES static void run_wide(const Panels& panels, Scalar* x, Scalar* t) { run(panels, x, t); }
  static void run_any(const Panels& panels, Scalar* x, Scalar* t) { run(panels, x, t); }
};

template <class Scalar>
Panels<Scalar>::Panels(int size, const std::vector<Supernode>& supernodes) {
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
  code == Code::Wide ? Sweeps::run_wide(*this, x, work) : Sweeps::run_any(*this, x, work);
}

template <class Scalar>
std::size_t Panels<Scalar>::num_values_read() const {
  std::size_t read = values_.size();
  for (std::size_t k = 0; k < panels_.size(); ++k) {
    if (!panels_[k].needed) continue;
    read += (k + 1 < panels_.size() ? panels_[k + 1].values : values_.size()) - panels_[k].values;
  }
  return read;
}

template class Panels<float>;
template class Panels<double>;

}  // namespace sinew::fem::detail
