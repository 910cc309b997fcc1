#include "hal/cortex_m/stack.hpp"

namespace bms::hal::cortex_m {

namespace {

constexpr std::size_t words_a_call = 128;

const volatile std::uint32_t* lowest_used = nullptr;  // so far
const volatile std::uint32_t* looking_at = nullptr;

volatile std::uint32_t& mpu(std::uint32_t offset) {
  return *reinterpret_cast<volatile std::uint32_t*>(0xE000ED90 + offset);
}
volatile std::uint32_t& mpu_type() { return mpu(0x00); }
volatile std::uint32_t& mpu_ctrl() { return mpu(0x04); }
volatile std::uint32_t& mpu_rnr() { return mpu(0x08); }
volatile std::uint32_t& mpu_rbar() { return mpu(0x0C); }
volatile std::uint32_t& mpu_rasr() { return mpu(0x10); }

const volatile std::uint32_t* bottom() { return image_stack_limit + guard_bytes / 4; }

}  // namespace

void guard_stack() {
  if ((mpu_type() >> 8 & 0xFF) == 0) return;
  static_assert(guard_bytes == 1U << 10);
  mpu_rnr() = 0;
  mpu_rbar() = reinterpret_cast<std::uint32_t>(image_stack_limit);
  mpu_rasr() = 1U << 28 | 9U << 1 | 1U;  // no code, no access (AP 0), 2^(9 + 1) bytes, on
  mpu_ctrl() = 1U << 2 | 1U;             // everything else as without; off in hard faults
  asm volatile("dsb\n isb" ::: "memory");
}

void unguard_stack() {
  mpu_ctrl() = 0;
  asm volatile("dsb\n isb" ::: "memory");
}

bool stack_guard_intact() {
  if ((mpu_ctrl() & 1) != 0) return true;  // nobody has got past it
  for (std::size_t k = 1; k <= guard_words_checked; ++k) {
    if (*(bottom() - k) != paint) return false;
  }
  return true;
}

std::uint32_t stack_free() {
  if (lowest_used == nullptr) {
    lowest_used = image_stack_top;
    looking_at = bottom();
  }
  for (std::size_t k = 0; k < words_a_call; ++k, ++looking_at) {
    if (looking_at >= lowest_used) {
      looking_at = bottom();
      break;
    }
    if (*looking_at != paint) lowest_used = looking_at;
  }
  return static_cast<std::uint32_t>(4 * (lowest_used - bottom()));
}

}  // namespace bms::hal::cortex_m
