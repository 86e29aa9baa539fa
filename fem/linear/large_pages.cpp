#include "fem/linear/large_pages.h"

#include <cstdlib>
#include <new>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace sinew::fem::detail {
namespace {

constexpr std::size_t kLargePage = std::size_t{1} << 21;
constexpr std::size_t kLanes = 64;  ///< alignment of what no large page would help.

}  // namespace

void* allocate_on_large_pages(std::size_t bytes) {
  // Half a page lost at most of what has four or more.
  const std::size_t page = bytes >= 4 * kLargePage ? kLargePage : kLanes;
  void* memory = std::aligned_alloc(page, (bytes + page - 1) / page * page);
  if (memory == nullptr) throw std::bad_alloc();
#if defined(__linux__)
  // Advice: where it is not taken the memory is as good, but slower.
  if (page == kLargePage) static_cast<void>(madvise(memory, bytes, MADV_HUGEPAGE));
#endif
  return memory;
}

void free_large_pages(void* memory) noexcept { std::free(memory); }

}  // namespace sinew::fem::detail
