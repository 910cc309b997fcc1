// From the cell to the file: first the faults of the instruments, then what every instrument does.
//
//   faults   current: delay, low-pass, gain, offset, saturation;  voltage: low-pass, gain, offset, integral
//            non-linearity, interference;  temperature: lag, offset
//   healthy  gain error, Ornstein-Uhlenbeck drift, white noise, converter steps (evidence/plant/instruments.hpp);
//   thermistor
//            with a lag
//
// The faults contain no random numbers except the drift of their own size.
#pragma once

#include <vector>

#include "benchmark/truth/concealed_cell.hpp"
#include "plant/instruments.hpp"

namespace bms::benchmark::truth {

struct CurrentFaults {
  double late_s = 0;    ///< delay of the measured current; < 0: the voltage is late
  double filter_s = 0;  ///< time constant of a low-pass of first order
  double gain = 0;
  double offset_scale = 0;
  std::vector<double> offset_a;  ///< times offset_scale
  double saturates_a = 0;        ///< 0: never; otherwise |reading| stays below it, with a soft knee
  double knee = 10;
};

struct VoltageFaults {
  double filter_s = 0;
  double gain = 0;
  double offset_scale = 0;
  std::vector<double> offset_v;  ///< times offset_scale
  double inl_v = 0, inl_period_v = 0.1, inl_phase = 0;
  double hum_v = 0;
  std::vector<double> hum;  ///< times hum_v
  double sticks_v = 0;      ///< threshold: the reading follows only larger changes
};

struct TemperatureFaults {
  double offset_k = 0;
  double lag_s = 0;
};

struct Faults {
  CurrentFaults current;
  VoltageFaults voltage;
  TemperatureFaults temperature;
};

std::vector<double> faulty_current_a(const CurrentFaults& faults, double step_s, const std::vector<double>& current_a);
std::vector<double> faulty_voltage_v(const VoltageFaults& faults, double step_s, std::vector<double> voltage_v);
/// Sticking converter; applied after noise and drift.
void stick(const VoltageFaults& faults, std::vector<double>& voltage_v);
/// Thermistor with a time constant of 20 s, then the faults.
std::vector<double> faulty_temperature_c(const TemperatureFaults& faults, double step_s,
                                         const std::vector<double>& temperature_c);

/// Readings of `values` by a channel of evidence/plant/, in order.
std::vector<double> read_by(plant::Channel channel, double step_s, const std::vector<double>& values);

}  // namespace bms::benchmark::truth
