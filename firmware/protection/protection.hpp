// Protection of a pack of cells in series: samples and estimates in, allowed actions out.
//
//   constexpr auto pack = protection_plan(design);              at compile time, for the same number of cells
//   Protection<16> protection(pack, latched);                   latched: stored by the last run
//   decision = protection.update(sample, estimate, inputs);     with every sample
//   decision = protection.without_sample(now_us);               while none arrives
//
// Order of a step: quantities of the sample, faults by the table, allowed currents, contactors, balancing. Faults that
// the contactors detect enter the table with the next sample; the contactors themselves react at once. A sample that is
// not later than the one before is ignored; five of them in a row count as missing. Until the first sample of a run
// nothing closes, and samples are missing only after the start time of the measuring chain. Bounded time, no heap,
// integers only: the same result on every core. Cost: README.md.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "measurement/pack_sample.hpp"
#include "measurement/second_line.hpp"
#include "protection/balancing.hpp"
#include "protection/contactors.hpp"
#include "protection/derating.hpp"
#include "protection/excess_charge.hpp"
#include "protection/fault_monitor.hpp"
#include "protection/inputs.hpp"
#include "protection/pack_quantities.hpp"
#include "protection/table.hpp"

namespace bms::protection {

struct ProtectionPlan {
  Rules rules;
  // Faults with this reaction, one bit each. Faults that open are also in both `forbid` masks.
  FaultSet derates, forbid_charge, forbid_discharge, open, open_now;
  PackLimits limits;
  DeratingPlan derating;
  ExcessPlan excess;
  ContactorPlan contactors;
  BalancingPlan balancing;
  std::uint8_t cells;
  std::uint32_t start_us;    ///< time limit of the first sample
  std::int32_t recovery_ua;  ///< largest charge current with severe undervoltage

  constexpr const Rule& rule(Fault f) const { return rules[static_cast<std::size_t>(f)]; }
};

constexpr ProtectionPlan protection_plan(const PackDesign& design) {
  const Rules rules = rules_of(protection_table(design));
  const FaultSet open_now = faults_with(rules, Reaction::open_now), open = faults_with(rules, Reaction::open);
  return {.rules = rules,
          .derates = faults_with(rules, Reaction::derate),
          .forbid_charge = faults_with(rules, Reaction::forbid_charge) | open | open_now,
          .forbid_discharge = faults_with(rules, Reaction::forbid_discharge) | open | open_now,
          .open = open,
          .open_now = open_now,
          .limits = pack_limits(design),
          .derating = derating_plan(design),
          .excess = excess_plan(design),
          .contactors = contactor_plan(design),
          .balancing = balancing_plan(design),
          .cells = design.cells,
          .start_us = in_us(design.start_s),
          .recovery_ua = in_micro(design.recovery_c_rate * design.capacity_ah)};
}

struct Decision {
  FaultSet faults = 0, raised = 0;  ///< active, and raised by this step
  FaultSet latched = 0;             ///< to be stored for the next start
  FirstCause first;
  ContactorState state = ContactorState::off;
  Pole welded_pole = Pole::none;  ///< found since the start, not necessarily a fault
  AuxiliaryContacts auxiliary = {};
  Outputs outputs;
  AllowedCurrent allowed;
  std::uint32_t bleed = 0;  ///< one bit per cell
  std::uint32_t bleed_left_s = 0;
};

template <std::size_t Cells>
class Protection {
 public:
  static constexpr std::uint32_t longest_step_us = 60'000'000;
  static constexpr std::uint8_t ignored_samples = 5;

  /// plan: must outlive this object. latched: Decision::latched of the last run, from storage.
  constexpr explicit Protection(const ProtectionPlan& plan, FaultSet latched = 0)
      : plan_(&plan),
        quantities_(plan.limits),
        monitor_(plan.rules, latched),
        derating_(plan.derating),
        excess_(plan.excess),
        contactors_(plan.contactors),
        balancing_(plan.balancing) {
    decision_.faults = monitor_.active();
    decision_.latched = monitor_.latched();
  }

