#include "tests/firmware/world/insulation_device.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace bms::world {

namespace {

constexpr std::uint32_t cr1 = 0x00, smcr = 0x08, sr = 0x10, egr = 0x14, ccmr1 = 0x18, ccer = 0x20, psc = 0x28,
                        arr = 0x2C, ccr1 = 0x34, ccr2 = 0x38, clock_enable = 0x40023840;
constexpr double looks_again_us = 5'000;  ///< without pulses

/// 90 % x 1.2 Mohm / (share - 5 %) = resistance + 1.2 Mohm.
double share_of(double ohm) { return 0.05 + 0.9 * 1.2e6 / (std::max(0.0, ohm) + 1.2e6); }

}  // namespace

void InsulationDevice::pass(double seconds, double ohm) {
  ohm_ = ohm;
  if (fault == Fault::no_supply) {
    on_s_ = 0;
    return;
  }
  if (on_s_ < estimates_s) share_ = share_of(ohm);
  on_s_ += seconds;
  share_ += (share_of(ohm) - share_) * (1 - std::exp(-seconds / averages_over_s));
}

InsulationDevice::Pulse InsulationDevice::pulse() const {
  switch (fault) {
    case Fault::no_supply:
      return {0, 0};
    case Fault::device:
      return {40, 0.5};
    case Fault::earth_broken:
      return {50, 0.5};
    case Fault::none:
      break;
  }
  if (on_s_ < estimates_s) return {30, ohm_ > 2 * response_ohm ? 0.075 : 0.925};
  return {10, share_};
}

/// 18.3.6: CC1S 01, CC2S 10, CC1P rising, CC2P falling, TS 101, SMS 100; the pin has alternate function 2.
bool PulseTimer::connected() const {
  const auto at = [&](std::uint32_t offset) {
    const auto found = registers_.find(offset);
    return found == registers_.end() ? 0 : found->second;
  };
  if ((at(cr1) & 1) == 0) return false;
  return (at(ccmr1) & 0x303) == 0x201 && (at(ccer) & 0x33) == 0x31 && (at(smcr) & 0x77) == 0x54 &&
         (port_a_.read(0x00, 0) >> 12 & 3) == 2 && (port_a_.read(0x20, 0) >> 24 & 15) == 2;
}

void PulseTimer::edge(bool rises, double at_us) {
  if (!connected()) return;
  const double counts_per_us = 1e-6 * board_.rcc.apb1_timer_hz() / (registers_[psc] + 1);
  const double count = std::fmod((at_us - zero_us_) * counts_per_us, registers_[arr] + 1.0);
  if (rises) {
    period_ = static_cast<std::uint32_t>(count);
    status_ |= 1U << 1;
    zero_us_ = at_us;
    ++captures;
  } else {
    high_ = static_cast<std::uint32_t>(count);
    status_ |= 1U << 2;
  }
}

void PulseTimer::catch_up(double now_us) {
  while (edge_us_ <= now_us) {
    if (high_level_) {
      high_level_ = false;
      edge(false, edge_us_);
      edge_us_ += low_us_;
      continue;
    }
    const InsulationDevice::Pulse pulse = device_.pulse();
    if (pulse.hz <= 0) {
      edge_us_ += looks_again_us;
      continue;
    }
    high_us_ = 1e6 * pulse.share / pulse.hz;
    low_us_ = 1e6 / pulse.hz - high_us_;
    high_level_ = true;
    edge(true, edge_us_);
    edge_us_ += high_us_;
  }
}

void PulseTimer::check_clock(double now_us) {
  catch_up(now_us);
  if ((board_.register_value(clock_enable) >> 1 & 1) == 0) violations.push_back("timer 3 has no clock");
}

std::uint32_t PulseTimer::read(std::uint32_t offset, double now_us) {
  check_clock(now_us);
  switch (offset) {
    case sr:
      return status_;
    case ccr1:
      status_ &= ~(1U << 1);  // 18.4.5: cleared by reading
      return period_;
    case ccr2:
      status_ &= ~(1U << 2);
      return high_;
    default:
      return registers_[offset];
  }
}

void PulseTimer::write(std::uint32_t offset, std::uint32_t value, double now_us) {
  check_clock(now_us);
  const bool known = offset == cr1 || offset == smcr || offset == sr || offset == egr || offset == ccmr1 ||
                     offset == ccer || offset == psc || offset == arr;
  if (!known) violations.push_back(fmt::format("timer 3, register {:#x} is not modelled", offset));
  if (offset == sr) {
    status_ &= value;  // cleared by writing 0
  } else if (offset == egr) {
    zero_us_ = now_us;
  } else {
    registers_[offset] = value;
  }
}

void PulseTimer::chip_reset() {
  registers_.clear();
  status_ = period_ = high_ = 0;
}

}  // namespace bms::world
