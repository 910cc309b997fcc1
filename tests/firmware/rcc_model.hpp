// Register model of the STM32F405's clock tree: oscillators, PLL, dividers and clock security system. Written only from
// RM0090, 3.5.1, 5.1.4 and 7.2 to 7.3, and the datasheet DS8626; it shares no code with hal/.
//
// The frequencies follow from the registers. Ready flags are set once and stay set if the oscillator stops or the PLL
// loses its lock, because the manual promises no more: software that relies on them detects nothing.
// `violations` lists what the manual forbids: a PLL outside its range, a bus or a flash that is too slow for the clock,
// a reserved bit that is changed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace bms::firmware {

class RccModel {
 public:
  static constexpr std::uint32_t base = 0x40023800;
  static constexpr std::uint32_t cr = 0x00, pllcfgr = 0x04, cfgr = 0x08, cir = 0x0C, csr = 0x74;
  static constexpr bool has(std::uint32_t offset) { return offset <= cir || offset == csr; }

  std::uint32_t read(std::uint32_t offset, double now_us);
  void write(std::uint32_t offset, std::uint32_t value, double now_us);
  /// Oscillators start and stop, and the clock security system notices it.
  void advance(double now_us);
  /// Checks the clock against the wait states of the flash (FLASH_ACR) and the voltage scale (PWR_CR).
  void check(std::uint32_t flash_acr, std::uint32_t pwr_cr);
  void reset();

  double core_hz() const;
  double apb1_hz() const { return core_hz() / apb_divider(cfgr_ >> 10); }
  double apb2_hz() const { return core_hz() / apb_divider(cfgr_ >> 13); }
  /// Clock of the timers on APB1 (7.2): twice that of the bus, unless the bus is not divided.
  double apb1_timer_hz() const { return (cfgr_ & 1U << 12) != 0 ? 2 * apb1_hz() : apb1_hz(); }
  bool failure_interrupt() const { return failed_; }
  /// The watchdog needs the slow oscillator.
  void force_lsi(double now_us);
  double lsi_hz_now(double now_us) const;

  // the parts outside the registers
  bool crystal = true;                     ///< oscillates while it is switched on
  double crystal_hz = 25e6;                ///< 25 MHz on all boards
  double crystal_after_us = 2e3;           ///< HSE oscillator characteristics, start-up time, typical
  double pll_after_us = 300;               ///< main PLL characteristics, lock time, maximum
  bool pll_locks = true;                   ///< otherwise it runs free
  double free_running_hz = 4e6;            ///< system clock while the PLL runs free; 0: it stops
  bool security_works = true;              ///< the clock security system notices a failure
  double security_after_us = 10;           ///< the manual states no time
  double lsi_hz = 32e3;                    ///< 17 to 47 kHz (LSI oscillator characteristics)
  double lsi_after_us = 40;                ///< the same table, maximum
  std::uint32_t reset_flags = 0x0E000000;  ///< power on

  std::vector<std::string> violations;

 private:
  static double apb_divider(std::uint32_t bits) { return (bits & 4) != 0 ? 2U << (bits & 3) : 1; }
  void failure();
  void write_cr(std::uint32_t value, double now_us);
  void check_pll();
  bool pll_runs_true() const;
  double system_hz() const;

  std::uint32_t cr_ = 0x83, pllcfgr_ = 0x24003010, cfgr_ = 0;
  bool lsi_on_ = false, failed_ = false;
  double crystal_since_us_ = 0, pll_since_us_ = 0, lsi_since_us_ = -1, stopped_since_us_ = -1;
};

}  // namespace bms::firmware
