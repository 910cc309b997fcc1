// Registers of the nRF51822 that this firmware uses, from Nordic's nRF51 Series Reference Manual v3.0 (chapter in
// brackets). A write to a task register starts an action; an event register reports that something happened, until 0 is
// written to it.
#pragma once

#include "hal/cortex_m/registers.hpp"

namespace bms::hal::nrf51 {

// oscillators [CLOCK]
inline Register& clock_hfclkstart() { return at<0x40000000>(); }
inline Register& clock_hfclkstarted() { return at<0x40000100>(); }

// [POWER]
inline Register& power_resetreas() { return at<0x40000400>(); }

// [UART]
inline Register& uart_startrx() { return at<0x40002000>(); }
inline Register& uart_starttx() { return at<0x40002008>(); }
inline Register& uart_rxdrdy() { return at<0x40002108>(); }
inline Register& uart_txdrdy() { return at<0x4000211C>(); }
inline Register& uart_intenset() { return at<0x40002304>(); }
inline Register& uart_enable() { return at<0x40002500>(); }
inline Register& uart_pseltxd() { return at<0x4000250C>(); }
inline Register& uart_pselrxd() { return at<0x40002514>(); }
inline Register& uart_rxd() { return at<0x40002518>(); }
inline Register& uart_txd() { return at<0x4000251C>(); }
inline Register& uart_baudrate() { return at<0x40002524>(); }
inline constexpr unsigned uart_interrupt = 2;

// timer 0 [TIMER]
inline Register& timer_start() { return at<0x40008000>(); }
inline Register& timer_clear() { return at<0x4000800C>(); }
inline Register& timer_capture1() { return at<0x40008044>(); }
inline Register& timer_compare0() { return at<0x40008140>(); }
inline Register& timer_intenset() { return at<0x40008304>(); }
inline Register& timer_bitmode() { return at<0x40008508>(); }
inline Register& timer_prescaler() { return at<0x40008510>(); }
inline Register& timer_cc0() { return at<0x40008540>(); }
inline Register& timer_cc1() { return at<0x40008544>(); }
inline constexpr unsigned timer_interrupt = 8;

// [WDT]
inline Register& wdt_start() { return at<0x40010000>(); }
inline Register& wdt_crv() { return at<0x40010504>(); }
inline Register& wdt_rren() { return at<0x40010508>(); }
inline Register& wdt_rr0() { return at<0x40010600>(); }

// [GPIO]
inline Register& gpio_outset() { return at<0x50000508>(); }
inline Register& gpio_dirset() { return at<0x50000518>(); }

}  // namespace bms::hal::nrf51
