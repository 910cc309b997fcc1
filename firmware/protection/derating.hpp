// Allowed currents: the limit by the model of the cell, ramped down before a protection opens.
//
//   allowed = lowest of (continuous limit, model's limit, ramp over voltage, ramp over temperature, ramp over soc);
//             halved by a fault that derates, 0 by a fault that forbids. Per second it decreases by at most the
//             continuous limit and increases by at most a fifth of it.
//
//   charge       highest cell  1 up to 6 % of the span below the upper limit, 0 at the limit
//                soc           1 up to 95 %, 1/5 from 100 % on
//                temperature   0 at 0 degrees C, 1 from 10; 1 up to 20 K below the upper limit, 0 from 15 K below
//   discharge    lowest cell   1 from 30 % of the span above the lower limit, 0 at the limit
//                soc           1 down to 10 %, 1/5 at 0
//                temperature   0 at the lower limit, 1 from 15 K above; 1 up to 10 K below the upper limit, 0 there
//
// The soc alone never reduces a current to 0, because it may be wrong; the last fifth is left to the voltage. Charging
// uses soc plus sigma, discharging soc minus sigma. A fault that forbids acts at once, everything else at the bounded
// rate. Without a known temperature: no charging, half of the discharging.
#pragma once

#include <algorithm>
#include <cstdint>

#include "measurement/sample.hpp"
#include "protection/pack_design.hpp"

namespace bms::protection {

/// A line between two points, constant outside; values in 1/1024.
struct Ramp {
  std::int32_t from, to;  ///< from < to
  std::int32_t at_from, at_to;

