// Data memory of the BQ76952: the settings that the model uses, with address, width and factory default.
//
// Sources, independent of the driver: tables of TI's manual SLUUBY2B, chapter 13 (the section stands at each group),
// read there or in the manuals of the sister chips with the same memory (SLUUBY1B, SLUUCG7, SLUUCF2C); addresses and
// defaults compared with three published headers: LibreSolar bms-firmware (bq769x2_registers.h), algofet_lv_bms
// (bq76952_defines.h) and a table of all defaults by section number. They agree, except for CC Gain (below) and for one
// misprint (OTC:Delay as 0x920B in two headers).
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace bms::bq {

struct Setting {
  std::uint16_t address;
  std::uint8_t bytes;
  std::uint32_t initial;  ///< factory default, as stored
};

// 13.2 Calibration. CC Gain: 7.5684 / mOhm in SLUUBY2B, 4.12; older sources have 7.4768.
constexpr Setting cc_gain{0x91A8, 4, std::bit_cast<std::uint32_t>(7.5684F)};
constexpr Setting capacity_gain{0x91AC, 4, std::bit_cast<std::uint32_t>(7.5684F * 298261.6178F)};
constexpr Setting cc_offset_samples{0x91C6, 2, 64};
constexpr Setting board_offset{0x91C8, 2, 0};
// 13.3.2 Settings:Configuration
constexpr Setting power_config{0x9234, 2, 0x2982};
constexpr Setting reg12_config{0x9236, 1, 0};
constexpr Setting reg0_config{0x9237, 1, 0};
constexpr Setting comm_type{0x9239, 1, 0};
// SLUUBY1B, Power:Shutdown: degrees C of the die, s
constexpr Setting shutdown_temperature{0x9244, 1, 85};
constexpr Setting shutdown_temperature_delay{0x9245, 1, 5};
constexpr std::uint16_t first_pin_config = 0x92FA;  ///< CFETOFF; then DFETOFF, ALERT, TS1, TS2, TS3, HDQ, DCHG, DDSG
constexpr Setting alert_pin{0x92FC, 1, 0};
constexpr Setting ts1_pin{0x92FD, 1, 0x07};
constexpr Setting dchg_pin{0x9301, 1, 0};
constexpr Setting ddsg_pin{0x9302, 1, 0};
constexpr Setting da_configuration{0x9303, 1, 0x05};
constexpr Setting vcell_mode{0x9304, 2, 0};
constexpr Setting cc3_samples{0x9307, 1, 80};
// 13.3.3 Settings:Protection
constexpr Setting protection_configuration{0x925F, 2, 0x0002};
constexpr Setting enabled_protections_a{0x9261, 1, 0x88};
constexpr Setting enabled_protections_b{0x9262, 1, 0};
constexpr Setting enabled_protections_c{0x9263, 1, 0};
constexpr Setting chg_fet_protections_a{0x9265, 1, 0x98};
constexpr Setting chg_fet_protections_b{0x9266, 1, 0xD5};
constexpr Setting chg_fet_protections_c{0x9267, 1, 0x56};
constexpr Setting dsg_fet_protections_a{0x9269, 1, 0xE4};
constexpr Setting dsg_fet_protections_b{0x926A, 1, 0xE6};
constexpr Setting dsg_fet_protections_c{0x926B, 1, 0xE2};
// 13.3.4 Settings:Alarm
constexpr Setting default_alarm_mask{0x926D, 2, 0xF800};
constexpr Setting sf_alert_mask_a{0x926F, 1, 0xFC};
constexpr Setting sf_alert_mask_b{0x9270, 1, 0xF7};
constexpr Setting sf_alert_mask_c{0x9271, 1, 0xF4};
constexpr Setting pf_alert_mask_a{0x92C4, 1, 0x5F};
// 13.3.5 Settings:Permanent Failure
constexpr Setting enabled_pf_a{0x92C0, 1, 0};
constexpr Setting enabled_pf_b{0x92C1, 1, 0};
// 13.3.6, 13.3.10 Settings:FET, Settings:Manufacturing
constexpr Setting fet_options{0x9308, 1, 0x0D};
constexpr Setting mfg_status_init{0x9343, 2, 0x0040};
// 13.3.11 Settings:Cell Balancing Config
constexpr Setting balancing_configuration{0x9335, 1, 0};
// 13.6 Protections. Voltages of cells in steps of 50.6 mV, of the shunt in 2 mV, currents in mA, times in s.
constexpr Setting cuv_threshold{0x9275, 1, 50};
constexpr Setting cuv_delay{0x9276, 2, 74};  // 3.3 ms x (2 + setting)
constexpr Setting cuv_hysteresis{0x927B, 1, 2};
constexpr Setting cov_threshold{0x9278, 1, 86};
constexpr Setting cov_delay{0x9279, 2, 74};
constexpr Setting cov_hysteresis{0x927C, 1, 2};
constexpr Setting covl_latch_limit{0x927D, 1, 0};
constexpr Setting covl_counter_dec_delay{0x927E, 1, 10};
constexpr Setting covl_recovery_time{0x927F, 1, 15};
constexpr Setting occ_threshold{0x9280, 1, 2};
constexpr Setting occ_delay{0x9281, 1, 4};
constexpr Setting occ_recovery_threshold{0x9288, 2, 0xFF38};  // -200 mA
constexpr Setting occ_pack_tos_delta{0x92B0, 2, 200};         // 10 mV
constexpr Setting ocd1_threshold{0x9282, 1, 4};
constexpr Setting ocd1_delay{0x9283, 1, 1};
constexpr Setting ocd2_threshold{0x9284, 1, 3};
constexpr Setting ocd2_delay{0x9285, 1, 7};
constexpr Setting scd_threshold{0x9286, 1, 0};
constexpr Setting scd_delay{0x9287, 1, 2};  // 15 us x (setting - 1)
constexpr Setting scd_recovery_time{0x9294, 1, 5};
constexpr Setting ocd3_threshold{0x928A, 2, 0xF060};  // -4000 userA
constexpr Setting ocd3_delay{0x928C, 1, 2};
constexpr Setting ocd_recovery_threshold{0x928D, 2, 200};
constexpr Setting ocdl_latch_limit{0x928F, 1, 0};
constexpr Setting ocdl_counter_dec_delay{0x9290, 1, 10};
constexpr Setting ocdl_recovery_time{0x9291, 1, 15};
constexpr Setting ocdl_recovery_threshold{0x9292, 2, 200};
constexpr Setting scdl_latch_limit{0x9295, 1, 0};
constexpr Setting scdl_counter_dec_delay{0x9296, 1, 10};
constexpr Setting scdl_recovery_time{0x9297, 1, 15};
constexpr Setting scdl_recovery_threshold{0x9298, 2, 200};
constexpr Setting otc_threshold{0x929A, 1, 55}, otc_delay{0x929B, 1, 2}, otc_recovery{0x929C, 1, 50};
constexpr Setting otd_threshold{0x929D, 1, 60}, otd_delay{0x929E, 1, 2}, otd_recovery{0x929F, 1, 55};
constexpr Setting otf_threshold{0x92A0, 1, 80}, otf_delay{0x92A1, 1, 2}, otf_recovery{0x92A2, 1, 65};
constexpr Setting otint_threshold{0x92A3, 1, 85}, otint_delay{0x92A4, 1, 2}, otint_recovery{0x92A5, 1, 80};
constexpr Setting utc_threshold{0x92A6, 1, 0}, utc_delay{0x92A7, 1, 2}, utc_recovery{0x92A8, 1, 5};
constexpr Setting utd_threshold{0x92A9, 1, 0}, utd_delay{0x92AA, 1, 2}, utd_recovery{0x92AB, 1, 5};
constexpr Setting utint_threshold{0x92AC, 1, 0xEC}, utint_delay{0x92AD, 1, 2}, utint_recovery{0x92AE, 1, 0xF1};
constexpr Setting recovery_time{0x92AF, 1, 3};
constexpr Setting hwd_delay{0x92B2, 2, 60};
// 13.7 Permanent Fail. Cells in mV, currents in userA, temperatures in degrees C, times in s.
constexpr Setting suv_threshold{0x92CB, 2, 2200}, suv_delay{0x92CD, 1, 5};
constexpr Setting sov_threshold{0x92CE, 2, 4500}, sov_delay{0x92D0, 1, 5};
constexpr Setting socc_threshold{0x92D4, 2, 10000}, socc_delay{0x92D6, 1, 5};
constexpr Setting socd_threshold{0x92D7, 2, 0x8300}, socd_delay{0x92D9, 1, 5};  // -32000
constexpr Setting sot_threshold{0x92DA, 1, 65}, sot_delay{0x92DB, 1, 5};
constexpr Setting sotf_threshold{0x92DC, 1, 85}, sotf_delay{0x92DD, 1, 5};

constexpr std::array all_settings{cc_gain,
                                  capacity_gain,
                                  cc_offset_samples,
                                  board_offset,
                                  power_config,
                                  reg12_config,
                                  reg0_config,
                                  comm_type,
                                  shutdown_temperature,
                                  shutdown_temperature_delay,
                                  alert_pin,
                                  ts1_pin,
                                  dchg_pin,
                                  ddsg_pin,
                                  da_configuration,
                                  vcell_mode,
                                  cc3_samples,
                                  protection_configuration,
                                  enabled_protections_a,
                                  enabled_protections_b,
                                  enabled_protections_c,
                                  chg_fet_protections_a,
                                  chg_fet_protections_b,
                                  chg_fet_protections_c,
                                  dsg_fet_protections_a,
                                  dsg_fet_protections_b,
                                  dsg_fet_protections_c,
                                  default_alarm_mask,
                                  sf_alert_mask_a,
                                  sf_alert_mask_b,
                                  sf_alert_mask_c,
                                  pf_alert_mask_a,
                                  enabled_pf_a,
                                  enabled_pf_b,
                                  fet_options,
                                  mfg_status_init,
                                  balancing_configuration,
                                  cuv_threshold,
                                  cuv_delay,
                                  cuv_hysteresis,
                                  cov_threshold,
                                  cov_delay,
                                  cov_hysteresis,
                                  covl_latch_limit,
                                  covl_counter_dec_delay,
                                  covl_recovery_time,
                                  occ_threshold,
                                  occ_delay,
                                  occ_recovery_threshold,
                                  occ_pack_tos_delta,
                                  ocd1_threshold,
                                  ocd1_delay,
                                  ocd2_threshold,
                                  ocd2_delay,
                                  scd_threshold,
                                  scd_delay,
                                  scd_recovery_time,
                                  ocd3_threshold,
                                  ocd3_delay,
                                  ocd_recovery_threshold,
                                  ocdl_latch_limit,
                                  ocdl_counter_dec_delay,
                                  ocdl_recovery_time,
                                  ocdl_recovery_threshold,
                                  scdl_latch_limit,
                                  scdl_counter_dec_delay,
                                  scdl_recovery_time,
                                  scdl_recovery_threshold,
                                  otc_threshold,
                                  otc_delay,
                                  otc_recovery,
                                  otd_threshold,
                                  otd_delay,
                                  otd_recovery,
                                  otf_threshold,
                                  otf_delay,
                                  otf_recovery,
                                  otint_threshold,
                                  otint_delay,
                                  otint_recovery,
                                  utc_threshold,
                                  utc_delay,
                                  utc_recovery,
                                  utd_threshold,
                                  utd_delay,
                                  utd_recovery,
                                  utint_threshold,
                                  utint_delay,
                                  utint_recovery,
                                  recovery_time,
                                  hwd_delay,
                                  suv_threshold,
                                  suv_delay,
                                  sov_threshold,
                                  sov_delay,
                                  socc_threshold,
                                  socc_delay,
                                  socd_threshold,
                                  socd_delay,
                                  sot_threshold,
                                  sot_delay,
                                  sotf_threshold,
                                  sotf_delay};

/// The data memory itself. A byte without a setting above is 0 after a reset and keeps what is written.
class Memory {
 public:
  static constexpr std::uint16_t first = 0x9180, last = 0x93FF;

  Memory() { reset(); }
  void reset() {
    bytes_ = {};
    for (const Setting& s : all_settings) write(s.address, s.bytes, s.initial);
  }
  std::uint32_t read(std::uint16_t address, std::size_t bytes) const {
    std::uint32_t value = 0;
    for (std::size_t k = 0; k < bytes; ++k) value |= static_cast<std::uint32_t>(byte(address + k)) << 8 * k;
    return value;
  }
  void write(std::uint16_t address, std::size_t bytes, std::uint32_t value) {
    for (std::size_t k = 0; k < bytes; ++k) {
      if (address + k >= first && address + k <= last)
        bytes_[address + k - first] = static_cast<std::uint8_t>(value >> 8 * k);
    }
  }
  std::uint32_t operator[](const Setting& s) const { return read(s.address, s.bytes); }
  /// A setting of type I1 or I2.
  int signed_value(const Setting& s) const {
    const std::uint32_t value = (*this)[s];
    return s.bytes == 1 ? static_cast<std::int8_t>(value) : static_cast<std::int16_t>(value);
  }
  double real(const Setting& s) const { return static_cast<double>(std::bit_cast<float>((*this)[s])); }
  void set(const Setting& s, std::uint32_t value) { write(s.address, s.bytes, value); }

 private:
  std::uint8_t byte(std::size_t address) const {
    return address >= first && address <= last ? bytes_[address - first] : std::uint8_t{0};
  }
  std::array<std::uint8_t, last - first + 1> bytes_{};
};

}  // namespace bms::bq
