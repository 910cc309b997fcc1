// Open loop: what voltage the model says for a current, with nothing measured fed back.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "model/corrected_readings.hpp"
#include "model/extended.hpp"
#include "model/one_rc.hpp"

namespace bms::host_sim {

/// A cell for the host: any number of intervals that a file may have.
template <class S>
using HostCell = model::Cell<S, model::max_intervals>;

struct SimulatedRow {
  double voltage_v;
  double soc;
};

/// Integrates the model over rows of (time_s, mean current_a since the row before) from a cell at rest at initial_soc.
/// A missing current (NaN) is taken as the last one known, as the estimator does, and soc stops at -1/4 and 5/4 as its
/// does. Row 0 has no interval before it: its voltage is the rested one plus R0 I. Rows whose time is not later repeat
/// the state.
inline std::vector<SimulatedRow> simulate(const HostCell<double>& cell, double capacity_ah,
                                          std::span<const double> time_s, std::span<const double> current_a,
                                          double initial_soc) {
  using Model = model::OneRc<double>;
  std::vector<SimulatedRow> rows(time_s.size());
  Model::State x{};
  double soc = initial_soc, known_a = 0;
  std::uint8_t interval = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double duration_s = k == 0 ? 0 : time_s[k] - time_s[k - 1];
    if (current_a[k] == current_a[k]) known_a = current_a[k];
    const model::StepInput<double> input{known_a, duration_s};
    soc = std::clamp(soc + input.current_a * duration_s / (3'600 * capacity_ah), -0.25, 1.25);
    const auto at = model::look_up(cell, soc, interval);
    if (duration_s > 0) x = Model::advance(x, at, Model::discretise(at, duration_s), input);
    rows[k] = {Model::voltage(x, at, input), soc};
  }
  return rows;
}

/// The value of one parameter of a mechanism that may be there; 0 if it is not.
inline double value_of(std::span<const model::MechanismSetting> mechanisms, std::string_view id,
                       std::size_t parameter) {
  for (const model::MechanismSetting& m : mechanisms) {
    if (model::catalogue[m.index].id == id) return m.value[parameter];
  }
  return 0;
}

/// The same with mechanisms and faults of the measuring chain, over currents and temperatures that were *measured*: the
/// voltage that *would be measured*. initial_soc is what is believed; a shift among the mechanisms is added to it.
/// temperature_c may be empty.
inline std::vector<SimulatedRow> simulate(const HostCell<double>& cell, double capacity_ah,
                                          std::span<const model::MechanismSetting> mechanisms,
                                          std::span<const double> time_s, std::span<const double> current_a,
                                          std::span<const double> temperature_c, double initial_soc) {
  if (mechanisms.empty()) return simulate(cell, capacity_ah, time_s, current_a, initial_soc);
  const model::CorrectedReadings<double> readings(time_s, current_a, temperature_c,
                                                  value_of(mechanisms, model::ChannelSkew::id, 0),
                                                  value_of(mechanisms, model::TemperatureSensor::id, 1));
  model::OpenLoopSimulation<double> simulation(cell, capacity_ah, model::chosen<double>(mechanisms, capacity_ah),
                                               initial_soc + value_of(mechanisms, model::InitialSoc::id, 0));
  std::vector<SimulatedRow> rows(time_s.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double duration_s = k == 0 ? 0 : time_s[k] - time_s[k - 1];
    const double voltage_v =
        simulation.step(time_s[k], duration_s, readings.current(k), readings.temperature(k), [](auto&, const auto&) {});
    rows[k] = {voltage_v, simulation.soc()};
  }
  return rows;
}

}  // namespace bms::host_sim
