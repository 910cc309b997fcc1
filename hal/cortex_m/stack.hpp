// The stack: [image_stack_limit, image_stack_top), of the linker script, grows down.
//
//   guard   its lowest part, nobody's. With a memory protection unit (ARMv7-M) an access is a fault at once, recorded
//   as exception 4; without one it is looked at
//           with every sample, and what is not paint any more was written by a stack that grew too far
//   paint   the rest, at start-up: what is not paint any more was used
#pragma once

#include <cstddef>
#include <cstdint>

extern "C" {
extern std::uint32_t image_stack_limit[], image_stack_top[];  // from the linker script
}

namespace bms::hal::cortex_m {

inline constexpr std::uint32_t guard_bytes = 1'024,
                               paint = 0xA5A5'A5A5;     // larger than any frame: nothing steps over it
inline constexpr std::size_t guard_words_checked = 16;  // next to the stack

/// Start-up, from a function without a frame to speak of: up to a little below it.
[[gnu::always_inline]] inline void paint_stack(std::uint32_t* up_to) {
  for (volatile std::uint32_t* at = image_stack_limit; at < up_to; ++at) *at = paint;
}

/// Access to the guard is a fault from now on, where there is a memory protection unit (ARMv7-M, B3.5); elsewhere its
/// registers read 0.
void guard_stack();
/// In the handler of a fault, which may have to look there.
void unguard_stack();

/// Whether the guard is as it was painted; true while it cannot be looked at.
bool stack_guard_intact();

/// Least that was free so far [bytes], without the guard. Looks at some words more with each call, and at all of them
/// within fifteen calls.
std::uint32_t stack_free();

}  // namespace bms::hal::cortex_m
