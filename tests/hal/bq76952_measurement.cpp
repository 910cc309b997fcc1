#include "tests/hal/bq76952_measurement.hpp"

#include <algorithm>
#include <cmath>

#include "tests/hal/thermistor.hpp"

namespace bms::bq {

namespace {

// SLUUBY2B, 4.5: digital full scale of the cells +-5 x VREF1 and of the current +-VREF2 / 5, 24 bits
constexpr double cell_full_scale_v = 5 * 1.212, current_full_scale_v = 1.24 / 5, half_range = 8'388'608;
constexpr double counts_per_16_bit = 256;              // CC Gain is in mA per count of 16 bits, SLUUBY2B, 4.12
constexpr double capacity_per_cc_gain = 298'261.6178;  // the same section
constexpr std::size_t stack_register = 0x34, first_temperature = 0x6A, internal_temperature = 0x68;

std::int16_t saturated(double value) {
  return static_cast<std::int16_t>(std::clamp(std::round(value), -32768.0, 32767.0));
}

void put_bytes(std::span<std::uint8_t> to, std::size_t at, std::uint64_t value, std::size_t bytes) {
  for (std::size_t k = 0; k < bytes; ++k) to[at + k] = static_cast<std::uint8_t>(value >> 8 * k);
}

int decikelvin(double celsius) { return static_cast<int>(std::lround(10 * (celsius + 273.15))); }

}  // namespace

void Measurement::reset() {
  direct_ = {};
  cell_counts_ = cell_current_counts_ = {};
  slot_left_us_ = 3'000;
  quarter_left_us_ = 250'000;
  slot_vs_ = quarter_vs_ = cc2_counts_ = cc3_counts_ = cc1_ma_ = 0;
  cc1_ = cc2_ = cc3_ = 0;
  full_scans_ = 0;
  scan_ = full_scan_ = false;
  restart();
  restart_charge();
}

void Measurement::restart() {
  slot_ = loop_ = cc3_count_ = 0;
  cc3_sum_ = 0;
  cc3_last_.clear();
}

void Measurement::restart_charge() {
  charge_ = 0x7FFF'FFFF;
  quarter_seconds_ = 0;
}

std::uint64_t Measurement::next_us() const { return std::min(slot_left_us_, quarter_left_us_); }

/// 3 ms, or 1.5 ms with FASTADC (Power Config, bit 6).
std::uint64_t Measurement::slot_us() const { return (memory_[power_config] & 0x40) != 0 ? 1'500 : 3'000; }

void Measurement::step(std::uint64_t us, const Bq76952Inputs& in, const MeasurementFaults& faults, bool measures,
                       std::uint16_t balancing) {
  const double limited_v = std::clamp(in.shunt_v, -variant_.adc_limit_v, variant_.adc_limit_v);
  slot_vs_ += limited_v * 1e-6 * static_cast<double>(us);
  quarter_vs_ += limited_v * 1e-6 * static_cast<double>(us);
  slot_left_us_ -= us;
  quarter_left_us_ -= us;
  if (slot_left_us_ == 0) {
    if (measures && !faults.frozen) slot_ends(in, faults, balancing);
    slot_left_us_ = slot_us();
    slot_vs_ = 0;
  }
  if (quarter_left_us_ == 0) {
    if (measures && !faults.frozen) quarter_ends();
    quarter_left_us_ = 250'000;
    quarter_vs_ = 0;
  }
}

// ---- current ----

double Measurement::user_ma() const {
  constexpr std::array<double, 4> ma{0.1, 1, 10, 100};  // DA Configuration[USER_AMPS], SLUUBY2B, 13.3.2.18
  return ma[memory_[da_configuration] & 3];
}

double Measurement::counts_of(double shunt_v) const {
  const int samples = static_cast<int>(memory_[cc_offset_samples]);
  const double offset = samples == 0 ? 0 : static_cast<double>(memory_.signed_value(board_offset)) / samples;
  const double counts = shunt_v / current_full_scale_v * half_range - offset;
  return std::clamp(counts, -half_range, half_range - 1);
}

std::int16_t Measurement::to_user_current(double counts) const {
  const double user = counts / counts_per_16_bit * memory_.real(cc_gain) / user_ma();
  if (variant_.user_current_wraps) return static_cast<std::int16_t>(static_cast<std::uint16_t>(std::llround(user)));
  return saturated(user);
}

void Measurement::current_ends(const MeasurementFaults& faults) {
  cc2_counts_ = counts_of(slot_vs_ / (1e-6 * static_cast<double>(slot_us())));
  cc2_ = to_user_current(cc2_counts_);
  put_bytes(direct_, 0x3A, static_cast<std::uint16_t>(cc2_), 2);
  const double counts = (1 - faults.cc3_loses) * cc2_counts_;
  const int samples = static_cast<int>(memory_[cc3_samples]);
  if (variant_.cc3_moving_mean) {
    cc3_last_.push_back(counts);
    while (static_cast<int>(cc3_last_.size()) > samples) cc3_last_.pop_front();
    double sum = 0;
    for (const double c : cc3_last_) sum += c;
    cc3_counts_ = sum / static_cast<double>(cc3_last_.size());
  } else {
    cc3_sum_ += counts;
    if (++cc3_count_ < samples) return;
    cc3_counts_ = cc3_sum_ / cc3_count_;
    cc3_sum_ = 0;
    cc3_count_ = 0;
  }
  cc3_ = to_user_current(cc3_counts_);
}

/// CC1: the mean of 250 ms; it is counted as charge.
void Measurement::quarter_ends() {
  const double counts = counts_of(quarter_vs_ / 0.25);
  cc1_ma_ = counts / counts_per_16_bit * memory_.real(cc_gain);
  cc1_ = to_user_current(counts);
  const double user_ah =
      counts / counts_per_16_bit * memory_.real(capacity_gain) / capacity_per_cc_gain / user_ma() * 0.25 / 3'600;
  constexpr std::int64_t limit = 0x7FFF'FFFF'FFFF'FFFF / 2;  // the chip's own limit is not documented
  const auto more = static_cast<std::int64_t>(std::llround(user_ah * 4'294'967'296.0));
  charge_ = std::clamp(charge_ + more, -limit, limit);
  ++quarter_seconds_;
}

// ---- scan ----

int Measurement::enabled_thermistors() const {
  int enabled = 0;
  for (std::size_t k = 0; k < thermistor_pins; ++k) enabled += (pin_config(k) & 3) == 3 ? 1 : 0;
  return enabled;
}

/// 16 cells, one of VC16, PACK and LD, one of internal temperature and references, and up to three thermistors.
int Measurement::slots() const { return 18 + std::min(3, enabled_thermistors()); }

void Measurement::slot_ends(const Bq76952Inputs& in, const MeasurementFaults& faults, std::uint16_t balancing) {
  current_ends(faults);
  const int slot = slot_;
  if (slot < 16)
    store_cell(static_cast<std::size_t>(slot), in, faults);
  else if (!faults.only_cells && slot == 16)
    store_divider(in);
  else if (!faults.only_cells && slot == 17)
    put_bytes(direct_, internal_temperature, static_cast<std::uint16_t>(decikelvin(in.internal_c)), 2);
  else if (!faults.only_cells && slot < slots())
    store_thermistor(slot - 18, in);
  // Power Config: LOOP_SLOW, bits 3:2, or CB_LOOP_SLOW, bits 5:4, while balancing: idle slots, 1, 2, 4 or 8 times as
  // long
  const unsigned slow = memory_[power_config] >> (balancing != 0 ? 4 : 2) & 3;
  if (++slot_ >= slots() << slow) scan_ends(faults.only_cells, balancing);
}

void Measurement::store_cell(std::size_t k, const Bq76952Inputs& in, const MeasurementFaults& faults) {
  if ((faults.stale_cells >> k & 1) != 0) return;
  // A disabled cell reads 0. Vcell Mode 0 selects all cells (SLUUBY2B, 13.3.2.19).
  const std::uint32_t mode = memory_[vcell_mode];
  const bool enabled = mode == 0 || (mode >> k & 1) != 0;
  // Above 5 x VREF1 the chip may report -6.06 V (SLUUCW9, 4.1).
  const double v = in.cell_v[k] >= cell_full_scale_v ? -cell_full_scale_v : std::max(in.cell_v[k], -0.2);
  const bool zero = !enabled || (faults.zero_cells >> k & 1) != 0;
  put_bytes(direct_, 0x14 + 2 * k, static_cast<std::uint16_t>(zero ? 0 : saturated(1e3 * v)), 2);
  cell_counts_[k] = static_cast<std::int32_t>(std::lround(v / cell_full_scale_v * half_range));
  cell_current_counts_[k] = static_cast<std::int32_t>(std::lround(cc2_counts_));
}

/// VC16, PACK or LD, one in each loop, in userV: 1 mV or 10 mV (DA Configuration, bit 2).
void Measurement::store_divider(const Bq76952Inputs& in) {
  if (loop_ > 2) return;
  const double unit_v = (memory_[da_configuration] & 4) != 0 ? 0.01 : 0.001;
  const double v = std::array{in.stack_v, in.pack_v, in.ld_v}[static_cast<std::size_t>(loop_)];
  put_bytes(direct_, stack_register + 2 * static_cast<std::size_t>(loop_),
            static_cast<std::uint16_t>(saturated(std::max(v, 0.0) / unit_v)), 2);
}

/// The enabled pins in order, three in each loop. The curve of the 103AT stands for the polynomial that approximates
/// it.
void Measurement::store_thermistor(int of_scan, const Bq76952Inputs& in) {
  int wanted = 3 * std::min(loop_, 2) + of_scan;
  for (std::size_t k = 0; k < thermistor_pins; ++k) {
    const std::uint8_t config = pin_config(k);
    if ((config & 3) != 3 || wanted-- != 0) continue;
    const double ohm = in.thermistor_ohm[k], pull_up_ohm = (config & 0xC0) == 0 ? 18'000 : 180'000;
    int value = 0;
    if ((config & 0x30) != 0)
      value = saturated(32'768 * (ohm > 1e9 ? 1.0 : ohm / (ohm + pull_up_ohm)));  // without the model: counts
    else if (ohm < 10)
      value = variant_.shorted_thermistor_dk;
    else
      value = ohm > 5e6 ? variant_.open_thermistor_dk : decikelvin(thermistor_celsius(ohm));
    put_bytes(direct_, first_temperature + 2 * k, static_cast<std::uint16_t>(value), 2);
  }
}

void Measurement::scan_ends(bool only_cells, std::uint16_t) {
  slot_ = 0;
  scan_ = true;
  if (only_cells || ++loop_ < 3) return;
  loop_ = 0;
  full_scan_ = true;
  ++full_scans_;
}

// ---- derived ----

bool Measurement::has_cell_temperature() const {
  for (std::size_t k = 0; k < thermistor_pins; ++k) {
    if ((pin_config(k) & 0x0F) == 0x07 && word(first_temperature + 2 * k) != 0) return true;
  }
  return false;
}

namespace {

constexpr int cell_thermistor = 0x07, fet_thermistor = 0x0F;  // pin function 3 and OPT1:0 = 1 or 3

}  // namespace

int Measurement::max_cell_dk() const {
  int most = -1;
  for (std::size_t k = 0; k < thermistor_pins; ++k) {
    if ((pin_config(k) & 0x0F) == cell_thermistor) most = std::max<int>(most, word(first_temperature + 2 * k));
  }
  return most;
}

int Measurement::min_cell_dk() const {
  int least = 0x7FFF;
  for (std::size_t k = 0; k < thermistor_pins; ++k) {
    if ((pin_config(k) & 0x0F) == cell_thermistor) least = std::min<int>(least, word(first_temperature + 2 * k));
  }
  return least;
}

int Measurement::fet_dk() const {
  int most = -1;
  for (std::size_t k = 0; k < thermistor_pins; ++k) {
    if ((pin_config(k) & 0x0F) == fet_thermistor) most = std::max<int>(most, word(first_temperature + 2 * k));
  }
  return most;
}

int Measurement::internal_dk() const { return word(internal_temperature); }

// ---- blocks ----

/// Two published drivers agree: VREG18, VSS, maximum and minimum cell, sum, cell and FET temperature, maximum, minimum
/// and mean cell temperature, CC3 (byte 20), CC1 (byte 22), CC2 and CC3 as 32-bit counts (bytes 24 and 28).
void Measurement::fill_dastatus5(std::span<std::uint8_t> to) const {
  int most = cell_mv(0), least = cell_mv(0), sum = 0;
  for (std::size_t k = 0; k < 16; ++k) {
    most = std::max(most, cell_mv(k));
    least = std::min(least, cell_mv(k));
    sum += cell_mv(k);
  }
  const int per_user_mv = (memory_[da_configuration] & 4) != 0 ? 10 : 1;
  put_bytes(to, 4, static_cast<std::uint16_t>(most), 2);
  put_bytes(to, 6, static_cast<std::uint16_t>(least), 2);
  put_bytes(to, 8, static_cast<std::uint16_t>(saturated(sum / per_user_mv)), 2);
  put_bytes(to, 12, static_cast<std::uint16_t>(std::max(fet_dk(), 0)), 2);
  put_bytes(to, 14, static_cast<std::uint16_t>(std::max(max_cell_dk(), 0)), 2);
  put_bytes(to, 16, static_cast<std::uint16_t>(min_cell_dk()), 2);
  put_bytes(to, 20, static_cast<std::uint16_t>(cc3_), 2);
  put_bytes(to, 22, static_cast<std::uint16_t>(cc1_), 2);
  put_bytes(to, 24, static_cast<std::uint32_t>(std::lround(cc2_counts_)), 4);
  put_bytes(to, 28, static_cast<std::uint32_t>(std::lround(cc3_counts_)), 4);
}

/// Charge in userAh: integer part, fraction in 1 / 2^32, time in s (SLUUBY2B, 4.6; E2E 1006473).
void Measurement::fill_dastatus6(std::span<std::uint8_t> to) const {
  put_bytes(to, 0, static_cast<std::uint32_t>(charge_ >> 32), 4);
  put_bytes(to, 4, static_cast<std::uint32_t>(charge_), 4);
  put_bytes(to, 8, quarter_seconds_ / 4, 4);
}

void Measurement::fill_raw_cells(std::span<std::uint8_t> to, std::size_t first_cell) const {
  for (std::size_t k = 0; k < 4; ++k) {
    put_bytes(to, 8 * k, static_cast<std::uint32_t>(cell_counts_[first_cell + k]), 4);
    put_bytes(to, 8 * k + 4, static_cast<std::uint32_t>(cell_current_counts_[first_cell + k]), 4);
  }
}

}  // namespace bms::bq
