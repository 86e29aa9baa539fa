#pragma once

#include <Eigen/SparseCore>
#include <cholmod.h>

/// What every use of CHOLMOD in the process shares.
namespace sinew::fem::detail {

/// While it lives, no other thread of the process is inside CHOLMOD, and CHOLMOD starts no threads. METIS
/// draws from the C library's one generator (srand, rand), so that concurrent orderings would differ from run
/// to run, and serial OpenBLAS shares its buffers between callers. CHOLMOD's own OpenMP threads would run
/// beside ours; on two busy cores that was 1.8 times slower. Not to be nested.
class CholmodAlone {
 public:
  CholmodAlone();
  ~CholmodAlone();
  CholmodAlone(const CholmodAlone&) = delete;
  CholmodAlone& operator=(const CholmodAlone&) = delete;

 private:
  int levels_;  ///< of OpenMP's nesting, the caller's own.
};

/// Starts a workspace for supernodal LL' factors in the better of METIS' and AMD's order: a matrix may be too
/// small for METIS to win. To be ended by cholmod_finish.
void start_supernodal(cholmod_common& common);

/// CHOLMOD's view of a symmetric matrix of which `lower`, compressed, is the lower triangle; borrows its
/// arrays.
cholmod_sparse view_lower(const Eigen::SparseMatrix<double>& lower);

}  // namespace sinew::fem::detail
