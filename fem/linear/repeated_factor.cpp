#include "fem/linear/repeated_factor.h"

#include <algorithm>
#include <string>

#include <cholmod.h>

#include "fem/linear/detail/cholmod_alone.h"
#include "fem/linear/detail/packed_factor.h"

namespace sinew::fem {

struct RepeatedFactor::Impl {
  mutable cholmod_common common;
  cholmod_factor* factor = nullptr;
  bool ok = false;
  std::optional<Precision> precision;
  detail::PackedFactor packed;  ///< where there is a precision.
  mutable Eigen::VectorXd workspace;
  mutable cholmod_dense *solution = nullptr, *y = nullptr, *e = nullptr;  ///< CHOLMOD's own workspace.

  explicit Impl(std::optional<Precision> of_panels) : precision(of_panels) {
    detail::start_supernodal(common);
    common.quick_return_if_not_posdef = true;
  }
  ~Impl() {
    cholmod_free_dense(&solution, &common);
    cholmod_free_dense(&y, &common);
    cholmod_free_dense(&e, &common);
    cholmod_free_factor(&factor, &common);
    cholmod_finish(&common);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
};

RepeatedFactor::RepeatedFactor(std::optional<Precision> packed) : impl_(std::make_unique<Impl>(packed)) {}
RepeatedFactor::~RepeatedFactor() = default;
RepeatedFactor::RepeatedFactor(RepeatedFactor&&) noexcept = default;
RepeatedFactor& RepeatedFactor::operator=(RepeatedFactor&&) noexcept = default;

bool RepeatedFactor::ok() const { return impl_->ok; }
std::size_t RepeatedFactor::num_nonzeros() const {
  if (!impl_->ok) return 0;
  return impl_->precision ? impl_->packed.num_values() : impl_->factor->xsize;
}

Factor::Report RepeatedFactor::factorise(const Eigen::SparseMatrix<double>& lower) {
  Impl& f = *impl_;
  f.ok = false;
  Factor::Report report;
  Eigen::SparseMatrix<double> scaled;
  Eigen::VectorXd scale;
  if (f.precision) {
    scale = detail::jacobi_scale(lower.diagonal());
    scaled = scale.asDiagonal() * lower * scale.asDiagonal();
  }
  cholmod_sparse view = detail::view_lower(f.precision ? scaled : lower);
  const detail::CholmodAlone alone;
  if (f.factor == nullptr) f.factor = cholmod_analyze(&view, &f.common);
  if (f.factor == nullptr) return {false, 0, "out of memory in the symbolic analysis"};
  cholmod_factorize(&view, f.factor, &f.common);
  if (f.common.status == CHOLMOD_NOT_POSDEF || f.factor->minor < f.factor->n) {
    const auto column = std::min(f.factor->minor, f.factor->n - 1);
    const int pivot = static_cast<const int*>(f.factor->Perm)[column];
    return {false, pivot, "the matrix is not positive definite at row " + std::to_string(pivot)};
  }
  if (f.common.status < CHOLMOD_OK) return {false, 0, "out of memory in the factorisation"};
  if (f.precision) f.packed = detail::PackedFactor(*f.factor, scale, *f.precision);
  f.ok = report.ok = true;
  return report;
}

void RepeatedFactor::solve(Eigen::Ref<Eigen::VectorXd> b) const {
  const Impl& f = *impl_;
  if (f.precision) return f.packed.solve(b, f.workspace);
  cholmod_dense right{};
  right.nrow = right.d = static_cast<std::size_t>(b.size());
  right.ncol = 1;
  right.nzmax = right.nrow;
  right.x = b.data();
  right.xtype = CHOLMOD_REAL;
  right.dtype = CHOLMOD_DOUBLE;
  const detail::CholmodAlone alone;
  cholmod_solve2(CHOLMOD_A, f.factor, &right, nullptr, &f.solution, nullptr, &f.y, &f.e, &f.common);
  b = Eigen::Map<const Eigen::VectorXd>(static_cast<const double*>(f.solution->x), b.size());
}

}  // namespace sinew::fem
