// Currents above the continuous ones that the battery carries for 10 s and for 30 s from now: the message
// PulseCurrents, for packs whose cell file rates pulses. A truck that draws what it says for as long as it says stays
// below every limit that forbids or opens. The lowest of
//
//   overload    what fills no overload integral in this time (protection/overload.hpp): from rest the rating, and less
//               while the heat of earlier pulses is there
//   voltage     what leaves each cell, by the model, where the allowed current does not begin to fall in this time
//   charge      what leaves the state of charge there, with its sigma and four fifths of the capacity
//   short       0.95 of a short circuit
//
// At most the allowed current (protection/derating.hpp) while that is below the continuous one, within 2 K of a
// temperature at which it falls, without ratings of this direction, and while the state of charge or a temperature is
// not known: the charge above a derated current counts from its first sample (protection/excess_charge.hpp). What
// nobody can foresee, a fault or another truck's load, lowers it as it lowers the allowed current.
//
// Currents are rounded down to the step of the message. Cost: the model's limits once a second, 52 rates of the
// integrals per message.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "estimator/current_limits.hpp"
#include "firmware/cycle.hpp"
#include "firmware/messages.hpp"
#include "firmware/snapshot.hpp"
#include "hal/can.hpp"
#include "protection/protection.hpp"

namespace bms::firmware {

/// In the order of the message.
inline constexpr std::array<std::uint32_t, 2> pulse_seconds{10, 30};

/// What the model says for pulse_seconds: currents that leave the cell between the voltages at which the allowed
/// currents begin to fall. Less than the allowed current where this one would not.
struct PulseModel {
  std::array<protection::AllowedCurrent, pulse_seconds.size()> limits{};
};

/// What fills no overload integral in this time; 0: the cell file rates no pulse of this direction.
template <std::size_t Cells>
constexpr protection::AllowedCurrent carried_current(const protection::ProtectionPlan& plan,
                                                     const protection::PackQuantities<Cells>& quantities,
                                                     std::uint32_t duration_us, std::int32_t coldest_cdegc) {
  const auto current_ua = [&](const protection::OverloadIntegral& integral, const protection::OverloadPlan& rated,
                              std::int32_t most_ua) {
    if (!rated.rated()) return std::int32_t{0};
    const std::int32_t times_256 = integral.carries_256ths(rated, coldest_cdegc >= rated.from_cdegc, duration_us);
    return static_cast<std::int32_t>(
        std::min<std::int64_t>(std::int64_t{most_ua} * times_256 / 256, std::numeric_limits<std::int32_t>::max()));
  };
  return {current_ua(quantities.charge_overload(), plan.limits.charge_overload, plan.derating.charge_max_ua),
          current_ua(quantities.discharge_overload(), plan.limits.discharge_overload, plan.derating.discharge_max_ua)};
}

template <class Estimator, std::size_t Cells>
constexpr protection::AllowedCurrent pulse_current(const Snapshot<Estimator, Cells>& now,
                                                   const protection::Protection<Cells>& protection,
                                                   const protection::AllowedCurrent& of_model, std::uint32_t seconds) {
  constexpr std::int32_t margin_cdegc = 200;  // twice what 3C for 10 s warm up a cell of 280 Ah and 0.5 mohm
  const protection::DeratingPlan& derating = now.plan.derating;
  const protection::AllowedCurrent allowed = now.decision.allowed;
  std::int32_t highest = std::numeric_limits<std::int32_t>::min(), lowest = std::numeric_limits<std::int32_t>::max();
  for (std::size_t k = 0; k < now.plan.limits.temperatures; ++k) {
    if (!measurement::temperature_possible(now.pack.temperature_cdegc[k])) return allowed;
    highest = std::max<std::int32_t>(highest, now.pack.temperature_cdegc[k]);
    lowest = std::min<std::int32_t>(lowest, now.pack.temperature_cdegc[k]);
  }
  if (!now.soc_known() || !messages::is_number(now.estimate)) return allowed;
  const std::int32_t soc_ppb = messages::ppb(now.estimate.soc), off_ppb = messages::ppb(now.estimate.soc_sigma);
  const std::int64_t one_c_ua = std::int64_t{now.plan.excess.part_ua} << 14,
                     short_ua = now.plan.rule(protection::Fault::short_circuit).threshold;
  const auto by_charge_ua = [&](std::int32_t room_ppb) {  // of a battery that has lost a fifth of its capacity
    return std::max<std::int64_t>(room_ppb, 0) * one_c_ua / 1'000'000 * 2'880 / (1'000 * seconds);
  };
  const auto lowest_of = [&](std::int32_t allowed_ua, std::int32_t most_ua, std::int32_t carried_ua,
                             std::int32_t model_ua, std::int64_t charge_ua, bool warm) {
    if (allowed_ua < most_ua || carried_ua == 0 || warm) return std::min(allowed_ua, model_ua);
    return static_cast<std::int32_t>(
        std::min({std::int64_t{carried_ua}, std::int64_t{model_ua}, charge_ua, short_ua / 20 * 19}));
  };
  const protection::AllowedCurrent carried =
      carried_current(now.plan, protection.quantities(), 1'000'000 * seconds, lowest);
  return {lowest_of(allowed.charge_ua, derating.charge_max_ua, carried.charge_ua, of_model.charge_ua,
                    by_charge_ua(derating.charge_soc.from - soc_ppb - off_ppb),
                    highest + margin_cdegc > derating.charge_warm.from),
          lowest_of(allowed.discharge_ua, derating.discharge_max_ua, carried.discharge_ua, of_model.discharge_ua,
                    by_charge_ua(soc_ppb - off_ppb - derating.discharge_soc.to),
                    highest + margin_cdegc > derating.discharge_warm.from)};
}

constexpr can::PulseCurrents pulse_currents(const std::array<protection::AllowedCurrent, pulse_seconds.size()>& of) {
  constexpr std::int32_t step_ua = 250'000;
  const auto down = [](std::int32_t ua) { return 0.25F * static_cast<float>(ua / step_ua); };
  can::PulseCurrents m;
  m.discharge_ten_seconds = down(of[0].discharge_ua);
  m.discharge_thirty_seconds = down(of[1].discharge_ua);
  m.charge_ten_seconds = down(of[0].charge_ua);
  m.charge_thirty_seconds = down(of[1].charge_ua);
  return m;
}

/// Sends the message.
class PulsePublisher {
 public:
  template <class Board, class Estimator, std::size_t Cells>
  void publish(const Snapshot<Estimator, Cells>& now, const protection::Protection<Cells>& protection,
               const Estimator& estimator) {
    if (!hal::can_listening()) return;
    const auto time_us = static_cast<std::uint32_t>(now.pack.time_us);
    if (second_.due(time_us, 1'000'000)) model_ = Board::pulse_model(estimator, now);
    if (!cycle_.due(time_us, can::PulseCurrents::cycle_us)) return;
    std::array<protection::AllowedCurrent, pulse_seconds.size()> currents;
    for (std::size_t k = 0; k < currents.size(); ++k)
      currents[k] = pulse_current(now, protection, model_.limits[k], pulse_seconds[k]);
    hal::can_send(pulse_currents(currents).frame(counter_));
    counter_ = can::next(counter_);
  }

 private:
  Cycle cycle_, second_;
  PulseModel model_;
  std::uint8_t counter_ = 0;
};

}  // namespace bms::firmware
