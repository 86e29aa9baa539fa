#pragma once

#include <cstdint>
#include <cstring>

/// Fixed-width vectors for the two inner loops of a step. The width is part of the result (sums are taken
/// lane by lane), so it does not depend on the processor: where registers are narrower the compiler splits a
/// vector, and the bits are the same.
namespace sinew::fem::detail {

using Float8 = float __attribute__((vector_size(32)));
using Double4 = double __attribute__((vector_size(32)));

template <class Scalar>
struct LanesOf;
template <>
struct LanesOf<float> {
  using Type = Float8;
  static constexpr int kCount = 8;
};
template <>
struct LanesOf<double> {
  using Type = Double4;
  static constexpr int kCount = 4;
};

// Inlined into callers that are compiled for a certain processor, whatever the level of optimisation.
#define SINEW_INLINE [[gnu::always_inline]] inline

/// Unaligned load and store.
template <class Vector>
SINEW_INLINE void load(const void* from, Vector& to) {
  std::memcpy(&to, from, sizeof(Vector));
}
template <class Vector>
SINEW_INLINE void store(const Vector& from, void* to) {
  std::memcpy(to, &from, sizeof(Vector));
}

/// Eight words that hold two numbers of sixteen bits each: the words themselves, and their lower halves
/// shifted up. Both in units of 2^-16, so that no bit has to be masked.
SINEW_INLINE void load_pairs(const std::uint32_t* from, Float8& upper, Float8& lower) {
  using Unsigned8 = std::uint32_t __attribute__((vector_size(32)));
  using Signed8 = std::int32_t __attribute__((vector_size(32)));
  Unsigned8 words;
  std::memcpy(&words, from, sizeof(words));
  upper = __builtin_convertvector(reinterpret_cast<Signed8>(words), Float8);
  lower = __builtin_convertvector(reinterpret_cast<Signed8>(words << 16), Float8);
}

/// Which of two compilations of the same loop runs; the bits are the same.
enum class Code {
  Portable,  ///< for any processor.
  Wide,      ///< for one with 256-bit registers; elsewhere the same as Portable.
};
/// Wide where the processor can.
Code best_code();

#if defined(__x86_64__)
#define SINEW_WIDE_LANES [[gnu::target("avx2")]]
#else
#define SINEW_WIDE_LANES
#endif

}  // namespace sinew::fem::detail
