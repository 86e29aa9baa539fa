#include "fem/factor.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <vector>

#include <Eigen/Core>
#include <cholmod.h>
#include <omp.h>

namespace sinew::fem {
namespace {

/// A supernode: columns first .. first+columns-1 of L as one dense panel, column-major, `rows` high; the top
/// square is lower triangular, the rows below are scattered to `indices`.
struct Panel {
  int first = 0;
  int columns = 0;
  int rows = 0;
  std::size_t values = 0;   ///< offset of the panel's values.
  std::size_t indices = 0;  ///< offset of its row indices (the first `columns` are its own).
};

template <class Scalar>
using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
template <class Scalar>
using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

/// L y = b, then L^T x = y, panel by panel.
template <class Scalar>
void solve_panels(const std::vector<Panel>& panels, const std::vector<int>& row_index, const Scalar* values,
                  Scalar* x, Vector<Scalar>& gathered) {
  for (const Panel& p : panels) {
    const int below = p.rows - p.columns;
    const Eigen::Map<const Matrix<Scalar>, 0, Eigen::OuterStride<>> panel(
        values + p.values, p.rows, p.columns, Eigen::OuterStride<>(p.rows));
    Eigen::Map<Vector<Scalar>> top(x + p.first, p.columns);
    panel.topRows(p.columns).template triangularView<Eigen::Lower>().solveInPlace(top);
    if (below == 0) continue;
    gathered.head(below).noalias() = panel.bottomRows(below) * top;
    const int* rows = row_index.data() + p.indices + static_cast<std::size_t>(p.columns);
    for (int i = 0; i < below; ++i) x[rows[i]] -= gathered[i];
  }
  for (auto it = panels.rbegin(); it != panels.rend(); ++it) {
    const Panel& p = *it;
    const int below = p.rows - p.columns;
    const Eigen::Map<const Matrix<Scalar>, 0, Eigen::OuterStride<>> panel(
        values + p.values, p.rows, p.columns, Eigen::OuterStride<>(p.rows));
    Eigen::Map<Vector<Scalar>> top(x + p.first, p.columns);
    if (below > 0) {
      const int* rows = row_index.data() + p.indices + static_cast<std::size_t>(p.columns);
      for (int i = 0; i < below; ++i) gathered[i] = x[rows[i]];
      top.noalias() -= panel.bottomRows(below).transpose() * gathered.head(below);
    }
    panel.topRows(p.columns).template triangularView<Eigen::Lower>().transpose().solveInPlace(top);
  }
}

}  // namespace

struct Factor::Impl {
  int size = 0;
  Eigen::VectorXd
      scale;  ///< 1 / sqrt(diagonal): Jacobi scaling, so a nearly empty cell cannot spoil a float.
  std::vector<int> permutation;  ///< row of A at position i of the factor.
  std::vector<Panel> panels;
  std::vector<int> row_index;
  std::vector<double> values;
  std::vector<float> float_values;
  int largest_panel = 0;
};

Factor::Factor() = default;
Factor::~Factor() = default;
Factor::Factor(Factor&&) noexcept = default;
Factor& Factor::operator=(Factor&&) noexcept = default;

int Factor::size() const { return impl_ ? impl_->size : 0; }
std::size_t Factor::num_nonzeros() const {
  return impl_ ? impl_->values.size() + impl_->float_values.size() : 0;
}

namespace {

/// The workspace of one factorisation; CHOLMOD's common is not shared between threads.
struct Common {
  Common() {
    cholmod_start(&common);
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.nmethods = 2;  // the better of two orderings: a region may be too small for METIS to win
    common.method[0].ordering = CHOLMOD_METIS;
    common.method[1].ordering = CHOLMOD_AMD;
    common.postorder = true;
    common.print = 0;
    common.final_ll = true;
  }
  ~Common() { cholmod_finish(&common); }
  Common(const Common&) = delete;
  Common& operator=(const Common&) = delete;
  cholmod_common common;
};

/// Lower triangle of D A D in CHOLMOD's form; borrows the arrays.
cholmod_sparse view_lower(Eigen::SparseMatrix<double>& lower) {
  cholmod_sparse view{};
  view.nrow = static_cast<std::size_t>(lower.rows());
  view.ncol = static_cast<std::size_t>(lower.cols());
  view.nzmax = static_cast<std::size_t>(lower.nonZeros());
  view.p = lower.outerIndexPtr();
  view.i = lower.innerIndexPtr();
  view.x = lower.valuePtr();
  view.stype = -1;
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = 1;
  view.packed = 1;
  return view;
}

/// Fill-reducing order and pattern of the factor; one thread at a time: METIS draws its random numbers from
/// the C library's one generator (srand, rand), and orders that share it differ from run to run.
cholmod_factor* analyse(cholmod_sparse& matrix, cholmod_common& common) {
  static std::mutex one_at_a_time;
  const std::lock_guard lock(one_at_a_time);
  return cholmod_analyze(&matrix, &common);
}

/// The numbers of the factor, in the calling thread alone: CHOLMOD would start four OpenMP threads beside
/// each of ours; on two busy cores that was 1.8 times slower.
void factorise_numbers(cholmod_sparse& matrix, cholmod_factor* factor, cholmod_common& common) {
  const int levels = omp_get_max_active_levels();  // the caller's own, of this thread
  omp_set_max_active_levels(0);
  cholmod_factorize(&matrix, factor, &common);
  omp_set_max_active_levels(levels);
}

}  // namespace

Factor::Report Factor::factorise(const Eigen::SparseMatrix<double>& matrix, Precision precision) {
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

  // One at a time: METIS draws from the process's one random sequence, so that concurrent orderings would
  // differ from run to run, and serial OpenBLAS shares its buffers between callers. Solves use neither.
  static std::mutex one_at_a_time;
  const std::lock_guard<std::mutex> lock(one_at_a_time);
  Common workspace;
  cholmod_sparse view = view_lower(lower);
  cholmod_factor* factor = analyse(view, workspace.common);
  if (factor == nullptr) return {false, 0, "out of memory in the symbolic analysis"};
  factorise_numbers(view, factor, workspace.common);
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
    const int* super = static_cast<const int*>(factor->super);
    const int* pi = static_cast<const int*>(factor->pi);
    const int* px = static_cast<const int*>(factor->px);
    const int* s = static_cast<const int*>(factor->s);
    impl->row_index.assign(s, s + factor->ssize);
    for (std::size_t k = 0; k < factor->nsuper; ++k) {
      Panel p;
      p.first = super[k];
      p.columns = super[k + 1] - super[k];
      p.rows = pi[k + 1] - pi[k];
      p.values = static_cast<std::size_t>(px[k]);
      p.indices = static_cast<std::size_t>(pi[k]);
      impl->largest_panel = std::max(impl->largest_panel, p.rows);
      impl->panels.push_back(p);
    }
    const double* x = static_cast<const double*>(factor->x);
    if (precision == Precision::Double) {
      impl->values.assign(x, x + factor->xsize);
    } else {
      impl->float_values.assign(x, x + factor->xsize);
    }
  }
  cholmod_free_factor(&factor, &workspace.common);
  if (report.ok) impl_ = std::move(impl);
  return report;
}

