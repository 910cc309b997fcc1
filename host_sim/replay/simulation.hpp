// Open-loop simulation: the voltage that the model predicts for a current, without feedback of a measured voltage.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "model/corrected_readings.hpp"
#include "model/extended.hpp"
#include "model/one_rc.hpp"
#include "model/start.hpp"

namespace bms::replay {

/// A cell for the host: with as many intervals as a cell file may have.
template <class S>
using HostCell = model::Cell<S, model::max_intervals>;

struct SimulatedRow {
  double voltage_v;
  double soc;
};

/// Row k: current_a is the mean over the interval that ends at time_s (> 0 charges).
struct SimulationInput {
  const HostCell<double>& cell;
  double capacity_ah = 0;
  std::span<const model::MechanismSetting> mechanisms = {};  ///< effects and sensor faults of the cell file
  std::span<const double> time_s, current_a;
  std::span<const double> temperature_c = {};  ///< empty: unknown
  double initial_soc = 0;                      ///< as assumed by the user
};

/// The value of one parameter of a mechanism; 0 if the mechanism is not among them.
inline double value_of(std::span<const model::MechanismSetting> mechanisms, std::string_view id,
                       std::size_t parameter) {
  for (const model::MechanismSetting& m : mechanisms) {
    if (model::catalogue[m.index].id == id) return m.value[parameter];
  }
  return 0;
}

/// The 1RC model alone. model::OpenLoopSimulation without laws rounds the charge differently (duration times
/// 1 / capacity instead of a quotient), so this loop is needed for the bits of a cell file without mechanisms.
template <class Take>
void simulate_one_rc(const SimulationInput& in, Take&& take) {
  using Model = model::OneRc<double>;
  Model::State x{};
  double soc = in.initial_soc, last_known_a = 0;
  std::uint8_t interval = 0;
  for (std::size_t k = 0; k < in.time_s.size(); ++k) {
    const double duration_s = k == 0 ? 0 : in.time_s[k] - in.time_s[k - 1];
    if (!std::isnan(in.current_a[k])) last_known_a = in.current_a[k];
    const model::StepInput<double> input{last_known_a, duration_s};
    soc = std::clamp(soc + input.current_a * duration_s / (3'600 * in.capacity_ah), model::min_soc, model::max_soc);
    const auto at = model::look_up(in.cell, soc, interval);
    if (duration_s > 0) x = Model::advance(x, at, Model::discretise(at, duration_s), input);
    take(SimulatedRow{Model::voltage(x, at, input), soc});
  }
}

/// Simulates a cell that rests at initial_soc before the first row (model/start.hpp), and calls take(SimulatedRow) for
/// each row. With mechanisms and sensor faults, current and temperature are as measured, and the result is the voltage
/// that would be measured; the mechanism initial_soc is added to the start.
///
/// A missing current (NaN) is replaced by the last known one. soc is clamped to model::min_soc .. model::max_soc, as in
/// the estimator. Row 0 has no interval before it: its voltage is that of the rested cell plus R0 I. A row whose time
/// is not later than the previous one repeats the state.
template <class Take>
void simulate(const SimulationInput& in, Take&& take) {
  if (in.mechanisms.empty()) return simulate_one_rc(in, take);
  const model::CorrectedReadings<double> readings(in.time_s, in.current_a, in.temperature_c,
                                                  value_of(in.mechanisms, model::ChannelSkew::id, 0),
                                                  value_of(in.mechanisms, model::TemperatureSensor::id, 1));
  const double soc = in.initial_soc + model::start_shift(in.mechanisms);
  model::OpenLoopSimulation<double> simulation(in.cell, in.capacity_ah,
                                               model::laws_at_start<double>(in.mechanisms, in.capacity_ah, soc), soc);
  for (std::size_t k = 0; k < in.time_s.size(); ++k) {
    const double duration_s = k == 0 ? 0 : in.time_s[k] - in.time_s[k - 1];
    const double voltage_v = simulation.step(in.time_s[k], duration_s, readings.current(k), readings.temperature(k),
                                             [](auto&, const auto&) {});
    take(SimulatedRow{voltage_v, simulation.soc()});
  }
}

/// The same, as a list.
inline std::vector<SimulatedRow> simulate(const SimulationInput& in) {
  std::vector<SimulatedRow> rows;
  rows.reserve(in.time_s.size());
  simulate(in, [&](const SimulatedRow& row) { rows.push_back(row); });
  return rows;
}

}  // namespace bms::replay
