#include "fem/factor.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <cholmod.h>

#include "fem/detail/cholmod_alone.h"
#include "fem/detail/panels.h"

namespace sinew::fem {
struct Factor::Impl {
  int size = 0;
  Eigen::VectorXd
      scale;  ///< 1 / sqrt(diagonal): Jacobi scaling, so a nearly empty cell cannot spoil a float.
  std::vector<int> permutation;  ///< row of A at position i of the factor.
  Precision precision = Precision::Double;
  detail::Panels<double> panels;
  detail::Panels<float> float_panels;
};

Factor::Factor() = default;
Factor::~Factor() = default;
Factor::Factor(Factor&&) noexcept = default;
Factor& Factor::operator=(Factor&&) noexcept = default;

int Factor::size() const { return impl_ ? impl_->size : 0; }
std::size_t Factor::num_nonzeros() const {
  return impl_ ? impl_->panels.num_values() + impl_->float_panels.num_values() : 0;
}
std::size_t Factor::num_read() const {
  return impl_ ? impl_->panels.num_values_read() + impl_->float_panels.num_values_read() : 0;
}

namespace {

/// The workspace of one factorisation; CHOLMOD's common is not shared between threads.
struct Common {
  Common() { detail::start_supernodal(common); }
  ~Common() { cholmod_finish(&common); }
  Common(const Common&) = delete;
  Common& operator=(const Common&) = delete;
  cholmod_common common;
};

/// The supernodes of CHOLMOD's factor, which must outlive the result. `wanted`: rows of A, all where empty.
std::vector<detail::Supernode> supernodes_of(const cholmod_factor& factor,
                                             std::span<const std::uint8_t> wanted) {
  const int* permutation = static_cast<const int*>(factor.Perm);
  const int* super = static_cast<const int*>(factor.super);
  const int* pi = static_cast<const int*>(factor.pi);
  const int* px = static_cast<const int*>(factor.px);
  std::vector<detail::Supernode> supernodes;
  for (std::size_t k = 0; k < factor.nsuper; ++k) {
    detail::Supernode s;
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

Factor::Report Factor::factorise(const Eigen::SparseMatrix<double>& matrix, Precision precision,
                                 std::span<const std::uint8_t> wanted) {
  auto impl = std::make_unique<Impl>();
  impl->size = static_cast<int>(matrix.rows());
  const Eigen::VectorXd diagonal = matrix.diagonal();
  for (int i = 0; i < impl->size; ++i) {
    if (!(diagonal[i] > 0.0) || !std::isfinite(diagonal[i])) {
      return {false, i, "the diagonal of row " + std::to_string(i) + " is not positive"};
    }
  }
  impl->scale = diagonal.cwiseSqrt().cwiseInverse();
  Eigen::SparseMatrix<double> lower = matrix.triangularView<Eigen::Lower>();
  lower = impl->scale.asDiagonal() * lower * impl->scale.asDiagonal();
  lower.makeCompressed();

  const detail::CholmodAlone alone;
  Common workspace;
  cholmod_sparse view = detail::view_lower(lower);
  cholmod_factor* factor = cholmod_analyze(&view, &workspace.common);
  if (factor == nullptr) return {false, 0, "out of memory in the symbolic analysis"};
  cholmod_factorize(&view, factor, &workspace.common);
  Report report;
  if (workspace.common.status == CHOLMOD_NOT_POSDEF || factor->minor < factor->n) {
    const int pivot = static_cast<const int*>(factor->Perm)[std::min(factor->minor, factor->n - 1)];
    report = {false, pivot, "the matrix is not positive definite at row " + std::to_string(pivot)};
  } else if (workspace.common.status < CHOLMOD_OK) {
    report = {false, 0, "out of memory in the factorisation"};
  } else {
    report.ok = true;
    const int* permutation = static_cast<const int*>(factor->Perm);
    impl->permutation.assign(permutation, permutation + factor->n);
    const std::vector<detail::Supernode> supernodes = supernodes_of(*factor, wanted);
    impl->precision = precision;
    if (precision == Precision::Double) {
      impl->panels = detail::Panels<double>(impl->size, supernodes);
    } else {
      impl->float_panels = detail::Panels<float>(impl->size, supernodes);
    }
  }
  cholmod_free_factor(&factor, &workspace.common);
  if (report.ok) impl_ = std::move(impl);
  return report;
}

void Factor::solve(Eigen::Ref<Eigen::VectorXd> b, Eigen::VectorXd& workspace) const {
  const Impl& f = *impl_;
  const auto row = [&](Eigen::Index i) { return f.permutation[static_cast<std::size_t>(i)]; };
  const auto n = static_cast<Eigen::Index>(f.size);
  if (f.precision == Precision::Double) {
    if (workspace.size() < n + f.panels.work_size()) workspace.resize(n + f.panels.work_size());
    for (Eigen::Index i = 0; i < n; ++i) workspace[i] = f.scale[row(i)] * b[row(i)];
    f.panels.solve(workspace.data(), workspace.data() + n);
    for (Eigen::Index i = 0; i < n; ++i) b[row(i)] = f.scale[row(i)] * workspace[i];
    return;
  }
  Eigen::VectorXf x(n + f.float_panels.work_size());
  // Norm one: a small right-hand side must not fall among float's denormals.
  double norm = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) norm = std::max(norm, std::abs(f.scale[i] * b[i]));
  if (norm == 0.0) return b.setZero(), void();
  for (Eigen::Index i = 0; i < n; ++i) x[i] = static_cast<float>(f.scale[row(i)] * b[row(i)] / norm);
  f.float_panels.solve(x.data(), x.data() + n);
  for (Eigen::Index i = 0; i < n; ++i) b[row(i)] = f.scale[row(i)] * norm * static_cast<double>(x[i]);
}

}  // namespace sinew::fem
