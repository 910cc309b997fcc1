// I2C1 on PB6 (SCL) and PB7 (SDA), alternate function 4 (datasheet, table 9), by polling: no interrupt, no DMA.
// Registers and order of events: RM0090, 27.3.3 and 27.6. USART1 of hal/stm32f4/uart.cpp has the same pins, so an image
// has only one of the two.
//
// An image with two buses has this file twice: with BMS_ISOLATED_BUS it is I2C2 on PB10 (SCL) and PB11 (SDA), and the
// functions are those of hal/isolated_i2c.hpp.
//
// The end of a read follows 27.3.3: one byte (acknowledge off before the address flag is cleared), two bytes (POS),
// more (the last three by BTF). An interrupt between two register accesses may therefore take any time: it makes a
// transfer longer, not wrong, because the clock waits.
//
// The controller's BUSY flag may stay set with both wires high (erratum "I2C analog filter may provide wrong value,
// locking BUSY flag", STM32F405 errata ES0182). i2c_recover() then drives both wires as outputs and resets the
// controller.
#include "hal/i2c.hpp"

#include "hal/clock.hpp"
#include "hal/isolated_i2c.hpp"
#include "hal/stm32f4/clock_tree.hpp"
#include "hal/stm32f4/registers.hpp"

namespace bms::hal {

namespace {

using namespace stm32f4;

#ifdef BMS_ISOLATED_BUS
#define BMS_OF_BUS(function) isolated_##function
constexpr std::uint32_t controller = 0x40005800, clock_of_controller = 1U << 22, first_pin = 10;
#else
#define BMS_OF_BUS(function) function
constexpr std::uint32_t controller = 0x40005400, clock_of_controller = 1U << 21, first_pin = 6;
#endif
Register& i2c_cr1() { return at<controller>(); }
Register& i2c_cr2() { return at<controller + 0x04>(); }
Register& i2c_dr() { return at<controller + 0x10>(); }
Register& i2c_sr1() { return at<controller + 0x14>(); }
Register& i2c_sr2() { return at<controller + 0x18>(); }
Register& i2c_ccr() { return at<controller + 0x1C>(); }
Register& i2c_trise() { return at<controller + 0x20>(); }
Register& alternate_functions() { return first_pin < 8 ? gpiob_afrl() : gpiob_afrh(); }
constexpr std::uint32_t two_pins = 2 * first_pin, four_bits = 4 * (first_pin % 8);  // places in MODER and AFR

constexpr std::uint32_t scl = 1U << first_pin, sda = 2U << first_pin;
constexpr std::uint32_t cr1_on = 1U << 0, cr1_start = 1U << 8, cr1_stop = 1U << 9, cr1_ack = 1U << 10,
                        cr1_pos = 1U << 11, cr1_reset = 1U << 15;
constexpr std::uint32_t sr1_started = 1U << 0, sr1_address = 1U << 1, sr1_finished = 1U << 2, sr1_received = 1U << 6,
                        sr1_empty = 1U << 7;
constexpr std::uint32_t sr1_bus_error = 1U << 8, sr1_arbitration = 1U << 9, sr1_no_acknowledge = 1U << 10;
constexpr std::uint32_t sr2_busy = 1U << 1;
constexpr std::uint32_t half_bit_us = 5;  // of the recovery clock: 100 kHz

struct Speed {
  std::uint32_t ccr, trise;
};

/// Fast mode, clock low for two thirds: ccr = clock / (3 x 400 kHz), rounded up so that it is never faster; trise =
/// clock periods in 300 ns, plus 1 (27.6.8, 27.6.9).
constexpr Speed speed(std::uint32_t apb1_hz) {
  return {1U << 15 | (apb1_hz + 1'199'999) / 1'200'000, apb1_hz / 1'000 * 300 / 1'000'000 + 1};
}
static_assert(speed(42'000'000).ccr == (1U << 15 | 35) && speed(42'000'000).trise == 13);
static_assert(speed(16'000'000).ccr == (1U << 15 | 14) && speed(16'000'000).trise == 5);

void set(std::uint32_t bits) { i2c_cr1() = i2c_cr1() | bits; }
void clear(std::uint32_t bits) { i2c_cr1() = i2c_cr1() & ~bits; }

/// Reading SR2 after SR1 clears the address flag, and the clock continues.
void clear_address() {
  const std::uint32_t read = i2c_sr2();
  static_cast<void>(read);
}

void configure() {
  i2c_cr1() = cr1_reset;
  i2c_cr1() = 0;
  const std::uint32_t apb1_hz = clocks().core_hz == crystal_core_hz ? crystal_apb1_hz : clocks().core_hz;
  const Speed s = speed(apb1_hz);
  i2c_cr2() = apb1_hz / 1'000'000;
  i2c_ccr() = s.ccr;
  i2c_trise() = s.trise;
  i2c_cr1() = cr1_on;
}

void pins(std::uint32_t mode) { gpiob_moder() = (gpiob_moder() & ~(15U << two_pins)) | (mode | mode << 2) << two_pins; }

bool both_high() { return (gpiob_idr() & (scl | sda)) == (scl | sda); }

void pause() {
  const std::uint64_t until = now_us() + half_bit_us + 1;
  while (now_us() < until) {
  }
}

/// One transfer with its time limit.
class Transfer {
 public:
  explicit Transfer(std::uint32_t longest_us) : until_us_(now_us() + longest_us) {}

  I2cResult write(std::uint8_t address, std::span<const std::uint8_t> out) {
    if (const auto r = begin(static_cast<std::uint32_t>(address) << 1); r != I2cResult::done) return r;
    clear_address();
    for (const std::uint8_t byte : out) {
      if (const auto r = wait(sr1_empty); r != I2cResult::done) return r;
      i2c_dr() = byte;
    }
    return out.empty() ? I2cResult::done : wait(sr1_finished);
  }

  I2cResult read(std::uint8_t address, std::span<std::uint8_t> in) {
    set(cr1_ack);
    clear(cr1_pos);
    if (const auto r = begin(static_cast<std::uint32_t>(address) << 1 | 1); r != I2cResult::done) return r;
    std::size_t at = 0;
    if (in.size() == 1) {
      clear(cr1_ack);
      clear_address();
      set(cr1_stop);
      if (const auto r = wait(sr1_received); r != I2cResult::done) return r;
    } else if (in.size() == 2) {
      set(cr1_pos);
      clear_address();
      clear(cr1_ack);
      if (const auto r = wait(sr1_finished); r != I2cResult::done) return r;
      set(cr1_stop);
      in[at++] = static_cast<std::uint8_t>(i2c_dr());
    } else {
      clear_address();
      for (; at + 3 < in.size(); ++at) {
        if (const auto r = wait(sr1_received); r != I2cResult::done) return r;
        in[at] = static_cast<std::uint8_t>(i2c_dr());
      }
      // Now the third last byte is in DR, and the second last in the shift register.
      if (const auto r = wait(sr1_finished); r != I2cResult::done) return r;
      clear(cr1_ack);
      in[at++] = static_cast<std::uint8_t>(i2c_dr());
      if (const auto r = wait(sr1_finished); r != I2cResult::done) return r;
      set(cr1_stop);
      in[at++] = static_cast<std::uint8_t>(i2c_dr());
      if (const auto r = wait(sr1_received); r != I2cResult::done) return r;
    }
    in[at] = static_cast<std::uint8_t>(i2c_dr());
    return I2cResult::done;
  }

  /// Waits until the requested stop is sent and the bus is no longer busy.
  I2cResult end() {
    while ((i2c_sr2() & sr2_busy) != 0) {
      if (now_us() > until_us_) return I2cResult::timed_out;
    }
    return I2cResult::done;
  }

 private:
  I2cResult begin(std::uint32_t address) {
    set(cr1_start);
    if (const auto r = wait(sr1_started); r != I2cResult::done) return r;
    i2c_dr() = address;
    return wait(sr1_address);
  }

  I2cResult wait(std::uint32_t flag) {
    while (true) {
      const std::uint32_t status = i2c_sr1();
      if ((status & sr1_no_acknowledge) != 0) return I2cResult::no_acknowledge;
      if ((status & sr1_arbitration) != 0) return I2cResult::bus_stuck;
      // A misplaced start or stop does not change the transfer of a master (27.3.4, bus error); the check code of the
      // device finds a wrong byte. The controller may also report it without a cause (ES0182).
      if ((status & sr1_bus_error) != 0) i2c_sr1() = ~sr1_bus_error;
      if ((status & flag) != 0) return I2cResult::done;
      if (now_us() > until_us_) return I2cResult::timed_out;
    }
  }

  std::uint64_t until_us_;
};

}  // namespace

void BMS_OF_BUS(i2c_start)() {
  rcc_ahb1enr() = rcc_ahb1enr() | 1U << 1;
  rcc_apb1enr() = rcc_apb1enr() | clock_of_controller;
  gpiob_bsrr() = scl | sda;
  gpiob_otyper() = gpiob_otyper() | scl | sda;
  alternate_functions() = (alternate_functions() & ~(255U << four_bits)) | 0x44U << four_bits;
  BMS_OF_BUS(i2c_recover)();  // a device may still wait in the middle of a byte after a reset of this core
}

I2cResult BMS_OF_BUS(i2c_transfer)(std::uint8_t address, std::span<const std::uint8_t> out,
                                   std::span<std::uint8_t> in) {
  if ((i2c_sr2() & sr2_busy) != 0) return I2cResult::bus_stuck;
  Transfer transfer(i2c_time_us(out.size() + in.size()));
  I2cResult result = out.empty() ? I2cResult::done : transfer.write(address, out);
  if (result == I2cResult::done && !in.empty()) result = transfer.read(address, in);
  if (result == I2cResult::done && in.empty()) set(cr1_stop);
  if (result == I2cResult::no_acknowledge) {
    i2c_sr1() = i2c_sr1() & ~sr1_no_acknowledge;
    set(cr1_stop);
  }
  if (result == I2cResult::bus_stuck || result == I2cResult::timed_out) {
    configure();  // releases both wires
    return result;
  }
  const I2cResult ended = transfer.end();
  return ended == I2cResult::done ? result : ended;
}

bool BMS_OF_BUS(i2c_recover)() {
  gpiob_bsrr() = scl | sda;
  pins(1);  // outputs, open drain
  for (int k = 0; k < 9 && (gpiob_idr() & sda) == 0; ++k) {
    gpiob_bsrr() = scl << 16;
    pause();
    gpiob_bsrr() = scl;
    pause();
  }
  // a stop: the data wire rises while the clock is high
  for (const std::uint32_t level : {scl << 16, sda << 16, scl, sda}) {
    gpiob_bsrr() = level;
    pause();
  }
  const bool free = both_high();
  pins(2);  // alternate function
  configure();
  return free;
}

}  // namespace bms::hal
