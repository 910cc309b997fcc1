// Work compiled twice, for any processor and for one with AVX2, and chosen when it runs. The results are the same bits:
// AVX2 computes four doubles at a time as SSE2 computes two, and fused multiplications are not part of it.
//
// Everything that the work calls is inlined into it (flatten). Thus no function that others share exists with AVX2,
// as it would if a file were compiled for it. Host only.
#pragma once

#include <cstddef>
#include <cstring>

namespace bms::arithmetic {

// BMS_ONE_VECTOR_WIDTH: for code that shall compile quickly.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__AVX2__) && defined(__OPTIMIZE__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(BMS_ONE_VECTOR_WIDTH)
inline bool has_avx2() { return __builtin_cpu_supports("avx2") != 0; }

template <class Work>
[[gnu::target("avx2"), gnu::flatten]] void with_avx2(const Work& work) {
  work();
}
template <class Work>
[[gnu::flatten]] void for_any_processor(const Work& work) {
  work();
}
#else
constexpr bool has_avx2() { return false; }

template <class Work>
void for_any_processor(const Work& work) {
  work();
}
template <class Work>
void with_avx2(const Work& work) {
  for_any_processor(work);
}
#endif

/// Calls work() once.
template <class Work>
void in_widest_vectors(const Work& work) {
  if (has_avx2())
    with_avx2(work);
  else
    for_any_processor(work);
}

/// SSE2 takes two halves. (A type argument would lose the attribute of a smaller alignment.)
using FourDoubles [[gnu::vector_size(32)]] = double;
inline constexpr std::size_t doubles_at_once = sizeof(FourDoubles) / sizeof(double);

/// Some of a row of doubles, anywhere in memory. Value: FourDoubles or a double.
template <class Value>
struct Loaded {
  Value value;

  explicit Loaded(const double* from) { std::memcpy(&value, from, sizeof(Value)); }
  void store(double* to) const { std::memcpy(to, &value, sizeof(Value)); }
};

/// Calls work.operator()<FourDoubles>(first) for each four of `count` doubles, then <double>(place) for those left.
template <class Work>
void each_register(std::size_t count, const Work& work) {
  std::size_t k = 0;
  for (; k + doubles_at_once <= count; k += doubles_at_once) work.template operator()<FourDoubles>(k);
  for (; k < count; ++k) work.template operator()<double>(k);
}

}  // namespace bms::arithmetic
