// What the model says about pulses: the currents that leave each cell, after 10 s and 30 s, between the voltages at
// which the allowed currents begin to fall (firmware/pulse_currents.hpp). It is the search of
// estimator/current_limits.hpp with these limits instead of those of the cell.
#pragma once

#include <algorithm>
#include <cstdint>

#include "firmware/pulse_currents.hpp"

namespace bms::firmware {

/// tables: where the limits of pulses are stored; otherwise those of the estimator.
template <class Tables, class Estimator, std::size_t Cells>
PulseModel pulse_model(Tables& tables, const Estimator& estimator, const Snapshot<Estimator, Cells>& now) {
  using namespace arithmetic;
  using S = typename Estimator::Scalar;
  const auto ampere = [](std::int32_t most_ua, const protection::OverloadPlan& rated) {
    const std::int64_t times_256 = std::max<std::int64_t>({256, rated.for_10s_256ths, rated.for_30s_256ths});
    return from_micro<Current<S>>(
        static_cast<std::int32_t>(std::min<std::int64_t>(most_ua * times_256 / 256, 2'000'000'000)));
  };
  const protection::DeratingPlan& d = now.plan.derating;
  tables.limits.voltage_min_v = from_micro<Voltage<S>>(d.discharge_voltage.to);
  tables.limits.voltage_max_v = from_micro<Voltage<S>>(d.charge_voltage.from);
  tables.limits.discharge_max_a = ampere(d.discharge_max_ua, now.plan.limits.discharge_overload);
  tables.limits.charge_max_a = ampere(d.charge_max_ua, now.plan.limits.charge_overload);
  // of the cells from their mean, of the model from the reading, and of both in half a minute
  constexpr std::int32_t drift_uv = 10'000;
  std::int32_t away_uv = 0;
  for (const std::int32_t uv : now.pack.cell_uv) {
    if (uv == measurement::no_reading || now.mean.voltage_uv == measurement::no_reading) return {};
    away_uv = std::max({away_uv, uv - now.mean.voltage_uv, now.mean.voltage_uv - uv});
  }
  const std::int32_t off_uv = now.mean.voltage_uv - to_micro(now.estimate.voltage_predicted_v);
  const auto margin_v =
      from_micro<Voltage<S>>(std::min(away_uv + std::max(off_uv, -off_uv) + drift_uv, std::int32_t{1'000'000}));
  const auto temperature_c = from_centi<Temperature<S>>(now.mean.temperature_cdegc);
  PulseModel found;
  for (std::size_t k = 0; k < pulse_seconds.size(); ++k) {
    const auto limits = estimator::current_limits<typename Estimator::Model>(
        tables, estimator.state().model_state, now.estimate.soc, now.estimate.soc_sigma, temperature_c,
        TimeStep<S>(static_cast<int>(pulse_seconds[k])), margin_v);
    found.limits[k] = {to_micro(limits.charge_a), to_micro(limits.discharge_a)};
  }
  return found;
}

}  // namespace bms::firmware
