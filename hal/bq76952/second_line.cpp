// The part of the driver that reports what the chip's own protections have opened.
#include "hal/second_line.hpp"
#include "hal/bq76952/front_end.hpp"
#include "hal/clock.hpp"

namespace bms::hal::bq76952 {

namespace {

constexpr std::uint8_t max_pins_wrong = 4;  // samples: the chip updates its outputs every 250 ms at the latest

}  // namespace

bool FrontEnd::silent() const { return ran_ && now_us() - answered_us_ >= configuration_->max_silence_us; }

/// Reads what the chip's own protections have opened. What happened before the first sample of this core is not
/// reported, unless it lasts: the contactors were open.
bool FrontEnd::read_second_line() {
  std::array<std::uint8_t, 5> safety{};  // status A, alert B, status B, alert C, status C
  std::array<std::uint8_t, 1> fets{};
  if (!wire_.read(safety_status_a, safety) || !wire_.read(fet_status, fets)) return false;
  const std::uint8_t a = safety[0], b = safety[2], c = safety[4];
  trips_ |= (a >> 2 & 0x0FU) | (a >> 3 & (discharge_overcurrent | short_circuit));
  if (b != 0) trips_ |= temperature;
  if ((c & sustained_overcurrent) != 0) trips_ |= discharge_overcurrent;
  if ((c & host_watchdog) != 0) trips_ |= host_silence;
  const bool latched = (c & short_circuit_latch) != 0;
  if (latched && !latched_) trips_ |= short_circuit;
  latched_ = latched;
  if (failed_permanently_) trips_ |= permanent_failure;
  // Trips that are over. Of register A only these recover unseen; of B and C the watchdog, by the first transfer.
  if (ran_ && (alarm_ & tripped_a) != 0 && (a | safety_a_) == 0)
    trips_ |= cell_undervoltage | cell_overvoltage | charge_overcurrent | discharge_overcurrent;
  if (ran_ && (alarm_ & tripped_bc) != 0 && (b | c | safety_bc_) == 0) trips_ |= host_silence;
  alarm_ = 0;
  safety_a_ = a;
  safety_bc_ = b | c;
  if (pins_follow(a, b, c, fets[0]))
    pins_wrong_ = 0;
  else if (pins_wrong_ < max_pins_wrong)
    ++pins_wrong_;
  if (pins_wrong_ >= max_pins_wrong) trips_ |= pins_wrong;
  ran_ = true;
  return true;
}

/// Returns true if DDSG and DCHG are what the protections demand.
bool FrontEnd::pins_follow(std::uint8_t safety_a, std::uint8_t safety_b, std::uint8_t safety_c, std::uint8_t fets) {
  const auto asserted = [&](std::uint8_t faults_a, std::uint8_t faults_b, std::uint8_t faults_c) {
    return failed_permanently_ || (safety_a & faults_a) != 0 || (safety_b & faults_b) != 0 ||
           (safety_c & faults_c) != 0;
  };
  return asserted(dsg_faults_a, dsg_faults_b, dsg_faults_c) == ((fets & ddsg_asserted) != 0) &&
         asserted(chg_faults_a, chg_faults_b, chg_faults_c) == ((fets & dchg_asserted) != 0);
}

}  // namespace bms::hal::bq76952
