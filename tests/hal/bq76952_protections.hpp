// The protections of the BQ76952 model: alerts, faults and their recovery, latches, permanent failures, and which of
// the two FETs (and of the outputs DSG and CHG) each of them turns off.
//
// All times are exact: step() is called up to the next instant at which a timer ends (next_us()), so a short circuit of
// 100 us is seen whatever the time step of the caller. The inputs are constant during a step.
#pragma once

#include <array>
#include <cstdint>

#include "tests/hal/bq76952_circuit.hpp"
#include "tests/hal/bq76952_measurement.hpp"
#include "tests/hal/bq76952_memory.hpp"

namespace bms::bq {

/// Bits of Safety Alert, Safety Status, Enabled Protections and FET Protections (SLUUBY2B, 12.2 and 13.3.3; the same in
/// LibreSolar's bq769x2_registers.h). Register A:
inline constexpr std::uint8_t cuv = 1 << 2, cov = 1 << 3, occ = 1 << 4, ocd1 = 1 << 5, ocd2 = 1 << 6, scd = 1 << 7;
/// Register B:
inline constexpr std::uint8_t utc = 1 << 0, utd = 1 << 1, utint = 1 << 2, otc = 1 << 4, otd = 1 << 5, otint = 1 << 6,
                              otf = 1 << 7;
/// Register C:
inline constexpr std::uint8_t hwdf = 1 << 1, covl = 1 << 4, ocdl = 1 << 5, scdl = 1 << 6, ocd3 = 1 << 7;
/// PF Status A (SLUUBY2B, 12.2), and the bit of PF Status B and C that the model has:
inline constexpr std::uint8_t pf_suv = 1 << 0, pf_sov = 1 << 1, pf_socc = 1 << 2, pf_socd = 1 << 3, pf_sot = 1 << 4,
                              pf_sotf = 1 << 6;
inline constexpr std::uint8_t pf_scdl = 1 << 7, pf_cmdf = 1 << 7;

class Protections {
 public:
  Protections(const Memory& memory, const ChipVariant& variant, const Measurement& measured)
      : memory_(memory), variant_(variant), measured_(measured) {}

  void reset();
  std::uint64_t next_us(const Bq76952Inputs& in, bool fet_en, bool pf_en) const;
  void step(std::uint64_t us, const Bq76952Inputs& in, bool fet_en, bool pf_en);
  void communicated();          ///< a valid transfer from the host
  void recover_ocdl();          ///< subcommand OCDL_RECOVER
  void recover_scdl();          ///< subcommand SCDL_RECOVER
  void force_permanent_fail();  ///< PF_FORCE_A and PF_FORCE_B
  void quarter_second();        ///< FETs whose setting does not act at once are updated

  enum Register { a, b, c };
  std::uint8_t alert(Register r) const { return alert_[r]; }
  std::uint8_t status(Register r) const { return status_[r]; }
  std::uint8_t pf_alert_a() const { return pf_alert_a_; }
  std::uint8_t pf_status(std::size_t which) const { return pf_status_[which]; }
  bool permanent_fail() const { return (pf_status_[0] | pf_status_[1] | pf_status_[2]) != 0; }
  bool turns_chg_off() const;
  bool turns_dsg_off() const;

 private:
  struct Context {
    const Memory& memory;
    const Measurement& measured;
    const Bq76952Inputs& in;
  };
  struct Rule;
  struct Latch;
  struct Timers {
    std::uint64_t exceeded_us = 0, recovered_us = 0;
  };
  struct Counter {
    unsigned value = 0;
    std::uint64_t quiet_us = 0, recovered_us = 0;
  };
  static const std::array<Rule, 14> rules;
  static const std::array<Rule, 6> permanent_rules;
  static const std::array<Latch, 3> latches;

  bool enabled(const Rule& rule) const;
  bool recovery_runs(const Rule& rule, bool fet_en) const;
  void step_rules(std::uint64_t us, const Context& context, bool fet_en);
  void step_permanent(std::uint64_t us, const Context& context, bool pf_en);
  void step_latches(std::uint64_t us, const Context& context, bool fet_en);
  void tripped(const Rule& rule);
  void act();

  const Memory& memory_;
  const ChipVariant& variant_;
  const Measurement& measured_;
  std::array<std::uint8_t, 3> alert_{}, status_{};
  std::array<Timers, 14> timers_{};
  std::array<Timers, 6> permanent_timers_{};
  std::array<Counter, 3> counters_{};
  std::uint8_t pf_alert_a_ = 0;
  std::array<std::uint8_t, 3> pf_status_{};
  std::uint64_t host_silent_us_ = 0;
  std::uint8_t acts_chg_ = 0, acts_dsg_ = 0;  ///< faults of register A that the FETs have been turned off for
};

}  // namespace bms::bq
