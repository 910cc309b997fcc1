#include "tests/hal/bq76952_protections.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace bms::bq {

namespace {

constexpr std::uint64_t never = std::numeric_limits<std::uint64_t>::max();
constexpr double cell_step_v = 0.0506, shunt_step_v = 0.002;

/// Protections act on the cells of Vcell Mode, on all if it is 0 (SLUUCF2C and SLUUBY2B, 13.3.2.19).
std::pair<double, double> range_of_cells(const Memory& memory, const Bq76952Inputs& in) {
  const std::uint32_t mode = memory[vcell_mode];
  std::pair<double, double> range{1e3, -1e3};
  for (std::size_t k = 0; k < in.cell_v.size(); ++k) {
    if (mode != 0 && (mode >> k & 1) == 0) continue;
    range = {std::min(range.first, in.cell_v[k]), std::max(range.second, in.cell_v[k])};
  }
  return range;
}
double min_cell_v(const Memory& memory, const Bq76952Inputs& in) { return range_of_cells(memory, in).first; }
double max_cell_v(const Memory& memory, const Bq76952Inputs& in) { return range_of_cells(memory, in).second; }
std::uint64_t seconds(std::uint32_t s) { return 1'000'000ULL * s; }
/// 3.3 ms x (2 + setting); 0 disables the protection.
std::uint64_t comparator_us(std::uint32_t setting) { return setting == 0 ? never : 3'300ULL * (2 + setting); }
/// Temperature settings are in degrees C, measurements in 0.1 K.
int decikelvin_of(int celsius) { return 10 * celsius + 2'732; }
std::uint64_t remaining(std::uint64_t end_us, std::uint64_t us) {
  if (end_us == never) return never;
  return end_us > us ? end_us - us : 0;
}

}  // namespace

/// A protection: when it triggers, after which time, when it recovers, after which time.
struct Protections::Rule {
  Register where;
  std::uint8_t bit;
  bool (*exceeded)(const Context&);
  std::uint64_t (*delay_us)(const Memory&);
  bool (*recovered)(const Context&);
  std::uint64_t (*recovery_us)(const Memory&);
};

/// A latch counts the faults of `source`; the C register has its bit.
struct Protections::Latch {
  Register source_register;
  std::uint8_t source, bit;
  Setting limit, decrement, recovery_time;
  bool (*recovered)(const Context&);
};

namespace {

/// Mean current of 250 ms is at least this setting [mA].
bool current_at_least(const Memory& memory, const Measurement& measured, const Setting& threshold) {
  return measured.cc1_ma() >= memory.signed_value(threshold);
}

std::uint64_t common_recovery_us(const Memory& m) { return seconds(m[recovery_time]); }

}  // namespace

// SLUUBY2B, 5.2 (read there: COV, OCC, PTO; in the same words in SLUUCF2C and SLUUCG7: CUV, SCD, HWD). OCD1 and OCD2
// use the comparators of OCC with the other sign; recovery by OCD:Recovery Threshold, SLUUBY1B, 13.6. The mean current
// is CC1.
const std::array<Protections::Rule, 14> Protections::rules{{
    {a, cuv, [](const Context& x) { return min_cell_v(x.memory, x.in) <= cell_step_v * x.memory[cuv_threshold]; },
     [](const Memory& m) { return comparator_us(m[cuv_delay]); },
     [](const Context& x) {
       return min_cell_v(x.memory, x.in) >= cell_step_v * (x.memory[cuv_threshold] + x.memory[cuv_hysteresis]);
     },
     common_recovery_us},
    {a, cov, [](const Context& x) { return max_cell_v(x.memory, x.in) > cell_step_v * x.memory[cov_threshold]; },
     [](const Memory& m) { return comparator_us(m[cov_delay]); },
     [](const Context& x) {
       return max_cell_v(x.memory, x.in) <= cell_step_v * (x.memory[cov_threshold] - x.memory[cov_hysteresis]);
     },
     common_recovery_us},
    {a, occ, [](const Context& x) { return x.in.shunt_v > shunt_step_v * x.memory[occ_threshold]; },
     [](const Memory& m) { return comparator_us(m[occ_delay]); },
     [](const Context& x) {
       return x.in.pack_v <= x.in.stack_v - 0.01 * x.memory.signed_value(occ_pack_tos_delta) ||
              x.measured.cc1_ma() <= x.memory.signed_value(occ_recovery_threshold);
     },
     common_recovery_us},
    {a, ocd1, [](const Context& x) { return -x.in.shunt_v > shunt_step_v * x.memory[ocd1_threshold]; },
     [](const Memory& m) { return comparator_us(m[ocd1_delay]); },
     [](const Context& x) { return current_at_least(x.memory, x.measured, ocd_recovery_threshold); },
     common_recovery_us},
    {a, ocd2, [](const Context& x) { return -x.in.shunt_v > shunt_step_v * x.memory[ocd2_threshold]; },
     [](const Memory& m) { return comparator_us(m[ocd2_delay]); },
     [](const Context& x) { return current_at_least(x.memory, x.measured, ocd_recovery_threshold); },
     common_recovery_us},
    // Thresholds SLUUCF2C and LibreSolar; delay SLUUBY1B, 13.6.7: 1 means without delay, else (n - 1) x 15 us
    {a, scd,
     [](const Context& x) {
       constexpr std::array<double, 16> mv{10, 20, 40, 60, 80, 100, 125, 150, 175, 200, 250, 300, 350, 400, 450, 500};
       return -x.in.shunt_v > 1e-3 * mv[x.memory[scd_threshold] & 15];
     },
     [](const Memory& m) { return m[scd_delay] == 0 ? never : std::uint64_t{15} * (m[scd_delay] - 1); },
     [](const Context&) { return true; }, [](const Memory& m) { return seconds(m[scd_recovery_time]); }},
    {c, ocd3,
     [](const Context& x) {
       return x.measured.cc1_ma() <= x.measured.user_ma() * x.memory.signed_value(ocd3_threshold);
     },
     [](const Memory& m) { return seconds(m[ocd3_delay]); },
     [](const Context& x) { return current_at_least(x.memory, x.measured, ocd_recovery_threshold); },
     common_recovery_us},
    {b, otc,
     [](const Context& x) { return x.measured.max_cell_dk() >= decikelvin_of(x.memory.signed_value(otc_threshold)); },
     [](const Memory& m) { return seconds(m[otc_delay]); },
     [](const Context& x) { return x.measured.max_cell_dk() <= decikelvin_of(x.memory.signed_value(otc_recovery)); },
     common_recovery_us},
    {b, otd,
     [](const Context& x) { return x.measured.max_cell_dk() >= decikelvin_of(x.memory.signed_value(otd_threshold)); },
     [](const Memory& m) { return seconds(m[otd_delay]); },
     [](const Context& x) { return x.measured.max_cell_dk() <= decikelvin_of(x.memory.signed_value(otd_recovery)); },
     common_recovery_us},
    {b, otf,
     [](const Context& x) { return x.measured.fet_dk() >= decikelvin_of(static_cast<int>(x.memory[otf_threshold])); },
     [](const Memory& m) { return seconds(m[otf_delay]); },
     [](const Context& x) { return x.measured.fet_dk() <= decikelvin_of(static_cast<int>(x.memory[otf_recovery])); },
     common_recovery_us},
    {b, otint,
     [](const Context& x) { return x.measured.internal_dk() >= decikelvin_of(x.memory.signed_value(otint_threshold)); },
     [](const Memory& m) { return seconds(m[otint_delay]); },
     [](const Context& x) { return x.measured.internal_dk() <= decikelvin_of(x.memory.signed_value(otint_recovery)); },
     common_recovery_us},
    {b, utc,
     [](const Context& x) { return x.measured.min_cell_dk() <= decikelvin_of(x.memory.signed_value(utc_threshold)); },
     [](const Memory& m) { return seconds(m[utc_delay]); },
     [](const Context& x) { return x.measured.min_cell_dk() >= decikelvin_of(x.memory.signed_value(utc_recovery)); },
     common_recovery_us},
    {b, utd,
     [](const Context& x) { return x.measured.min_cell_dk() <= decikelvin_of(x.memory.signed_value(utd_threshold)); },
     [](const Memory& m) { return seconds(m[utd_delay]); },
     [](const Context& x) { return x.measured.min_cell_dk() >= decikelvin_of(x.memory.signed_value(utd_recovery)); },
     common_recovery_us},
    {b, utint,
     [](const Context& x) { return x.measured.internal_dk() <= decikelvin_of(x.memory.signed_value(utint_threshold)); },
     [](const Memory& m) { return seconds(m[utint_delay]); },
     [](const Context& x) { return x.measured.internal_dk() >= decikelvin_of(x.memory.signed_value(utint_recovery)); },
     common_recovery_us},
}};

// SLUUBY2B, 13.7, and SLUUCG7, 13.7 (SUV: less than or equal): measured values, for a time in s, without recovery.
const std::array<Protections::Rule, 6> Protections::permanent_rules{{
    {a, pf_suv,
     [](const Context& x) { return 1e3 * min_cell_v(x.memory, x.in) <= x.memory.signed_value(suv_threshold); },
     [](const Memory& m) { return seconds(m[suv_delay]); }, nullptr, nullptr},
    {a, pf_sov,
     [](const Context& x) { return 1e3 * max_cell_v(x.memory, x.in) >= x.memory.signed_value(sov_threshold); },
     [](const Memory& m) { return seconds(m[sov_delay]); }, nullptr, nullptr},
    {a, pf_socc,
     [](const Context& x) {
       return x.measured.cc1_ma() >= x.measured.user_ma() * x.memory.signed_value(socc_threshold);
     },
     [](const Memory& m) { return seconds(m[socc_delay]); }, nullptr, nullptr},
    {a, pf_socd,
     [](const Context& x) {
       return x.measured.cc1_ma() <= x.measured.user_ma() * x.memory.signed_value(socd_threshold);
     },
     [](const Memory& m) { return seconds(m[socd_delay]); }, nullptr, nullptr},
    {a, pf_sot,
     [](const Context& x) { return x.measured.max_cell_dk() >= decikelvin_of(x.memory.signed_value(sot_threshold)); },
     [](const Memory& m) { return seconds(m[sot_delay]); }, nullptr, nullptr},
    {a, pf_sotf,
     [](const Context& x) { return x.measured.fet_dk() >= decikelvin_of(static_cast<int>(x.memory[sotf_threshold])); },
     [](const Memory& m) { return seconds(m[sotf_delay]); }, nullptr, nullptr},
}};

// SLUUBY2B, 5.2 (COVL), SLUUCF2C, 6.2 (SCDL): each fault of the source counts; a counter that is not 0 decreases after
// Counter Dec Delay without a further fault. Recovery by current: SLUUBY1B, 13.6, Protection Configuration bits 9
// and 10.
const std::array<Protections::Latch, 3> Protections::latches{{
    {a, cov, covl, covl_latch_limit, covl_counter_dec_delay, covl_recovery_time,
     [](const Context& x) {
       return max_cell_v(x.memory, x.in) <= cell_step_v * (x.memory[cov_threshold] - x.memory[cov_hysteresis]);
     }},
    {a, ocd1 | ocd2, ocdl, ocdl_latch_limit, ocdl_counter_dec_delay, ocdl_recovery_time,
     [](const Context& x) {
       return (x.memory[protection_configuration] >> 9 & 1) != 0 &&
              current_at_least(x.memory, x.measured, ocdl_recovery_threshold);
     }},
    {a, scd, scdl, scdl_latch_limit, scdl_counter_dec_delay, scdl_recovery_time,
     [](const Context& x) {
       return (x.memory[protection_configuration] >> 10 & 1) != 0 &&
              current_at_least(x.memory, x.measured, scdl_recovery_threshold);
     }},
}};

void Protections::reset() {
  alert_ = status_ = {};
  timers_ = {};
  permanent_timers_ = {};
  counters_ = {};
  pf_alert_a_ = 0;
  pf_status_ = {};  // without PF_OTP the status is lost by a reset (SLUUBY2B, 13.3.3.1)
  host_silent_us_ = 0;
  acts_chg_ = acts_dsg_ = 0;
}

bool Protections::enabled(const Rule& rule) const {
  const std::array settings{enabled_protections_a, enabled_protections_b, enabled_protections_c};
  if ((memory_[settings[rule.where]] & rule.bit) == 0) return false;
  // Temperatures count once they have been measured; the protections by cell temperature need a thermistor.
  if (rule.where != b) return true;
  if (!measured_.full_scan_done()) return false;
  if ((rule.bit & (otc | otd | utc | utd)) != 0) return measured_.has_cell_temperature();
  return rule.bit != otf || measured_.fet_dk() >= 0;
}

bool Protections::recovery_runs(const Rule& rule, bool fet_en) const {
  return (status_[rule.where] & rule.bit) != 0 && (fet_en || !variant_.recovers_only_with_fet_en);
}

std::uint64_t Protections::next_us(const Bq76952Inputs& in, bool fet_en, bool pf_en) const {
  const Context context{memory_, measured_, in};
  std::uint64_t next = never;
  for (std::size_t k = 0; k < rules.size(); ++k) {
    const Rule& rule = rules[k];
    if (recovery_runs(rule, fet_en) && rule.recovered(context))
      next = std::min(next, remaining(rule.recovery_us(memory_), timers_[k].recovered_us));
    else if ((status_[rule.where] & rule.bit) == 0 && enabled(rule) && rule.exceeded(context))
      next = std::min(next, remaining(rule.delay_us(memory_), timers_[k].exceeded_us));
  }
  for (std::size_t k = 0; k < permanent_rules.size() && pf_en; ++k) {
    const Rule& rule = permanent_rules[k];
    if ((memory_[enabled_pf_a] & rule.bit) != 0 && (pf_status_[0] & rule.bit) == 0 && rule.exceeded(context))
      next = std::min(next, remaining(rule.delay_us(memory_), permanent_timers_[k].exceeded_us));
  }
  for (std::size_t k = 0; k < latches.size(); ++k) {
    const Latch& latch = latches[k];
    if ((status_[c] & latch.bit) != 0 && latch.recovered(context))
      next = std::min(next, remaining(seconds(memory_[latch.recovery_time]), counters_[k].recovered_us));
    if (counters_[k].value > 0 && (status_[c] & latch.bit) == 0 && (status_[latch.source_register] & latch.source) == 0)
      next = std::min(next, remaining(seconds(memory_[latch.decrement]), counters_[k].quiet_us));
  }
  if ((memory_[enabled_protections_c] & hwdf) != 0 && (status_[c] & hwdf) == 0)
    next = std::min(next, remaining(seconds(memory_[hwd_delay]), host_silent_us_));
  return std::max<std::uint64_t>(next, 1);
}

void Protections::step(std::uint64_t us, const Bq76952Inputs& in, bool fet_en, bool pf_en) {
  const Context context{memory_, measured_, in};
  host_silent_us_ += us;
  if ((memory_[enabled_protections_c] & hwdf) != 0 && host_silent_us_ >= seconds(memory_[hwd_delay]))
    status_[c] |= hwdf;  // there is no alert for it (SLUUCF2C, 6.2)
  step_rules(us, context, fet_en);
  step_latches(us, context, fet_en);
  step_permanent(us, context, pf_en);
  act();
}

void Protections::step_rules(std::uint64_t us, const Context& context, bool fet_en) {
  for (std::size_t k = 0; k < rules.size(); ++k) {
    const Rule& rule = rules[k];
    Timers& timers = timers_[k];
    if ((status_[rule.where] & rule.bit) != 0) {
      timers.recovered_us = recovery_runs(rule, fet_en) && rule.recovered(context) ? timers.recovered_us + us : 0;
      if (timers.recovered_us > 0 && timers.recovered_us >= rule.recovery_us(memory_)) {
        status_[rule.where] &= static_cast<std::uint8_t>(~rule.bit);
        timers = {};
      }
      continue;
    }
    const bool exceeded = enabled(rule) && rule.exceeded(context);
    timers.exceeded_us = exceeded ? timers.exceeded_us + us : 0;
    alert_[rule.where] = static_cast<std::uint8_t>((alert_[rule.where] & ~rule.bit) | (exceeded ? rule.bit : 0));
    if (exceeded && timers.exceeded_us >= rule.delay_us(memory_)) tripped(rule);
  }
}

void Protections::tripped(const Rule& rule) {
  status_[rule.where] |= rule.bit;
  alert_[rule.where] &= static_cast<std::uint8_t>(~rule.bit);
  for (std::size_t k = 0; k < latches.size(); ++k) {
    const Latch& latch = latches[k];
    if ((memory_[enabled_protections_c] & latch.bit) == 0) continue;
    const bool counts = (rule.where == latch.source_register && (rule.bit & latch.source) != 0) ||
                        (latch.bit == ocdl && rule.where == c && rule.bit == ocd3);
    if (!counts) continue;
    const std::uint32_t limit = memory_[latch.limit];
    ++counters_[k].value;
    counters_[k].quiet_us = 0;
    if (limit == 0 ? !variant_.latch_limit_zero_latches : counters_[k].value < limit) continue;
    status_[c] |= latch.bit;
    counters_[k].recovered_us = 0;
    if (latch.bit == scdl) pf_status_[1] |= static_cast<std::uint8_t>(memory_[enabled_pf_b] & pf_scdl);
  }
}

void Protections::step_latches(std::uint64_t us, const Context& context, bool fet_en) {
  for (std::size_t k = 0; k < latches.size(); ++k) {
    const Latch& latch = latches[k];
    Counter& counter = counters_[k];
    if ((status_[c] & latch.bit) != 0) {
      const bool runs = (fet_en || !variant_.recovers_only_with_fet_en) && latch.recovered(context);
      counter.recovered_us = runs ? counter.recovered_us + us : 0;
      if (runs && counter.recovered_us >= seconds(memory_[latch.recovery_time])) {
        status_[c] &= static_cast<std::uint8_t>(~latch.bit);
        counter = {};
      }
    } else if (counter.value > 0 && (status_[latch.source_register] & latch.source) == 0) {
      counter.quiet_us += us;
      if (counter.quiet_us >= seconds(memory_[latch.decrement])) {
        --counter.value;
        counter.quiet_us = 0;
      }
    }
    const bool alert = counter.value > 0 && (status_[c] & latch.bit) == 0;
    alert_[c] = static_cast<std::uint8_t>((alert_[c] & ~latch.bit) | (alert ? latch.bit : 0));
  }
}

void Protections::step_permanent(std::uint64_t us, const Context& context, bool pf_en) {
  for (std::size_t k = 0; k < permanent_rules.size(); ++k) {
    const Rule& rule = permanent_rules[k];
    const bool exceeded = pf_en && (memory_[enabled_pf_a] & rule.bit) != 0 && (pf_status_[0] & rule.bit) == 0 &&
                          measured_.full_scan_done() && rule.exceeded(context);
    permanent_timers_[k].exceeded_us = exceeded ? permanent_timers_[k].exceeded_us + us : 0;
    const bool trips = exceeded && permanent_timers_[k].exceeded_us >= rule.delay_us(memory_);
    if (trips) pf_status_[0] |= rule.bit;
    pf_alert_a_ = static_cast<std::uint8_t>((pf_alert_a_ & ~rule.bit) | (exceeded && !trips ? rule.bit : 0));
  }
}

void Protections::communicated() {
  host_silent_us_ = 0;
  status_[c] &= static_cast<std::uint8_t>(~hwdf);
}

void Protections::recover_ocdl() {
  status_[c] &= static_cast<std::uint8_t>(~ocdl);
  counters_[1] = {};
}

void Protections::recover_scdl() {
  status_[c] &= static_cast<std::uint8_t>(~scdl);
  counters_[2] = {};
}

void Protections::force_permanent_fail() { pf_status_[2] |= pf_cmdf; }

// ---- FETs ----

/// SLUUBY2B, 13.3.3.5 and 13.3.3.8: register A acts at once only with the values 0x98 or 0x18 (CHG) and 0x80 or 0xE4
/// (DSG); with others up to 250 ms later.
void Protections::act() {
  const std::uint32_t chg = memory_[chg_fet_protections_a], dsg = memory_[dsg_fet_protections_a];
  const auto now = [&](std::uint8_t& acts, std::uint32_t mask, bool at_once) {
    const auto faults = static_cast<std::uint8_t>(status_[a] & mask);
    acts = at_once ? faults : static_cast<std::uint8_t>(acts & faults);
  };
  now(acts_chg_, chg, chg == 0x98 || chg == 0x18);
  now(acts_dsg_, dsg, dsg == 0x80 || dsg == 0xE4);
}

void Protections::quarter_second() {
  acts_chg_ = static_cast<std::uint8_t>(status_[a] & memory_[chg_fet_protections_a]);
  acts_dsg_ = static_cast<std::uint8_t>(status_[a] & memory_[dsg_fet_protections_a]);
}

bool Protections::turns_chg_off() const {
  return acts_chg_ != 0 || (status_[b] & memory_[chg_fet_protections_b]) != 0 ||
         (status_[c] & memory_[chg_fet_protections_c]) != 0 ||
         (permanent_fail() && (memory_[protection_configuration] & 2) != 0);
}

bool Protections::turns_dsg_off() const {
  return acts_dsg_ != 0 || (status_[b] & memory_[dsg_fet_protections_b]) != 0 ||
         (status_[c] & memory_[dsg_fet_protections_c]) != 0 ||
         (permanent_fail() && (memory_[protection_configuration] & 2) != 0);
}

}  // namespace bms::bq
