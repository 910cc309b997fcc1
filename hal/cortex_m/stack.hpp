// The stack: [image_stack_limit, image_stack_top) of the linker script; it grows down.
//
//   guard   its lowest part, unused. With a memory protection unit (ARMv7-M) an access is a processor fault, recorded
//           as exception 4. Without one, every sample checks that the guard still contains the paint.
//   paint   the remaining part, filled at start-up: words that no longer contain the paint were used
#pragma once

#include <cstddef>
#include <cstdint>

extern "C" {
extern std::uint32_t image_stack_limit[], image_stack_top[];  // defined by the linker script
}

namespace bms::hal::cortex_m {

inline constexpr std::uint32_t guard_bytes = 1'024;  // larger than any stack frame, so no function can skip it
inline constexpr std::uint32_t paint = 0xA5A5'A5A5;
inline constexpr std::size_t guard_words_checked = 16;  // those next to the stack

/// Call at start-up from a function with a small stack frame. up_to: address a little below that frame.
[[gnu::always_inline]] inline void paint_stack(std::uint32_t* up_to) {
  for (volatile std::uint32_t* at = image_stack_limit; at < up_to; ++at) *at = paint;
}

/// From now on an access to the guard is a processor fault, if the core has a memory protection unit (ARMv7-M, B3.5;
/// without one its registers read 0).
void guard_stack();
/// Call in the handler of a processor fault, which may have to read the guard.
void unguard_stack();

/// Returns true if the guard still contains the paint, or while the memory protection unit guards it.
bool stack_guard_intact();

/// Minimum of free stack so far [bytes], without the guard. Each call reads some more words; fifteen calls read all.
std::uint32_t stack_free();

}  // namespace bms::hal::cortex_m
