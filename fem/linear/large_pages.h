#pragma once

#include <cstddef>
#include <vector>

/// Memory for what a step reads from end to end: on large pages where the system gives them, as the small
/// ones are 512 times as many to look up, and no processor fetches ahead across their ends.
namespace sinew::fem::detail {

/// Throws std::bad_alloc where there is no memory.
void* allocate_on_large_pages(std::size_t bytes);
void free_large_pages(void* memory) noexcept;

template <class T>
struct LargePages {
  using value_type = T;

  LargePages() = default;
  template <class Other>
  explicit LargePages(const LargePages<Other>&) noexcept {}
  T* allocate(std::size_t count) { return static_cast<T*>(allocate_on_large_pages(count * sizeof(T))); }
  void deallocate(T* memory, std::size_t) noexcept { free_large_pages(memory); }
  bool operator==(const LargePages&) const { return true; }
};

template <class T>
using LargeVector = std::vector<T, LargePages<T>>;

}  // namespace sinew::fem::detail