  /// Call with every sample.
  constexpr const Decision& update(const measurement::PackSample<Cells>& sample, const PackEstimate<Cells>& estimate,
                                   const ExternalInputs& inputs) {
    decision_.raised = 0;
    second_line_ |= inputs.second_line;
    if (started_ && !is_later(sample.time_us, sample_us_)) {
      if (ignored_ < ignored_samples) ++ignored_;
      return ignored_ < ignored_samples ? decision_ : update_without_readings(elapsed_us(sample.time_us), most_age_us);
    }
    if (!has_reading(sample)) {
      clear_ = inputs.clear;
      return inputs.board_fault || inputs.supply_dip ? update_without_readings(elapsed_us(sample.time_us), 0, inputs)
                                                     : without_sample(sample.time_us);
    }
    const std::uint32_t age_us = sampled_ ? clamped(sample.time_us - sample_us_) : 0,
                        step_us = elapsed_us(sample.time_us);
    started_ = sampled_ = true;
    sample_us_ = sample.time_us;
    ignored_ = 0;
    Quantities q = unknown_quantities();
    quantities_.update(sample, step_us, q);
    at(q, Quantity::sample_age_us) = static_cast<std::int32_t>(age_us);
    update_current_quantities(q, sample.current_ua, inputs.second_current_ua);
    update_inputs(q, inputs, estimate.voltage_rejected);
    excess_.update(sample.current_ua, decision_.allowed, permitted(), !decision_.outputs.any_closed(), step_us, q);
    update_second_line(q);
    clear_ = inputs.clear;
    update_faults(q, step_us, inputs);
    const FaultSet faults = acting_faults(inputs, sample.current_ua);

    const bool temperature_unknown =
        has(faults, Fault::temperature_lost) && at(q, Quantity::highest_cdegc) == measurement::no_reading;
    const bool no_charge = (faults & plan_->forbid_charge) != 0 || temperature_unknown,
               no_discharge = (monitor_.active() & plan_->forbid_discharge) != 0;
    update_allowed_currents(q, estimate, no_charge, no_discharge, step_us);
    const std::int32_t pack_uv =
        at(q, Quantity::pack_uv) != measurement::no_reading ? at(q, Quantity::pack_uv) : quantities_.sum_uv();
    switch_contactors({.request = inputs.request,
                       .charge_forbidden = no_charge,
                       .discharge_forbidden = no_discharge,
                       .contact_lost = inputs.contact_lost,
                       .coils_dead = inputs.coils_dead,
                       .current_ua = sample.current_ua,
                       .pack_uv = pack_uv,
                       .link_plus_uv = inputs.link_plus_uv,
                       .link_minus_uv = inputs.link_minus_uv,
                       .auxiliary = inputs.auxiliary,
                       .step_us = step_us},
                      faults);
    if (!may_drive()) decision_.allowed = {};
    decision_.bleed = balancing_.update({.cell_uv = sample.cell_uv,
                                         .soc_ppb = estimate.cell_soc_ppb,
                                         .sigma_ppb = estimate.cell_sigma_ppb,
                                         .mean_soc_ppb = estimate.soc_ppb,
                                         .current_ua = sample.current_ua,
                                         .highest_cdegc = at(q, Quantity::highest_cdegc),
                                         .allowed = (monitor_.active() & (plan_->open | plan_->open_now)) == 0},
                                        step_us);
    decision_.bleed_left_s = balancing_.left_s(at(q, Quantity::lowest_cell_uv));
    return decision_;
  }

  /// Call from the loop while no sample arrives, as often as wanted. now_us: the clock of the samples.
  constexpr const Decision& without_sample(std::uint64_t now_us) {
    decision_.raised = 0;
    if (!started_) {
      started_ = true;
      sample_us_ = evaluated_us_ = now_us;
    }
    if (!is_later(now_us, sample_us_)) return decision_;
    const std::uint32_t age_us = clamped(now_us - sample_us_);
    const auto max_silence_us =
        static_cast<std::uint32_t>(plan_->rules[static_cast<std::size_t>(Fault::samples_missing)].threshold);
    return age_us <= (sampled_ ? max_silence_us : std::max(max_silence_us, plan_->start_us))
               ? decision_
               : update_without_readings(elapsed_us(now_us), static_cast<std::int32_t>(age_us));
  }

  constexpr const Decision& decision() const { return decision_; }
  constexpr const PackQuantities<Cells>& quantities() const { return quantities_; }
  /// Balancing::take_bled_ppm().
  constexpr std::int32_t take_bled_ppm(std::size_t cell) { return balancing_.take_bled_ppm(cell); }
  /// For tests of flipped bits.
  constexpr Contactors& contactors() { return contactors_; }

 private:
  static constexpr std::int32_t most_age_us = 2'000'000'000;

  static constexpr bool is_later(std::uint64_t a_us, std::uint64_t b_us) {
    return a_us - b_us - 1 < std::uint64_t{1} << 63;
  }
  static constexpr std::uint32_t clamped(std::uint64_t us) {
    return static_cast<std::uint32_t>(std::min<std::uint64_t>(us, most_age_us));
  }

