#include "fem/linear/large_pages.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <utility>

#include <gtest/gtest.h>

namespace sinew::fem::detail {
namespace {

std::uintptr_t address(const void* memory) { return reinterpret_cast<std::uintptr_t>(memory); }

// Pages are 4 KiB and 2 MiB on x86; memory that does not begin at the end of one cannot be on large pages.
TEST(LargePages, BeginWhereAPageDoes) {
  for (const std::size_t megabytes : {8, 9, 33}) {
    LargeVector<double> values(megabytes << 17);
    EXPECT_EQ(address(values.data()) % (1 << 21), 0u) << megabytes;
    std::iota(values.begin(), values.end(), 0.0);
    EXPECT_EQ(values.back(), static_cast<double>(values.size() - 1));
  }
}

// A few numbers must not cost two megabytes.
TEST(LargePages, AreNotForWhatIsSmall) {
  std::vector<LargeVector<float>> many(1000, LargeVector<float>(100, 1.0f));
  const auto ends = std::minmax_element(many.begin(), many.end(), [](const auto& a, const auto& b) {
    return address(a.data()) < address(b.data());
  });
  EXPECT_LT(address(ends.second->data()) - address(ends.first->data()), 64u << 20);
  for (const auto& values : many) EXPECT_EQ(address(values.data()) % 64, 0u);
}

TEST(LargePages, GoAlongWithVectorsThatMove) {
  LargeVector<int> values(std::size_t{1} << 22, 7);
  const int* data = values.data();
  LargeVector<int> moved = std::move(values);
  EXPECT_EQ(moved.data(), data);
  LargeVector<int> copy = moved;
  EXPECT_NE(copy.data(), data);
  EXPECT_EQ(copy, moved);
}

}  // namespace
}  // namespace sinew::fem::detail
