// The controller that bxcan.cpp drives (RM0090, 32.9): CAN1, the bus of the truck; with BMS_CHARGER_BUS or
// BMS_GROUP_BUS CAN2, the bus of the charger or the one between batteries, which needs the clock of CAN1 as well. The
// filters of both are banks of CAN1: 0 to 13 are those of CAN1 and 14 to 27 those of CAN2 as long as nobody changes
// CAN2SB (32.9.4, CAN_FMR). While FINIT is set neither receives.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/accepted_frames.hpp"
#include "hal/bxcan/bit_timing.hpp"
#include "hal/bxcan/filter_banks.hpp"
#include "hal/can.hpp"
#include "hal/charger_bus.hpp"
#include "hal/group_bus.hpp"
#include "hal/stm32f4/clock_tree.hpp"
#include "hal/stm32f4/registers.hpp"
#include "hal/update_frames.hpp"

namespace bms::hal::stm32f4 {

// A namespace for each: the linker keeps one of two inline definitions with the same name.
#if defined BMS_CHARGER_BUS || defined BMS_GROUP_BUS
#ifdef BMS_CHARGER_BUS
inline namespace charger_bus {
#define BMS_OF_BUS(function) charger_##function
inline constexpr CanSettings settings_of_bus = charger_bus_settings;
inline constexpr auto long_ids_of_bus = charger_bus_long_ids;
inline std::span<const std::uint16_t> ids_of_bus() { return charger_bus_ids; }
#else
inline namespace group_bus {
#define BMS_OF_BUS(function) group_##function
inline constexpr CanSettings settings_of_bus = group_bus_settings;
inline constexpr std::array<LongId, 0> long_ids_of_bus{};
inline std::span<const std::uint16_t> ids_of_bus() { return group_bus_ids; }
#endif
#define BMS_INTERRUPT_OF_BUS(interrupt) can2_##interrupt
inline constexpr std::uint32_t can_controller = 0x40006800, can_clocks = 3U << 25, first_bank = 14;
inline constexpr std::uint32_t first_pin = 12;  // PB12 (RX) and PB13 (TX)
inline constexpr unsigned tx_interrupt = can2_tx_interrupt, rx0_interrupt = can2_rx0_interrupt;
// A profile sends four frames in a sample, a battery two; three others send six in that time.
inline constexpr std::size_t queue_frames = 8, ring_frames = 16;
/// No identifier is moved: none is one of the battery's own messages.
struct IdentifiersOfBus {
  constexpr explicit IdentifiersOfBus(const CanSettings&) {}
  static constexpr std::uint16_t on_the_bus(std::uint16_t id) { return id; }
  static constexpr const can::Frame& on_the_bus(const can::Frame& frame) { return frame; }
  static constexpr bool from_the_bus(const can::Frame&) { return true; }
};
#else
inline namespace truck_bus {
#define BMS_OF_BUS(function) function
#define BMS_INTERRUPT_OF_BUS(interrupt) can1_##interrupt
inline constexpr std::uint32_t can_controller = 0x40006400, can_clocks = 1U << 25, first_bank = 0;
inline constexpr std::uint32_t first_pin = 8;  // PB8 (RX) and PB9 (TX)
inline constexpr unsigned tx_interrupt = can1_tx_interrupt, rx0_interrupt = can1_rx0_interrupt;
inline constexpr std::size_t queue_frames = 32, ring_frames = 64;
inline constexpr CanSettings settings_of_bus = can_settings_of_build;
inline constexpr auto long_ids_of_bus = long_ids;
inline std::span<const std::uint16_t> ids_of_bus() { return accepted_ids(); }
using IdentifiersOfBus = Identifiers;
#endif
inline constexpr std::uint32_t two_pins = 2 * first_pin, four_bits = 4 * (first_pin % 8);  // places in MODER and AFRH
inline constexpr std::uint32_t banks_of_bus = 0x3FFFU << first_bank;

static_assert(bxcan::fits(with_updates(request_ids), long_ids.size()) &&
                  bxcan::fits(with_updates(request_and_sample_ids), long_ids.size()),
              "too many identifiers for the acceptance filters of CAN1");
static_assert(bxcan::bank_count(charger_bus_ids) + charger_bus_long_ids.size() <= bxcan::max_banks);
static_assert(bxcan::bank_count(group_bus_ids) <= bxcan::max_banks);

struct Rate {
  std::uint32_t bit_rate, btr, phase_timeout_us;
};
/// At 500 and 1,000 kbit/s the sample point is 85.7 %, the nearest one to 87.5 % that the clock allows.
consteval Rate rate(std::uint32_t bit_rate) {
  const std::uint32_t recovery_us = bxcan::longest_recovery_us(bit_rate), margin_us = recovery_us / 5;
  return {bit_rate, bxcan::bit_timing(crystal_apb1_hz, bit_rate, bxcan::cia301_allows).btr(),
          std::max<std::uint32_t>(100'000, recovery_us + margin_us)};
}
/// That of the build first: it is used if the settings have another one that is not here. No parameter sets the bit
/// rate of the second bus.
#if defined BMS_CHARGER_BUS || defined BMS_GROUP_BUS
inline constexpr std::array rates{rate(settings_of_bus.bit_rate)};
#else
inline constexpr std::array rates{rate(settings_of_bus.bit_rate), rate(125'000), rate(250'000), rate(500'000),
                                  rate(1'000'000)};
#endif

inline Register& can_mcr() { return at<can_controller>(); }
inline Register& can_msr() { return at<can_controller + 0x04>(); }
inline Register& can_tsr() { return at<can_controller + 0x08>(); }
inline Register& can_rf0r() { return at<can_controller + 0x0C>(); }
inline Register& can_ier() { return at<can_controller + 0x14>(); }
inline Register& can_esr() { return at<can_controller + 0x18>(); }
inline Register& can_btr() { return at<can_controller + 0x1C>(); }
struct CanMailbox {
  Register identifier, length_and_time, data_low, data_high;  // TIxR or RIxR, and so on
};
inline CanMailbox& can_transmit_mailbox(std::uint32_t k) {
  return reinterpret_cast<CanMailbox*>(can_controller + 0x180)[k];
}
inline CanMailbox& can_receive_fifo_0() { return *reinterpret_cast<CanMailbox*>(can_controller + 0x1B0); }

inline constexpr std::uint32_t mcr_inrq = 1U << 0, mcr_rflm = 1U << 3, mcr_reset = 1U << 15, msr_inak = 1U << 0;
inline constexpr std::uint32_t rf_pending = 3U, rf_overrun = 1U << 4, rf_release = 1U << 5;
inline constexpr std::uint32_t ier_tme = 1U << 0, ier_fmp0 = 1U << 1, ier_fov0 = 1U << 3;
inline constexpr std::uint32_t esr_warning = 1U << 0, esr_passive = 1U << 1, esr_bus_off = 1U << 2;
inline constexpr std::uint32_t transmit_request = 1U, extended = 4U;
constexpr std::uint32_t finished(std::uint32_t box) { return 1U << (8 * box); }
constexpr std::uint32_t succeeded(std::uint32_t box) { return 2U << (8 * box); }
constexpr std::uint32_t abort_request(std::uint32_t box) { return 0x80U << (8 * box); }

// the filters of both
inline Register& can_fmr() { return at<0x40006600>(); }
inline Register& can_fm1r() { return at<0x40006604>(); }
inline Register& can_fs1r() { return at<0x4000660C>(); }
inline Register& can_ffa1r() { return at<0x40006614>(); }
inline Register& can_fa1r() { return at<0x4000661C>(); }
struct CanFilterBank {
  Register fr1, fr2;
};
inline CanFilterBank& can_filter_bank(std::uint32_t k) { return reinterpret_cast<CanFilterBank*>(0x40006640)[k]; }

/// Bits of this bus in a register of both; the only ones that an image with one bus has.
inline void set_own_banks(Register& both, std::uint32_t own) {
  if constexpr (has_second_bus)
    both = (both & ~banks_of_bus) | own << first_bank;
  else
    both = own;
}

template <unsigned Interrupt>
Register& nvic_iser() {
  return at<0xE000E100 + Interrupt / 32 * 4>();
}
template <unsigned Interrupt>
Register& nvic_icer() {
  return at<0xE000E180 + Interrupt / 32 * 4>();
}
constexpr std::uint32_t bit_of(unsigned interrupt) { return 1U << interrupt % 32; }
inline void enable_interrupts() {
  if constexpr (tx_interrupt / 32 == rx0_interrupt / 32) {
    nvic_iser<tx_interrupt>() = bit_of(tx_interrupt) | bit_of(rx0_interrupt);
  } else {
    nvic_iser<tx_interrupt>() = bit_of(tx_interrupt);
    nvic_iser<rx0_interrupt>() = bit_of(rx0_interrupt);
  }
}

}  // namespace charger_bus, group_bus or truck_bus
}  // namespace bms::hal::stm32f4
