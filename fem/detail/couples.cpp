#include "fem/detail/couples.h"

namespace sinew::fem::detail {
namespace {

constexpr std::size_t kPerEntry = 12;

/// Five sums side by side, so that no addition waits for the one before it.
SINEW_INLINE void apply_row(const double* couple, std::span<const int> columns, const CoupleInputs* inputs,
                            double* result) {
  Double4 sums[5] = {};
  Double4 lanes;
  for (const int column : columns) {
    const CoupleInputs& in = inputs[column];
    for (int j = 0; j < 3; ++j) {
      load(couple + 4 * j, lanes);
      sums[j] += lanes * in.elastic[j];
    }
    load(in.inertia.data(), lanes);
    sums[3] += lanes * couple[3];
    load(in.tie.data(), lanes);
    sums[4] += lanes * couple[7];
    couple += kPerEntry;
  }
  store((sums[0] + sums[1]) + (sums[2] + (sums[3] + sums[4])), result);
}

SINEW_WIDE_LANES void apply_row_wide(const double* couple, std::span<const int> columns,
                                     const CoupleInputs* inputs, double* result) {
  apply_row(couple, columns, inputs, result);
}

}  // namespace

Couples::Couples(const LeafMatrices& matrices) {
  values_.reserve(kPerEntry * matrices.column.size());
  for (std::size_t e = 0; e < matrices.column.size(); ++e) {
    const double below[3] = {matrices.mass[e], matrices.tie[e], 0.0};
    for (int j = 0; j < 3; ++j) {
      for (int i = 0; i < 3; ++i) values_.push_back(matrices.stiffness[e](i, j));
      values_.push_back(below[j]);
    }
  }
}

Eigen::Vector3d Couples::apply(std::size_t first, std::span<const int> columns, const CoupleInputs* inputs,
                               Code code) const {
  Eigen::Vector4d result;
  const double* couple = values_.data() + kPerEntry * first;
  code == Code::Wide ? apply_row_wide(couple, columns, inputs, result.data())
                     : apply_row(couple, columns, inputs, result.data());
  return result.head<3>();
}

}  // namespace sinew::fem::detail
