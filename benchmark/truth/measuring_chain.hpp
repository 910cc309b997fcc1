// From the cell to the file: faults of the instruments (free of chance but for their own drift), then what every
// instrument does.
//
//   faults   current: passed on late or early, filtered, gain, offset, saturation;  voltage: filter, gain, offset, INL,
//   interference healthy  gain error, Ornstein-Uhlenbeck drift, white noise, steps of the converter
//   (plant/instruments.hpp); thermistor with a lag
#pragma once

#include <vector>

#include "benchmark/truth/concealed_cell.hpp"
#include "plant/instruments.hpp"

namespace bms::benchmark::truth {

struct CurrentFaults {
  double late_s = 0;    ///< the measured mean is that of an interval so much earlier; < 0: the voltage is late
  double filter_s = 0;  ///< one pole
  double gain = 0;
  double offset_scale = 0;
  std::vector<double> offset_a;  ///< times offset_scale
  double saturates_a = 0;        ///< 0: never; else |reading| stays below, with a soft knee
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
  double sticks_v = 0;      ///< the reading moves only when the voltage has left it by so much
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
/// After noise and drift: a sticking converter.
void stick(const VoltageFaults& faults, std::vector<double>& voltage_v);
/// Thermistor of 20 s, then the faults.
std::vector<double> faulty_temperature_c(const TemperatureFaults& faults, double step_s,
                                         const std::vector<double>& temperature_c);

/// One reading after the other through a channel of plant/.
std::vector<double> read_by(plant::Channel channel, double step_s, const std::vector<double>& values);

}  // namespace bms::benchmark::truth