  /// Returns true if at least one value was read. A sample without readings counts as missing.
  static constexpr bool has_reading(const measurement::PackSample<Cells>& s) {
    return s.current_ua != measurement::no_reading || s.pack_uv != measurement::no_reading ||
           std::any_of(s.cell_uv.begin(), s.cell_uv.end(),
                       [](std::int32_t uv) { return uv != measurement::no_reading; }) ||
           std::any_of(s.temperature_cdegc.begin(), s.temperature_cdegc.end(), [](std::int16_t cdegc) {
             return cdegc != measurement::no_temperature && cdegc != measurement::shorted_thermistor;
           });
  }

  constexpr bool may_drive() const {
    return contactors_.state() == ContactorState::drive || contactors_.state() == ContactorState::charge;
  }

  constexpr std::uint32_t elapsed_us(std::uint64_t time_us) {
    const bool forward = started_ && is_later(time_us, evaluated_us_);
    const std::uint32_t step_us = forward ? std::min(clamped(time_us - evaluated_us_), longest_step_us) : 0;
    if (forward || !started_) evaluated_us_ = time_us;
    return step_us;
  }

  /// Quantities of a known current that depend on the state of the contactors or on the second current sensor.
  constexpr void update_current_quantities(Quantities& q, std::int32_t current_ua, std::int32_t second_ua) const {
    at(q, Quantity::current_difference_ua) = current_difference_ua(plan_->limits, current_ua, second_ua);
    if (current_ua == measurement::no_reading) return;
    const std::int32_t rest_ua = plan_->contactors.rest_ua;
    const auto exceeds = [rest_ua](std::int32_t ua, std::int32_t allowed_ua) {
      return ua > 0 && ua - allowed_ua > allowed_ua / 10 + rest_ua;
    };
    at(q, Quantity::exceeds_allowed) =
        exceeds(current_ua, decision_.allowed.charge_ua) || exceeds(-current_ua, decision_.allowed.discharge_ua);
    at(q, Quantity::flows_unrequested) =
        contactors_.state() == ContactorState::unloading && magnitude(current_ua) > rest_ua;
  }

  static constexpr void update_inputs(Quantities& q, const ExternalInputs& inputs, bool voltage_rejected) {
    at(q, Quantity::estimator_contradiction) = voltage_rejected;
    at(q, Quantity::storage_failed) = inputs.storage_fault;
    if (inputs.front_end_cdegc != measurement::no_temperature)
      at(q, Quantity::front_end_cdegc) = inputs.front_end_cdegc;
    at(q, Quantity::second_currents_missing) =
        inputs.second_current_fitted && inputs.second_current_ua == measurement::no_reading;
    at(q, Quantity::loop_open) = inputs.interlock_open;
    at(q, Quantity::crashed) = inputs.crashed;
    at(q, Quantity::insulation_missing) =
        inputs.insulation_monitored && inputs.insulation_ohm == measurement::no_reading;
    at(q, Quantity::insulation_ohm) = inputs.insulation_ohm;
    if constexpr (with_group) at(q, Quantity::batteries_missing) = group_incomplete(inputs);
  }

  /// Trips since the last call. A short circuit counts as the largest current, because it may be over before a reading.
  /// A temperature is a state of the pack and not a trip: the rows of the temperatures say the same before, and a pack
  /// that is stored in the cold must not need a clear command.
  constexpr void update_second_line(Quantities& q) {
    constexpr std::uint32_t failures = measurement::permanent_failure | measurement::pins_wrong;
    at(q, Quantity::second_line_trips) =
        (second_line_ & ~(failures | measurement::short_circuit | measurement::temperature)) != 0;
    at(q, Quantity::second_line_broken) = (second_line_ & failures) != 0;
    if ((second_line_ & measurement::short_circuit) != 0)
      at(q, Quantity::current_magnitude_ua) = std::numeric_limits<std::int32_t>::max();
    second_line_ = 0;
  }

  /// Active faults whose reactions apply. After a clear command, a pack with severe undervoltage may be charged: the
  /// fault then does not open and does not forbid charging, as long as no request to drive comes and no current above
  /// twice the recovery current flows.
  constexpr FaultSet acting_faults(const ExternalInputs& inputs, std::int32_t current_ua) {
    const FaultSet faults = monitor_.active();
    const bool slow =
        current_ua != measurement::no_reading && magnitude(current_ua) / 2 <= plan_->recovery_ua;  // no overflow
    recovers_ = has(faults, Fault::cell_undervoltage_severe) && slow && inputs.request != Request::drive &&
                (recovers_ || inputs.clear != Clear::none);
    return recovers_ ? faults & ~bit(Fault::cell_undervoltage_severe) : faults;
  }

