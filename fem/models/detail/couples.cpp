#include "fem/models/detail/couples.h"

#include <algorithm>

namespace sinew::fem::detail {
namespace {

constexpr std::size_t kPerEntry = 10;

/// Sums side by side, so that no addition waits for the one before it. The fourth lane holds what comes after
/// a column, and nobody looks at it.
template <bool kTies>
SINEW_INLINE void apply_row(const double* couple, const double* ties, std::span<const int> columns,
                            const CoupleInputs* inputs, double* result) {
  Double4 sums[4] = {}, pull = {};
  Double4 lanes;
  for (const int column : columns) {
    const CoupleInputs& in = inputs[column];
    for (int j = 0; j < 3; ++j) {
      load(couple + 3 * j, lanes);
      sums[j] += lanes * in.elastic[j];
    }
    load(in.inertia.data(), lanes);
    sums[3] += lanes * couple[9];
    couple += kPerEntry;
    if constexpr (kTies) {
      load(in.tie.data(), lanes);
      pull += lanes * *ties++;
    }
  }
  store((sums[0] + sums[1]) + (sums[2] + (sums[3] + pull)), result);
}

template <bool kTies>
SINEW_WIDE_LANES void apply_row_wide(const double* couple, const double* ties, std::span<const int> columns,
                                     const CoupleInputs* inputs, double* result) {
  apply_row<kTies>(couple, ties, columns, inputs, result);
}

}  // namespace

Couples::Couples(const LeafMatrices& matrices) {
  values_.reserve(kPerEntry * matrices.column.size());
  for (std::size_t e = 0; e < matrices.column.size(); ++e) {
    const double* k = matrices.stiffness[e].data();  // by columns
    values_.insert(values_.end(), k, k + 9);
    values_.push_back(matrices.mass[e]);
  }
  if (std::any_of(matrices.tie.begin(), matrices.tie.end(), [](double tie) { return tie != 0.0; }))
    ties_.assign(matrices.tie.begin(), matrices.tie.end());
}

Eigen::Vector3d Couples::apply(std::size_t first, std::span<const int> columns, const CoupleInputs* inputs,
                               Code code) const {
  Eigen::Vector4d result;
  const double* couple = values_.data() + kPerEntry * first;
  const bool wide = code == Code::Wide;
  if (ties_.empty()) {
    wide ? apply_row_wide<false>(couple, nullptr, columns, inputs, result.data())
         : apply_row<false>(couple, nullptr, columns, inputs, result.data());
  } else {
    const double* ties = ties_.data() + first;
    wide ? apply_row_wide<true>(couple, ties, columns, inputs, result.data())
         : apply_row<true>(couple, ties, columns, inputs, result.data());
  }
  return result.head<3>();
}

}  // namespace sinew::fem::detail