  constexpr std::int32_t at(std::int32_t value) const {
    if (value <= from) return at_from;  // avoids the 64-bit division in most samples
    if (value >= to) return at_to;
    return at_from +
           static_cast<std::int32_t>(static_cast<std::int64_t>(at_to - at_from) * (value - from) / (to - from));
  }
};

struct DeratingPlan {
  std::int32_t charge_max_ua, discharge_max_ua;
  Ramp charge_voltage, charge_cold, charge_warm, charge_soc;
  Ramp discharge_voltage, discharge_cold, discharge_warm, discharge_soc;
};

constexpr DeratingPlan derating_plan(const PackDesign& d) {
  const model::Limits& l = d.limits;
  const double span_v = l.voltage_max_v - l.voltage_min_v, freezing_c = std::max(l.temperature_min_c, 0.0);
  constexpr std::int32_t all = 1024, fifth = 205;
  return {.charge_max_ua = in_micro(l.charge_current_max_a),
          .discharge_max_ua = in_micro(l.discharge_current_max_a),
          .charge_voltage = {in_micro(l.voltage_max_v - 0.06 * span_v), in_micro(l.voltage_max_v), all, 0},
          .charge_cold = {in_centi(freezing_c), in_centi(freezing_c + 10), 0, all},
          .charge_warm = {in_centi(l.temperature_max_c - 20), in_centi(l.temperature_max_c - 15), all, 0},
          .charge_soc = {950'000'000, 1'000'000'000, all, fifth},
          .discharge_voltage = {in_micro(l.voltage_min_v), in_micro(l.voltage_min_v + 0.3 * span_v), 0, all},
          .discharge_cold = {in_centi(l.temperature_min_c), in_centi(l.temperature_min_c + 15), 0, all},
          .discharge_warm = {in_centi(l.temperature_max_c - 10), in_centi(l.temperature_max_c), all, 0},
          .discharge_soc = {0, 100'000'000, fifth, all}};
}

/// Inputs of the allowed currents; measurement::no_reading: unknown.
struct DeratingInput {
  std::int32_t highest_cell_uv = measurement::no_reading, lowest_cell_uv = measurement::no_reading;
  std::int32_t highest_cdegc = measurement::no_reading, lowest_cdegc = measurement::no_reading;
  std::int32_t soc_ppb = measurement::no_reading, soc_sigma_ppb = 0;
  std::int32_t model_charge_ua = measurement::no_reading,
               model_discharge_ua = measurement::no_reading;  ///< state of function, both >= 0
  bool derate = false, charge_forbidden = false, discharge_forbidden = false;
  bool closed = true;  ///< the contactors, for a truck or a charger
};

/// Allowed currents, both >= 0.
struct AllowedCurrent {
  std::int32_t charge_ua = 0, discharge_ua = 0;
};

class Derating {
 public:
  static constexpr std::int32_t rise_divisor = 5;

  constexpr explicit Derating(const DeratingPlan& plan) : plan_(&plan) {}

  /// step_us: time since the last call.
  constexpr AllowedCurrent update(const DeratingInput& in, std::uint32_t step_us) {
    const bool temperature_known = in.highest_cdegc != measurement::no_reading;
    std::int32_t charge = temperature_known ? 1024 : 0, discharge = temperature_known ? 1024 : 512;
    const auto lower = [](std::int32_t& share, const Ramp& ramp, std::int32_t value) {
      share = value == measurement::no_reading ? share : std::min(share, ramp.at(value));
    };
    lower(charge, plan_->charge_voltage, in.highest_cell_uv);
    lower(charge, plan_->charge_cold, in.lowest_cdegc);
    lower(charge, plan_->charge_warm, in.highest_cdegc);
    lower(discharge, plan_->discharge_voltage, in.lowest_cell_uv);
    lower(discharge, plan_->discharge_cold, in.lowest_cdegc);
    lower(discharge, plan_->discharge_warm, in.highest_cdegc);
    if (in.soc_ppb != measurement::no_reading) {
      const std::int32_t soc_ppb = std::clamp<std::int32_t>(in.soc_ppb, 0, 1'000'000'000),
                         sigma_ppb = std::clamp<std::int32_t>(in.soc_sigma_ppb, 0, 1'000'000'000);
      lower(charge, plan_->charge_soc, soc_ppb + sigma_ppb);
      lower(discharge, plan_->discharge_soc, soc_ppb - sigma_ppb);
    }
    permitted_.charge_ua =
        ramp_towards(allowed_.charge_ua, plan_->charge_max_ua, charge, in.model_charge_ua, in.derate, step_us);
    permitted_.discharge_ua = ramp_towards(allowed_.discharge_ua, plan_->discharge_max_ua, discharge,
                                           in.model_discharge_ua, in.derate, step_us);
    if (in.charge_forbidden) permitted_.charge_ua = 0;
    if (in.discharge_forbidden) permitted_.discharge_ua = 0;
    if (in.charge_forbidden || !in.closed) allowed_.charge_ua = 0;
    if (in.discharge_forbidden || !in.closed) allowed_.discharge_ua = 0;
    return allowed_;
  }

  /// What cell and faults permit now, whether or not the contactors are closed: without the bounded rate.
  constexpr const AllowedCurrent& permitted() const { return permitted_; }

 private:
  static constexpr std::int32_t part(std::int32_t ua, std::uint32_t of_2_20) {
    return static_cast<std::int32_t>((static_cast<std::int64_t>(ua) * of_2_20) >> 20);
  }
  /// Moves allowed_ua towards its target, and returns the target. share: of most_ua, in 1/1024.
  static constexpr std::int32_t ramp_towards(std::int32_t& allowed_ua, std::int32_t most_ua, std::int32_t share,
                                             std::int32_t model_ua, bool derate, std::uint32_t step_us) {
    std::int32_t target_ua = part(most_ua, static_cast<std::uint32_t>(share) << 10);
    // The model computes with 24 bits, so its limit may be some microamperes below that of the file: not derated.
    if (model_ua != measurement::no_reading && model_ua < most_ua - most_ua / 1024)
      target_ua = std::min(target_ua, std::max(model_ua, std::int32_t{0}));
    if (derate) target_ua /= 2;
    const std::int32_t down_ua =
        part(most_ua, std::min<std::uint32_t>(step_us, 1U << 20));  // 2^20 us instead of 1 s: 5 % slower
    allowed_ua = std::clamp(target_ua, allowed_ua - down_ua, allowed_ua + down_ua / rise_divisor);
    return target_ua;
  }

  const DeratingPlan* plan_;
  AllowedCurrent allowed_, permitted_;
};

}  // namespace bms::protection