  constexpr void update_faults(Quantities& q, std::uint32_t step_us, const ExternalInputs& inputs) {
    // A plan for another number of cells is an internal fault, too.
    const bool intact = monitor_.intact() && contactors_.intact() && plan_->cells == Cells;
    if (!monitor_.intact()) monitor_.fail_safe();
    const ContactorEvents& seen = contactors_.events();
    at(q, Quantity::precharge_off_curve) = seen.precharge_failed;
    at(q, Quantity::welded) = seen.welded;
    at(q, Quantity::not_closed) = seen.not_closed;
    at(q, Quantity::integrity_error) = !intact || inputs.board_fault;
    at(q, Quantity::supply_dips) = inputs.supply_dip;
    if constexpr (Cells > 1) hold_temperatures(q);
    decision_.raised = monitor_.update(q, step_us, evaluated_us_, inputs.clear, !closed_once_);
    decision_.faults = monitor_.active();
    decision_.latched = monitor_.latched();
    decision_.first = monitor_.first();
  }

  /// While one of several temperatures is missing, its cell may be the hot or the cold one: it counts as not yet good
  /// again for the faults that are active. The other readings still raise faults.
  constexpr void hold_temperatures(Quantities& q) const {
    if (at(q, Quantity::temperatures_missing) <= 0) return;  // no_reading is less
    for (const Rule& r : plan_->rules) {
      if (!has(monitor_.active(), r.fault) || at(q, r.quantity) == measurement::no_reading) continue;
      std::int32_t& value = at(q, r.quantity);
      if (r.quantity == Quantity::highest_cdegc) value = std::max(value, r.release + 1);
      if (r.quantity == Quantity::lowest_cdegc) value = std::min(value, r.release - 1);
    }
  }

  constexpr void update_allowed_currents(const Quantities& q, const PackEstimate<Cells>& estimate, bool no_charge,
                                         bool no_discharge, std::uint32_t step_us) {
    decision_.allowed = derating_.update({.highest_cell_uv = at(q, Quantity::highest_cell_uv),
                                          .lowest_cell_uv = at(q, Quantity::lowest_cell_uv),
                                          .highest_cdegc = at(q, Quantity::highest_cdegc),
                                          .lowest_cdegc = at(q, Quantity::lowest_cdegc),
                                          .soc_ppb = estimate.soc_ppb,
                                          .soc_sigma_ppb = estimate.soc_sigma_ppb,
                                          .model_charge_ua = estimate.model_charge_ua,
                                          .model_discharge_ua = estimate.model_discharge_ua,
                                          .derate = (monitor_.active() & plan_->derates) != 0,
                                          .charge_forbidden = no_charge,
                                          .discharge_forbidden = no_discharge,
                                          .closed = may_drive()},
                                         step_us);
    if (recovers_) decision_.allowed.charge_ua = std::min(decision_.allowed.charge_ua, plan_->recovery_ua);
  }

  /// What cell and faults permit. A pack that recovers from a severe undervoltage is charged slowly.
  constexpr AllowedCurrent permitted() const {
    AllowedCurrent now = derating_.permitted();
    if (recovers_) now.charge_ua = std::min(now.charge_ua, plan_->recovery_ua);
    return now;
  }

  constexpr void switch_contactors(ContactorInput in, FaultSet faults) {
    in.open = (faults & plan_->open) != 0;
    in.open_now = (faults & plan_->open_now) != 0;
    decision_.outputs = contactors_.update(in);
    decision_.state = contactors_.state();
    decision_.welded_pole = contactors_.welded_pole();
    decision_.auxiliary = in.auxiliary;
    closed_once_ = closed_once_ || decision_.outputs.any_closed();
  }

  /// A step without a sample: all quantities but the age of the last sample are unknown.
  constexpr const Decision& update_without_readings(std::uint32_t step_us, std::int32_t age_us,
                                                    const ExternalInputs& inputs = {}) {
    Quantities q = unknown_quantities();
    at(q, Quantity::sample_age_us) = age_us;
    if (second_line_ != 0) update_second_line(q);
    update_faults(q, step_us, {.clear = clear_, .board_fault = inputs.board_fault, .supply_dip = inputs.supply_dip});
    switch_contactors({.step_us = step_us}, monitor_.active());
    decision_.allowed = derating_.update({.charge_forbidden = true, .discharge_forbidden = true}, step_us);
    decision_.bleed = 0;
    balancing_.stop();
    return decision_;
  }

  const ProtectionPlan* plan_;
  PackQuantities<Cells> quantities_;
  FaultMonitor monitor_;
  Derating derating_;
  ExcessCharge excess_;
  Contactors contactors_;
  Balancing<Cells> balancing_;
  Decision decision_;
  std::uint64_t sample_us_ = 0, evaluated_us_ = 0;
  Clear clear_ = Clear::none;
  std::uint8_t ignored_ = 0;
  std::uint32_t second_line_ = 0;  ///< trips that the table has not seen yet
  bool started_ = false, sampled_ = false, closed_once_ = false, recovers_ = false;
};

}  // namespace bms::protection
