#include "fem/linear/lanes.h"

namespace sinew::fem::detail {

Code best_code() {
#if defined(__x86_64__)
  static const Code best = __builtin_cpu_supports("avx2") ? Code::Wide : Code::Portable;
  return best;
#else
  return Code::Portable;
#endif
}

}  // namespace sinew::fem::detail
