#include "fem/models/repeated_factor.h"

#include <mutex>

#include <cholmod.h>
#include <omp.h>

namespace sinew::fem {
namespace {

/// METIS draws from the process's one random sequence: one ordering at a time, or they differ from run to
/// run.
std::mutex& one_ordering_at_a_time() {
  static std::mutex mutex;
  return mutex;
}

/// Keeps CHOLMOD in the calling thread: its own OpenMP threads would run beside ours.
class OneThread {
 public:
  OneThread() : levels_(omp_get_max_active_levels()) { omp_set_max_active_levels(0); }
  ~OneThread() { omp_set_max_active_levels(levels_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int levels_;
};

/// CHOLMOD's view of a matrix; borrows its arrays.
cholmod_sparse view_lower(const Eigen::SparseMatrix<double>& lower) {
  cholmod_sparse view{};
  view.nrow = static_cast<std::size_t>(lower.rows());
  view.ncol = static_cast<std::size_t>(lower.cols());
  view.nzmax = static_cast<std::size_t>(lower.nonZeros());
  view.p = const_cast<int*>(lower.outerIndexPtr());
  view.i = const_cast<int*>(lower.innerIndexPtr());
  view.x = const_cast<double*>(lower.valuePtr());
  view.stype = -1;
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = 1;
  view.packed = 1;
  return view;
}

}  // namespace

struct RepeatedFactor::Impl {
  mutable cholmod_common common;
  cholmod_factor* factor = nullptr;
  bool ok = false;
  mutable cholmod_dense *solution = nullptr, *y = nullptr, *e = nullptr;  ///< CHOLMOD's own workspace.

  Impl() {
    cholmod_start(&common);
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.nmethods = 2;
    common.method[0].ordering = CHOLMOD_METIS;
    common.method[1].ordering = CHOLMOD_AMD;
    common.postorder = true;
    common.print = 0;
    common.final_ll = true;
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

RepeatedFactor::RepeatedFactor() : impl_(std::make_unique<Impl>()) {}
RepeatedFactor::~RepeatedFactor() = default;
RepeatedFactor::RepeatedFactor(RepeatedFactor&&) noexcept = default;
RepeatedFactor& RepeatedFactor::operator=(RepeatedFactor&&) noexcept = default;

bool RepeatedFactor::ok() const { return impl_->ok; }
std::size_t RepeatedFactor::num_nonzeros() const { return impl_->ok ? impl_->factor->xsize : 0; }

Factor::Report RepeatedFactor::factorise(const Eigen::SparseMatrix<double>& lower) {
  Impl& f = *impl_;
  f.ok = false;
  Factor::Report report;
  cholmod_sparse view = view_lower(lower);
  const OneThread alone;
  if (f.factor == nullptr) {
    const std::lock_guard<std::mutex> lock(one_ordering_at_a_time());
    f.factor = cholmod_analyze(&view, &f.common);
    if (f.factor == nullptr) return {false, 0, "out of memory in the symbolic analysis"};
  }
  cholmod_factorize(&view, f.factor, &f.common);
  if (f.common.status == CHOLMOD_NOT_POSDEF || f.factor->minor < f.factor->n) {
    const auto column = std::min(f.factor->minor, f.factor->n - 1);
    const int pivot = static_cast<const int*>(f.factor->Perm)[column];
    return {false, pivot, "the matrix is not positive definite at row " + std::to_string(pivot)};
  }
  if (f.common.status < CHOLMOD_OK) return {false, 0, "out of memory in the factorisation"};
  f.ok = report.ok = true;
  return report;
}

void RepeatedFactor::solve(Eigen::Ref<Eigen::VectorXd> b) const {
  const Impl& f = *impl_;
  cholmod_dense right{};
  right.nrow = right.d = static_cast<std::size_t>(b.size());
  right.ncol = 1;
  right.nzmax = right.nrow;
  right.x = b.data();
  right.xtype = CHOLMOD_REAL;
  right.dtype = CHOLMOD_DOUBLE;
  const OneThread alone;
  cholmod_solve2(CHOLMOD_A, f.factor, &right, nullptr, &f.solution, nullptr, &f.y, &f.e, &f.common);
  b = Eigen::Map<const Eigen::VectorXd>(static_cast<const double*>(f.solution->x), b.size());
}

}  // namespace sinew::fem
