// Registers of every Cortex-M. Sections of the ARMv6-M Architecture Reference Manual in brackets; ARMv7-M has the same
// addresses.
#pragma once

#include <cstdint>

namespace bms::hal {

using Register = volatile std::uint32_t;

template <std::uint32_t Address>
inline Register& at() {
  return *reinterpret_cast<Register*>(Address);
}

namespace cortex_m {

// interrupt controller [B3.4]: interrupts 0 to 31 and 32 to 63
inline Register& nvic_iser0() { return at<0xE000E100>(); }
inline Register& nvic_icer0() { return at<0xE000E180>(); }
inline Register& nvic_icpr0() { return at<0xE000E280>(); }
inline Register& nvic_iser1() { return at<0xE000E104>(); }
inline Register& nvic_icer1() { return at<0xE000E184>(); }
inline Register& nvic_icpr1() { return at<0xE000E284>(); }

// system control [B3.2]
inline Register& scb_icsr() { return at<0xE000ED04>(); }
inline Register& scb_aircr() { return at<0xE000ED0C>(); }
inline Register& scb_scr() { return at<0xE000ED10>(); }

}  // namespace cortex_m

}  // namespace bms::hal
