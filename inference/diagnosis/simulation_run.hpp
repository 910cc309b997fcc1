// One simulation of a record under a hypothesis, for doubles and for dual numbers: the template members of
// LikelihoodModel. Included by its sources alone.
#pragma once

#include <span>
#include <type_traits>
#include <vector>

#include "arithmetic/vector_width.hpp"
#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/mechanisms/all.hpp"
#include "diagnosis/testability.hpp"
#include "model/corrected_readings.hpp"
#include "model/start.hpp"

namespace bms::diagnosis {

/// The base parameters in a run, at the unknowns u.
template <class S>
struct AtUnknowns {
  const Calibration& calibration;
  const std::vector<double>& u;

  S initial_soc_shift(std::size_t record) const { return S(calibration.initial_soc_shift(record, u)); }
  S branch_shift(std::size_t record) const { return S(calibration.branch_shift(record, u)); }
  S capacity_loss() const { return S(calibration.capacity_loss(u)); }
  S gain_error() const { return S(calibration.gain_error(u)); }
  S offset_a(std::size_t record, double time_s) const { return S(calibration.offset_a(record, time_s, u)); }
  void adjust(model::TablePoint<S>& at, const S& soc) const { calibration.adjust(at, soc, u); }
  void before_row(model::OpenLoopSimulation<S>&) const {}
};

template <class S, class Base>
SimulationSetup<S> LikelihoodModel::setup_for(const std::vector<model::MechanismValues<S>>& values, const Hypothesis& h,
                                              const Base& base, std::size_t record) const {
  const PreparedRecording& r = records_[record];
  SimulationSetup<S> setup{.recording = r,
                           .record = record,
                           .capacity_ah = cell_.capacity_ah,
                           .bursts = {},
                           .own = false,
                           .start_soc = r.initial_soc + model::start_shift(std::span(h.settings).first(h.own)),
                           .initial_soc = S(r.initial_soc),
                           .branch_shift = base.branch_shift(record),
                           .capacity_loss = base.capacity_loss(),
                           .gain_error = base.gain_error()};
  if (record < h.bursts.size()) setup.bursts = h.bursts[record];
  setup.initial_soc += base.initial_soc_shift(record);
  for (std::size_t k = 0; k < h.settings.size(); ++k) {
    setup.own = k < h.own;
    // else the errors of an instrument would also be sought in recordings that another one has made: a contact still
    // explained what a voltmeter on the terminals had refuted
    if (reads_trusted(r.trusted_current, r.trusted_voltage, h.settings[k].index)) continue;
    model::visit_mechanism(h.settings[k].index,
                           [&]<class M>(std::type_identity<M>) { Knowledge<M>::template set_up<S>(setup, values[k]); });
  }
  setup.template choose<model::CapacityChange>({setup.capacity_loss});
  setup.template choose<model::CurrentGain>({setup.gain_error});
  return setup;
}

template <class S, class Base, class Row, class ForCheck>
void LikelihoodModel::run(const std::vector<model::MechanismValues<S>>& values, const Hypothesis& h, const Base& base,
                          std::size_t record, Row&& row, ForCheck&& check) const {
  const PreparedRecording& r = records_[record];
  const SimulationSetup<S> setup = setup_for<S>(values, h, base, record);
  const model::CorrectedReadings<S> readings(r.time_s, r.current_a, r.temperature_c, setup.current_delay_s,
                                             setup.temperature_lag_s);
  model::OpenLoopSimulation<S> simulation(tables_, cell_.capacity_ah, setup.laws, setup.initial_soc);
  const auto adjust = [&](model::TablePoint<S>& at, const S& soc) { base.adjust(at, soc); };
  arithmetic::in_widest_vectors([&] {
    for (std::size_t k = 0; k < r.size(); ++k) {
      const double duration_s = k == 0 ? 0 : r.time_s[k] - r.time_s[k - 1];
      S read_a = readings.current(k);
      if (!(read_a == S(0))) read_a -= base.offset_a(record, r.time_s[k]);  // exactly 0: as in model::CurrentOffset
      base.before_row(simulation);
      row(k, simulation.step(r.time_s[k], duration_s, read_a, readings.temperature(k), adjust), simulation);
    }
  });
  for (std::size_t j = 0; j < r.checks.size(); ++j) {
    const Check& c = r.checks[j];
    // of a current what would flow, of a voltage what would be read behind the contacts
    S at_terminals(c.reference);
    for (std::size_t k = 0; k < h.settings.size(); ++k) {
      model::visit_mechanism(h.settings[k].index, [&]<class M>(std::type_identity<M>) {
        at_terminals += Knowledge<M>::template between_terminals<S>(values[k], c, record);
      });
    }
    const S expected = c.channel == Check::Channel::current
                           ? S(setup.laws.true_current(S(c.read) - base.offset_a(record, c.time_s)) - c.reference)
                           : S(setup.laws.reading(at_terminals) - c.read);
    check(j, S(expected * (1 / c.deviation())));
  }
}

}  // namespace bms::diagnosis
