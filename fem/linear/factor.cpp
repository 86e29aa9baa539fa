#include "fem/linear/factor.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <cholmod.h>

#include "fem/linear/detail/cholmod_alone.h"
#include "fem/linear/detail/packed_factor.h"

namespace sinew::fem {
struct Factor::Impl {
  detail::PackedFactor packed;
};

Factor::Factor() = default;
Factor::~Factor() = default;
Factor::Factor(Factor&&) noexcept = default;
Factor& Factor::operator=(Factor&&) noexcept = default;

int Factor::size() const { return impl_ ? impl_->packed.size() : 0; }
std::size_t Factor::num_nonzeros() const { return impl_ ? impl_->packed.num_values() : 0; }
std::size_t Factor::num_read() const { return impl_ ? impl_->packed.num_values_read() : 0; }

namespace {

/// The workspace of one factorisation; CHOLMOD's common is not shared between threads.
struct Common {
  Common() { detail::start_supernodal(common); }
  ~Common() { cholmod_finish(&common); }
  Common(const Common&) = delete;
  Common& operator=(const Common&) = delete;
  cholmod_common common;
};

}  // namespace

Factor::Report Factor::factorise(const Eigen::SparseMatrix<double>& matrix, Precision precision,
                                 std::span<const std::uint8_t> wanted) {
  const Eigen::VectorXd diagonal = matrix.diagonal();
  for (int i = 0; i < static_cast<int>(diagonal.size()); ++i) {
    if (!(diagonal[i] > 0.0) || !std::isfinite(diagonal[i])) {
      return {false, i, "the diagonal of row " + std::to_string(i) + " is not positive"};
    }
  }
  const Eigen::VectorXd scale = detail::jacobi_scale(diagonal);
  Eigen::SparseMatrix<double> lower = matrix.triangularView<Eigen::Lower>();
  lower = scale.asDiagonal() * lower * scale.asDiagonal();
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
    impl_ = std::make_unique<Impl>();
    impl_->packed = detail::PackedFactor(*factor, scale, precision, wanted);
  }
  cholmod_free_factor(&factor, &workspace.common);
  return report;
}

void Factor::solve(Eigen::Ref<Eigen::VectorXd> b, Eigen::VectorXd& workspace) const {
  impl_->packed.solve(b, workspace);
}

}  // namespace sinew::fem
