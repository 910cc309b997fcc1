#include "tests/firmware/timer_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace bms::firmware {

namespace {

constexpr std::uint32_t cr1 = 0x00, dier = 0x0C, sr = 0x10, ccmr2 = 0x1C, ccer = 0x20, cnt = 0x24, psc = 0x28,
                        arr = 0x2C, ccr4 = 0x40, option = 0x50;
constexpr std::uint32_t counts = 1, capture_on = 1U << 12, capture_flag = 1U << 4, overcapture = 1U << 12;

}  // namespace

std::uint32_t TimerModel::read(std::uint32_t at) {
  switch (at) {
    case sr:
      return status_;
    case cnt:
      return static_cast<std::uint32_t>(static_cast<std::uint64_t>(count_));
    case ccr4:
      status_ &= ~capture_flag;  // 18.4.5: cleared by reading
      return captured_;
    default:
      return registers_[at];
  }
}

void TimerModel::write(std::uint32_t at, std::uint32_t value) {
  if (at == sr) {
    status_ &= value;  // cleared by writing 0
    return;
  }
  const bool known = at == cr1 || at == dier || at == ccmr2 || at == ccer || at == psc || at == arr || at == option;
  if (!known) violations.push_back(fmt::format("TIM5 register {:#x} is not modelled", at));
  if (at == ccmr2 && (registers_[ccer] & capture_on) != 0 && ((value ^ registers_[at]) & 0x300) != 0)
    violations.push_back("CC4S is written while the channel is on");  // 18.4.8
  registers_[at] = value;
}

/// 18.4.8: IC4PSC captures every edge, or one of 2, 4 or 8.
void TimerModel::edge(double count) {
  if ((registers_[ccer] & capture_on) == 0 || (registers_[ccmr2] >> 8 & 3) != 1) {
    edges_ = 0;
    return;
  }
  if (++edges_ < 1U << (registers_[ccmr2] >> 10 & 3)) return;
  edges_ = 0;
  if ((status_ & capture_flag) != 0) status_ |= overcapture;
  status_ |= capture_flag;
  captured_ = static_cast<std::uint32_t>(static_cast<std::uint64_t>(count));
  ++captures;
}

double TimerModel::input_hz(double lsi_hz, double lse_hz) const {
  const auto found = registers_.find(option);
  const std::uint32_t source = found == registers_.end() ? 0 : found->second >> 6 & 3;  // 18.4.20, TI4_RMP
  if (source == 1) return lsi_hz;
  return source == 2 ? lse_hz : 0;
}

double TimerModel::capture_after_us(double lsi_hz, double lse_hz) const {
  const double hz = input_hz(lsi_hz, lse_hz);
  const auto channel = registers_.find(ccmr2);
  if (hz <= 0 || channel == registers_.end()) return std::numeric_limits<double>::infinity();
  const double edges = (1U << (channel->second >> 10 & 3)) - static_cast<double>(edges_) - phase_;
  return std::max(0.0, edges) / hz * 1e6;
}

void TimerModel::pass(double us, double clock_hz, double lsi_hz, double lse_hz) {
  const bool on = (registers_[cr1] & counts) != 0;
  const double per_us = on ? 1e-6 * clock_hz / (registers_[psc] + 1) : 0;
  const double edges = us * 1e-6 * input_hz(lsi_hz, lse_hz);
  for (double next = std::floor(phase_) + 1; next <= phase_ + edges; next += 1)
    edge(count_ + (next - phase_) / edges * us * per_us);
  phase_ = std::fmod(phase_ + edges, 1);
  count_ = std::fmod(count_ + us * per_us, 4'294'967'296.0);
}

bool TimerModel::interrupt() const {
  const auto enabled = registers_.find(dier);
  return enabled != registers_.end() && (enabled->second & status_ & capture_flag) != 0;
}

}  // namespace bms::firmware
