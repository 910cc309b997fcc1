#include "hal/cortex_m/stack.hpp"

namespace bms::hal::cortex_m {

namespace {

constexpr std::size_t words_per_call = 128;

const volatile std::uint32_t* lowest_used = nullptr;  // minimum so far
const volatile std::uint32_t* next_word = nullptr;

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
  mpu_rasr() = 1U << 28 | 9U << 1 | 1U;  // execute never, no access (AP 0), 2^(9 + 1) bytes, enabled
  mpu_ctrl() = 1U << 2 | 1U;             // default map elsewhere; off in hard faults
  asm volatile("dsb\n isb" ::: "memory");
}

void unguard_stack() {
  mpu_ctrl() = 0;
  asm volatile("dsb\n isb" ::: "memory");
}

bool stack_guard_intact() {
  if ((mpu_ctrl() & 1) != 0) return true;  // any access would have been a fault
  for (std::size_t k = 1; k <= guard_words_checked; ++k) {
    if (*(bottom() - k) != paint) return false;
  }
  return true;
}

std::uint32_t stack_free() {
  if (lowest_used == nullptr) {
    lowest_used = image_stack_top;
    next_word = bottom();
  }
  for (std::size_t k = 0; k < words_per_call; ++k, ++next_word) {
    if (next_word >= lowest_used) {
      next_word = bottom();
      break;
    }
    if (*next_word != paint) lowest_used = next_word;
  }
  return static_cast<std::uint32_t>(4 * (lowest_used - bottom()));
}

}  // namespace bms::hal::cortex_m
