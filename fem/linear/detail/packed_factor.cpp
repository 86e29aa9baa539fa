#include "fem/linear/detail/packed_factor.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace sinew::fem::detail {
namespace {

/// The supernodes of CHOLMOD's factor, which must outlive the result. `wanted`: rows of A, all where empty.
std::vector<Supernode> supernodes_of(const cholmod_factor& factor, std::span<const std::uint8_t> wanted) {
  const int* permutation = static_cast<const int*>(factor.Perm);
  const int* super = static_cast<const int*>(factor.super);
  const int* pi = static_cast<const int*>(factor.pi);
  const int* px = static_cast<const int*>(factor.px);
  std::vector<Supernode> supernodes;
  for (std::size_t k = 0; k < factor.nsuper; ++k) {
    Supernode s;
    s.first = super[k];
    s.columns = super[k + 1] - super[k];
    s.rows = pi[k + 1] - pi[k];
    s.values = static_cast<const double*>(factor.x) + px[k];
    s.row_indices = static_cast<const int*>(factor.s) + pi[k];
    s.wanted =
        wanted.empty() || std::any_of(permutation + super[k], permutation + super[k + 1],
                                      [&](int row) { return wanted[static_cast<std::size_t>(row)] != 0; });
    supernodes.push_back(s);
  }
  return supernodes;
}

}  // namespace

PackedFactor::PackedFactor(const cholmod_factor& factor, Eigen::VectorXd scale, Precision precision,
                           std::span<const std::uint8_t> wanted)
    : scale_(std::move(scale)) {
  const int* permutation = static_cast<const int*>(factor.Perm);
  permutation_.assign(permutation, permutation + factor.n);
  const std::vector<Supernode> supernodes = supernodes_of(factor, wanted);
  if (precision == Precision::Double) panels_.emplace<Panels<double>>(size(), supernodes);
  if (precision == Precision::Float) panels_.emplace<Panels<float>>(size(), supernodes);
  if (precision == Precision::Short) panels_.emplace<Panels<Pair>>(size(), supernodes);
}

void PackedFactor::solve(Eigen::Ref<Eigen::VectorXd> b, Eigen::VectorXd& workspace) const {
  const auto row = [&](Eigen::Index i) { return permutation_[static_cast<std::size_t>(i)]; };
  const auto n = scale_.size();
  if (const auto* panels = std::get_if<Panels<double>>(&panels_)) {
    if (workspace.size() < n + panels->work_size()) workspace.resize(n + panels->work_size());
    for (Eigen::Index i = 0; i < n; ++i) workspace[i] = scale_[row(i)] * b[row(i)];
    panels->solve(workspace.data(), workspace.data() + n);
    for (Eigen::Index i = 0; i < n; ++i) b[row(i)] = scale_[row(i)] * workspace[i];
    return;
  }
  // Norm one: a small right-hand side must not fall among float's denormals.
  double norm = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) norm = std::max(norm, std::abs(scale_[i] * b[i]));
  if (norm < std::numeric_limits<double>::min()) return b.setZero(), void();
  const double unit = 1.0 / norm;
  const auto in_float = [&](const auto& panels) {
    Eigen::VectorXf x(n + panels.work_size());
    for (Eigen::Index i = 0; i < n; ++i) x[i] = static_cast<float>(scale_[row(i)] * (b[row(i)] * unit));
    panels.solve(x.data(), x.data() + n);
    for (Eigen::Index i = 0; i < n; ++i) b[row(i)] = scale_[row(i)] * (norm * static_cast<double>(x[i]));
  };
  if (const auto* panels = std::get_if<Panels<float>>(&panels_)) in_float(*panels);
  if (const auto* panels = std::get_if<Panels<Pair>>(&panels_)) in_float(*panels);
}

std::size_t PackedFactor::num_values() const {
  return std::visit([](const auto& panels) { return panels.num_values(); }, panels_);
}

std::size_t PackedFactor::num_values_read() const {
  return std::visit([](const auto& panels) { return panels.num_values_read(); }, panels_);
}

Eigen::VectorXd jacobi_scale(const Eigen::VectorXd& diagonal) { return diagonal.cwiseSqrt().cwiseInverse(); }

}  // namespace sinew::fem::detail
