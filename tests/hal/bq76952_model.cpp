#include "tests/hal/bq76952_model.hpp"

#include <algorithm>
#include <cmath>

#include "tests/hal/thermistor.hpp"

namespace bms {

namespace {

using Register = bq::Protections::Register;

constexpr std::array simple_thermistors{ThermistorPin::ts1, ThermistorPin::ts3, ThermistorPin::hdq,
                                        ThermistorPin::cfetoff};

// Bits of Alarm Status, Alarm Raw Status and Alarm Enable (SLUUBY2B, 12.2; the same in two published headers)
constexpr std::uint16_t adscan = 1 << 1, cb = 1 << 2, xdsg = 1 << 5, xchg = 1 << 6, fullscan = 1 << 7,
                        initcomp = 1 << 9, msk_pfalert = 1 << 11, msk_sfalert = 1 << 12, pf = 1 << 13, ssa = 1 << 14,
                        ssbc = 1 << 15;
// Bits of FET_CONTROL (SLUUBY2B, table 12-29; TI confirms it in E2E 1453973, against section 5.2.3.2)
constexpr std::uint8_t dsg_off = 1 << 0, chg_off = 1 << 2;  // PDSG_OFF 1, PCHG_OFF 3
// Bits of Manufacturing Status (SLUUBY2B, 12.5)
constexpr std::uint16_t chg_test = 1 << 1, dsg_test = 1 << 2, fet_en_bit = 1 << 4, pf_en_bit = 1 << 6;

}  // namespace

Bq76952Model::Bq76952Model(const ChipVariant& variant) : needs_swap(variant.comm_type_needs_swap), variant_(variant) {
  reset();
}

/// Factory state: power-on, RESET, or the end of SHUTDOWN.
void Bq76952Model::reset() {
  memory_.reset();
  measurement_.reset();
  protections_.reset();
  checked_ = crc_from_otp;
  config_ = shutdown_ = ending_ = false;
  was_reset_ = true;
  balancing_ = 0;
  low_ = high_ = 0;
  outputs_high_ = 0;
  quarters_seen_ = 0;
  hot_s_ = 0;
  start_firmware();
}

/// After a reset and after CONFIG_UPDATE the firmware starts with the settings of the data memory.
void Bq76952Model::start_firmware() {
  const std::uint32_t init = memory_[bq::mfg_status_init];
  fet_en_ = (init & fet_en_bit) != 0;
  pf_en_ = (init & pf_en_bit) != 0;
  tests_ = 0;
  host_off_ = (memory_[bq::fet_options] & 0x20) != 0 ? 0x0F : 0;  // FET_INIT_OFF
  alarm_enable_ = static_cast<std::uint16_t>(memory_[bq::default_alarm_mask]);
  alarm_ = alarm_before_ = 0;
  measurement_.restart();
}

// ---- circuit and time ----

Bq76952Inputs Bq76952Model::simple_circuit() {
  Bq76952Inputs in;
  in.cell_v = cell_v;
  in.stack_v = in.pack_v = stack_v;
  in.ld_v = ld_v;
  in.internal_c = die_c;
  in.ts2_low = time_us >= ts2_low_from_us && time_us < ts2_low_until_us;
  in.shunt_v = current_a * shunt_mohm * 1e-3;
  for (std::size_t k = 0; k < simple_thermistors.size(); ++k) {
    if (temperature_c[k] != converted_c_[k]) {
      converted_c_[k] = temperature_c[k];
      const bool on_curve = temperature_c[k] > -70 && temperature_c[k] < 300;
      const double broken_ohm = temperature_c[k] <= -70 ? Bq76952Inputs::open_ohm : 0;
      converted_ohm_[k] = on_curve ? thermistor_ohm(temperature_c[k]) : broken_ohm;
    }
    in.thermistor_ohm[static_cast<std::size_t>(simple_thermistors[k])] =
        temperature_c[k] == 0 ? thermistor_ohm(0) : converted_ohm_[k];
  }
  return in;
}

void Bq76952Model::advance(std::uint64_t us, const Bq76952Inputs& in) {
  own_circuit_ = true;
  in_ = in;
  run_for(us);
}

void Bq76952Model::advance(std::uint64_t us) {
  if (!own_circuit_) in_ = simple_circuit();
  run_for(us);
}

void Bq76952Model::run_for(std::uint64_t us) {
  while (us > 0) {
    std::uint64_t now = std::min(us, measurement_.next_us());
    if (runs()) now = std::min(now, protections_.next_us(in_, fet_en_, pf_en_));
    step(now);
    us -= now;
  }
}

void Bq76952Model::step(std::uint64_t us) {
  const double s = 1e-6 * static_cast<double>(us);
  time_us += us;
  charge_as += in_.shunt_v / (1e-3 * shunt_mohm) * s;
  const bool hot =
      runs() && measurement_.internal_dk() >= 2'731.5 + 10 * memory_.signed_value(bq::shutdown_temperature);
  hot_s_ = hot ? hot_s_ + s : 0;
  if (hot_s_ > memory_[bq::shutdown_temperature_delay]) ending_ = true;
  if (ending_ && !in_.ts2_low && in_.ld_v < ld_high_v) {
    ending_ = false;
    shutdown_ = true;
  }
  // SHUTDOWN ends when TS2 is pulled low or LD is above its wake threshold, at most 2.25 V (SLUSE13B, 7.7)
  if (shutdown_ && (in_.ts2_low || in_.ld_v > 2.25)) reset();
  if (time_us >= balancing_until_us_ || !runs()) balancing_ = 0;
  for (std::size_t k = 0; k < 16; ++k) bled_s[k] += (balancing_ >> k & 1) != 0 ? s : 0;
  measurement_.step(us, in_, {frozen, only_cells, cc3_loses, zero_cells, stale_cells}, runs() && !gone, balancing_);
  if (runs()) {
    protections_.step(us, in_, fet_en_, pf_en_);
    if (measurement_.quarter_seconds() != quarters_seen_) {
      quarters_seen_ = measurement_.quarter_seconds();
      protections_.quarter_second();
    }
  }
  update_alarm();
}

// ---- alarms and outputs ----

std::uint16_t Bq76952Model::alarm_raw() const {
  const auto alert = [&](Register r, const bq::Setting& mask) { return (protections_.alert(r) & memory_[mask]) != 0; };
  unsigned raw = 0;
  if ((protections_.status(Register::b) | protections_.status(Register::c)) != 0) raw |= ssbc;
  if (protections_.status(Register::a) != 0) raw |= ssa;
  if (protections_.permanent_fail()) raw |= pf;
  if (alert(Register::a, bq::sf_alert_mask_a) || alert(Register::b, bq::sf_alert_mask_b) ||
      alert(Register::c, bq::sf_alert_mask_c))
    raw |= msk_sfalert;
  if ((protections_.pf_alert_a() & memory_[bq::pf_alert_mask_a]) != 0) raw |= msk_pfalert;
  if (measurement_.full_scan_done()) raw |= initcomp;
  if (protections_.turns_chg_off()) raw |= xchg;
  if (protections_.turns_dsg_off()) raw |= xdsg;
  if (balancing_ != 0) raw |= cb;
  return static_cast<std::uint16_t>(raw);
}

/// A raw bit that is enabled is latched in Alarm Status until the host writes a 1 to it (SLUUBY2B, 6.6; E2E 1026266).
void Bq76952Model::update_alarm() {
  const std::uint16_t raw = alarm_raw();
  unsigned latched = variant_.alarm_latches_on_edge ? raw & ~alarm_before_ : raw;
  if (measurement_.take_scan()) latched |= adscan;
  if (measurement_.take_full_scan()) latched |= fullscan;
  alarm_before_ = raw;
  alarm_ |= static_cast<std::uint16_t>(latched & alarm_enable_);
}

bool Bq76952Model::fet_on(bool turned_off, std::uint8_t off_bit, bool test) const {
  const bool controlled = (memory_[bq::fet_options] & 0x08) != 0;  // FET_CTRL_EN
  const bool wanted = fet_en_ ? (host_off_ & off_bit) == 0 : test;
  return controlled && runs() && wanted && !turned_off;
}

bool Bq76952Model::dsg_asserted() const {
  const bool off = protections_.turns_dsg_off();
  return off || ending_ || (config_ && variant_.config_update_asserts_pins) ||
         (variant_.pins_follow_fet_drivers && !fet_on(off, dsg_off, (tests_ & dsg_test) != 0));
}

bool Bq76952Model::chg_asserted() const {
  const bool off = protections_.turns_chg_off();
  return off || ending_ || (config_ && variant_.config_update_asserts_pins) ||
         (variant_.pins_follow_fet_drivers && !fet_on(off, chg_off, (tests_ & chg_test) != 0));
}

/// Pin configuration (SLUUBY2B, 13.3.2.11, .16 and .17; TI's FAQ E2E 1237508): bits 1:0 function, 2 own signal, 1
/// general output; bit 7 active low; bit 5 supply REG1 instead of REG18; bit 4 weak pull-up; bit 3 drives high; bit 2
/// weak pull-down. High impedance in SHUTDOWN (SLUUCF2C, DDSG and DCHG pins).
PinLevel Bq76952Model::level(const bq::Setting& config, bool asserted, unsigned output) const {
  const std::uint32_t options = memory_[config], function = options & 3;
  if (shutdown_ || function == 0 || function == 3) return PinLevel::floating;
  const bool active_low = (options & 0x80) != 0 && function == 2;
  const bool high = function == 2 ? asserted != active_low : (outputs_high_ >> output & 1) != 0;
  if (!high) return PinLevel::low;
  // REG1_EN (REG12 Config, bit 0), fed by the pre-regulator REG0_EN (REG0 Config, bit 0): SLUUBY2B, 13.3.2.2 and .3
  const bool reg1 = (memory_[bq::reg12_config] & 1) != 0 && (memory_[bq::reg0_config] & 1) != 0;
  const bool supplied = (options & 0x20) == 0 || reg1;
  if ((options & 0x08) != 0) return supplied ? PinLevel::high : PinLevel::floating;
  return (options & 0x10) != 0 && reg1 ? PinLevel::high : PinLevel::floating;
}

/// SLUUBY2B, table 12-21.
std::uint8_t Bq76952Model::fet_status() const {
  const bool chg = fet_on(protections_.turns_chg_off(), chg_off, (tests_ & chg_test) != 0);
  const bool dsg = fet_on(protections_.turns_dsg_off(), dsg_off, (tests_ & dsg_test) != 0);
  return static_cast<std::uint8_t>((chg ? 1 : 0) | (dsg ? 4 : 0) | (chg_asserted() ? 0x10 : 0) |
                                   (dsg_asserted() ? 0x20 : 0) | (alarm_ != 0 ? 0x40 : 0));
}

}  // namespace bms
