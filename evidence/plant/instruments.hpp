// The measuring chain between cell and recording: gain error, slow drift of the offset, noise, quantisation.
//
//   reading = round_to_step((1 + gain_error) * true value + drift + noise)
//
// The drift is an Ornstein-Uhlenbeck process around zero with the standard deviation drift_sigma and the correlation
// time drift_correlation_s; its start value is random as well. The same seed gives the same readings on every machine.
#pragma once

#include <cstdint>

#include "plant/random.hpp"

namespace bms::plant {

/// drift_sigma, noise_sigma and step have the unit of the measured quantity.
struct ChannelParameters {
  double gain_error = 0;  ///< fraction
  double drift_sigma = 0;
  double drift_correlation_s = 3'600;
  double noise_sigma = 0;
  double step = 0;  ///< 0: not quantised
};

class Channel {
 public:
  Channel(const ChannelParameters& parameters, std::uint64_t seed);

  /// elapsed_s: since the previous reading, much less than drift_correlation_s.
  double read(double true_value, double elapsed_s);
  double drift() const { return drift_; }

 private:
  ChannelParameters parameters_;
  Random random_;
  double drift_;
};

/// The measuring chain of a forklift: shunt with amplifier, cell monitor IC, thermistor.
struct InstrumentParameters {
  ChannelParameters current_a = {
      .gain_error = 0.002, .drift_sigma = 0.015, .drift_correlation_s = 3'600, .noise_sigma = 0.010, .step = 0.005};
  ChannelParameters voltage_v = {
      .gain_error = 0, .drift_sigma = 0.0005, .drift_correlation_s = 7'200, .noise_sigma = 0.001, .step = 0.001};
  ChannelParameters temperature_c = {
      .gain_error = 0, .drift_sigma = 0, .drift_correlation_s = 3'600, .noise_sigma = 0.05, .step = 0.1};
};

struct Instruments {
  Instruments(const InstrumentParameters& parameters, std::uint64_t seed);

  Channel current_a, voltage_v, temperature_c;
};

}  // namespace bms::plant
