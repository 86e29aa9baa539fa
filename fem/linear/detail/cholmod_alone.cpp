#include "fem/linear/detail/cholmod_alone.h"

#include <mutex>

#include <omp.h>

namespace sinew::fem::detail {
namespace {

std::mutex& one_at_a_time() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

CholmodAlone::CholmodAlone() : levels_(omp_get_max_active_levels()) {
  one_at_a_time().lock();
  omp_set_max_active_levels(0);
}

CholmodAlone::~CholmodAlone() {
  omp_set_max_active_levels(levels_);
  one_at_a_time().unlock();
}

void start_supernodal(cholmod_common& common) {
  cholmod_start(&common);
  common.supernodal = CHOLMOD_SUPERNODAL;
  common.nmethods = 2;
  common.method[0].ordering = CHOLMOD_METIS;
  common.method[1].ordering = CHOLMOD_AMD;
  common.postorder = true;
  common.print = 0;
  common.final_ll = true;
}

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

}  // namespace sinew::fem::detail
