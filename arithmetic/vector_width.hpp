// Work compiled twice, for any processor and for one with AVX2, and chosen when it runs. The results are the same bits:
// AVX2 computes four doubles at a time as SSE2 computes two, and fused multiplications are not part of it.
//
// Everything that the work calls is inlined into it (flatten). Thus no function that others share exists with AVX2,
// as it would if a file were compiled for it. Host only.
#pragma once

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

}  // namespace bms::arithmetic
