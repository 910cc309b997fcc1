#include "tests/firmware/watchdog_model.hpp"

#include <algorithm>

namespace bms::firmware {

namespace {

constexpr std::uint32_t kr = 0x00, pr = 0x04, rlr = 0x08, sr = 0x0C;
constexpr double update_cycles = 5;

}  // namespace

void WatchdogModel::reset(double now_us, bool by_hardware) {
  prescaler_ = {0, 0, 0};
  reload_ = {0xFFF, 0xFFF, 0};
  running_ = unlocked_ = false;
  at_us_ = now_us;
  fed_us_ = -1;
  if (by_hardware) start(now_us);
}

void WatchdogModel::start(double now_us) {
  clocks_.force_lsi(now_us);
  if (running_) return;
  running_ = true;
  left_ = reload_.now + 1;
}

/// In steps that end where a new value takes effect.
void WatchdogModel::advance(double now_us) {
  if (!running_ && prescaler_.cycles_left == 0 && reload_.cycles_left == 0) at_us_ = now_us;
  while (at_us_ < now_us) {
    const double hz = clocks_.lsi_hz_now(at_us_);
    if (hz == 0) {
      at_us_ = std::min(now_us, at_us_ + 1);
      continue;
    }
    double cycles = (now_us - at_us_) * 1e-6 * hz;
    for (const Value* v : {&prescaler_, &reload_}) {
      if (v->cycles_left > 0) cycles = std::min(cycles, v->cycles_left);
    }
    if (running_) left_ -= cycles / (4U << std::min(prescaler_.now, 6U));
    for (Value* v : {&prescaler_, &reload_}) {
      if (v->cycles_left == 0) continue;
      v->cycles_left -= cycles;
      if (v->cycles_left > 1e-9) continue;
      v->cycles_left = 0;
      v->now = v->next;
      note_timeout();
    }
    const double to = at_us_ + cycles * 1e6 / hz;
    at_us_ = to > at_us_ && to < now_us ? to : now_us;
  }
}

bool WatchdogModel::expired(double now_us) {
  advance(now_us);
  return running_ && left_ <= 0;
}

void WatchdogModel::feed(double now_us) {
  if (running_) left_ = reload_.now + 1;
  ++feeds;
  if (fed_us_ >= 0) longest_unfed_ms = std::max(longest_unfed_ms, 1e-3 * (now_us - fed_us_));
  fed_us_ = now_us;
  note_timeout();
}

void WatchdogModel::note_timeout() {
  if (!running_ || fed_us_ < 0 || clocks_.lsi_hz == 0) return;
  longest_timeout_ms =
      std::max(longest_timeout_ms, 1e3 * left_ * (4U << std::min(prescaler_.now, 6U)) / clocks_.lsi_hz);
}

void WatchdogModel::write_value(Value& value, std::uint32_t next) {
  if (!unlocked_) return violations.push_back("a watchdog register is written while locked");
  if (value.cycles_left > 0) return violations.push_back("a watchdog register is written during its update");
  value.next = next;
  value.cycles_left = update_cycles;
}

std::uint32_t WatchdogModel::read(std::uint32_t at, double now_us) {
  advance(now_us);
  switch (at) {
    case pr:
      return prescaler_.now;
    case rlr:
      return reload_.now;
    case sr:
      return (prescaler_.cycles_left > 0 ? 1U : 0U) | (reload_.cycles_left > 0 ? 2U : 0U);
    default:
      return 0;
  }
}

/// 21.4.1: 0x5555 unlocks, 0xAAAA feeds, 0xCCCC starts; a key other than 0x5555 locks.
void WatchdogModel::write(std::uint32_t at, std::uint32_t value, double now_us) {
  advance(now_us);
  switch (at) {
    case kr:
      unlocked_ = value == 0x5555;
      if (value == 0xCCCC) start(now_us);
      if (value == 0xAAAA) feed(now_us);
      return;
    case pr:
      return write_value(prescaler_, value & 7);
    case rlr:
      return write_value(reload_, value & 0xFFF);
    default:
      return;
  }
}

}  // namespace bms::firmware