void Factor::solve(Eigen::Ref<Eigen::VectorXd> b, Eigen::VectorXd& workspace) const {
  const Impl& f = *impl_;
  const auto n = static_cast<Eigen::Index>(f.size);
  if (workspace.size() < n + f.largest_panel) workspace.resize(n + f.largest_panel);
  if (!f.values.empty()) {
    for (Eigen::Index i = 0; i < n; ++i) {
      const int row = f.permutation[static_cast<std::size_t>(i)];
      workspace[i] = f.scale[row] * b[row];
    }
    Eigen::VectorXd gathered(f.largest_panel);
    solve_panels<double>(f.panels, f.row_index, f.values.data(), workspace.data(), gathered);
    for (Eigen::Index i = 0; i < n; ++i) {
      const int row = f.permutation[static_cast<std::size_t>(i)];
      b[row] = f.scale[row] * workspace[i];
    }
    return;
  }
  Eigen::VectorXf x(n), gathered(f.largest_panel);
  // Norm one: a small right-hand side must not fall among float's denormals.
  double norm = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) norm = std::max(norm, std::abs(f.scale[i] * b[i]));
  if (norm == 0.0) return b.setZero(), void();
  for (Eigen::Index i = 0; i < n; ++i) {
    const int row = f.permutation[static_cast<std::size_t>(i)];
    x[i] = static_cast<float>(f.scale[row] * b[row] / norm);
  }
  solve_panels<float>(f.panels, f.row_index, f.float_values.data(), x.data(), gathered);
  for (Eigen::Index i = 0; i < n; ++i) {
    const int row = f.permutation[static_cast<std::size_t>(i)];
    b[row] = f.scale[row] * norm * static_cast<double>(x[i]);
  }
}

}  // namespace sinew::fem
