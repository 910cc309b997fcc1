#include "benchmark/truth/measuring_chain.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace bms::benchmark::truth {

namespace {

void filter(double time_s, double step_s, std::vector<double>& values) {
  if (time_s <= 0) return;
  const double kept = std::exp(-step_s / time_s);
  double state = values.front();
  for (double& value : values) {
    state = value + kept * (state - value);
    value = state;
  }
}

}  // namespace

std::vector<double> faulty_current_a(const CurrentFaults& faults, double step_s, const std::vector<double>& current_a) {
  std::vector<double> measured = current_a;
  if (faults.late_s != 0) {
    const double steps = faults.late_s / step_s, whole = std::floor(steps), part = steps - whole;
    const auto last = static_cast<std::ptrdiff_t>(current_a.size()) - 1;
    const auto at = [&](std::ptrdiff_t k) {
      return current_a[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k, 0, last))];
    };
    for (std::ptrdiff_t k = 0; k <= last; ++k) {
      const std::ptrdiff_t from = k - static_cast<std::ptrdiff_t>(whole);
      measured[static_cast<std::size_t>(k)] = (1 - part) * at(from) + part * at(from - 1);
    }
  }
  filter(faults.filter_s, step_s, measured);
  for (std::size_t k = 0; k < measured.size(); ++k) {
    measured[k] *= 1 + faults.gain;
    if (faults.offset_scale != 0) measured[k] += faults.offset_scale * faults.offset_a[k];
    if (faults.saturates_a > 0)
      measured[k] /= std::pow(1 + std::pow(std::abs(measured[k]) / faults.saturates_a, faults.knee), 1 / faults.knee);
  }
  return measured;
}

std::vector<double> faulty_voltage_v(const VoltageFaults& faults, double step_s, std::vector<double> voltage_v) {
  filter(faults.filter_s, step_s, voltage_v);
  for (std::size_t k = 0; k < voltage_v.size(); ++k) {
    double& v = voltage_v[k];
    v *= 1 + faults.gain;
    if (faults.offset_scale != 0) v += faults.offset_scale * faults.offset_v[k];
    if (faults.inl_v != 0)
      v += faults.inl_v * std::sin(2 * std::numbers::pi * v / faults.inl_period_v + faults.inl_phase);
    if (faults.hum_v != 0) v += faults.hum_v * faults.hum[k];
  }
  return voltage_v;
}

void stick(const VoltageFaults& faults, std::vector<double>& voltage_v) {
  if (faults.sticks_v <= 0) return;
  double reading_v = voltage_v.front();
  for (double& v : voltage_v) {
    if (std::abs(v - reading_v) > faults.sticks_v) reading_v = v;
    v = reading_v;
  }
}

std::vector<double> faulty_temperature_c(const TemperatureFaults& faults, double step_s,
                                         const std::vector<double>& temperature_c) {
  std::vector<double> measured = temperature_c;
  filter(20, step_s, measured);
  filter(faults.lag_s, step_s, measured);
  for (double& t : measured) t += faults.offset_k;
  return measured;
}

std::vector<double> read_by(plant::Channel channel, double step_s, const std::vector<double>& values) {
  std::vector<double> readings;
  readings.reserve(values.size());
  for (double value : values) readings.push_back(channel.read(value, step_s));
  return readings;
}

}  // namespace bms::benchmark::truth
