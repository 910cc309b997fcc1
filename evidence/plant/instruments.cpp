#include "plant/instruments.hpp"

#include <cmath>

namespace bms::plant {

Channel::Channel(const ChannelParameters& parameters, std::uint64_t seed)
    : parameters_(parameters), random_(seed), drift_(parameters.drift_sigma * random_.normal()) {}

double Channel::read(double true_value, double elapsed_s) {
  const ChannelParameters& p = parameters_;
  const double kept = 1 - elapsed_s / p.drift_correlation_s;  // the first two terms of the exponential
  drift_ = kept * drift_ + p.drift_sigma * std::sqrt(1 - kept * kept) * random_.normal();
  const double reading = (1 + p.gain_error) * true_value + drift_ + p.noise_sigma * random_.normal();
  return p.step > 0 ? std::round(reading / p.step) * p.step : reading;
}

// Each channel has its own seed, so that a change of one channel does not affect the others.
Instruments::Instruments(const InstrumentParameters& parameters, std::uint64_t seed)
    : current_a(parameters.current_a, 3 * seed),
      voltage_v(parameters.voltage_v, 3 * seed + 1),
      temperature_c(parameters.temperature_c, 3 * seed + 2) {}

}  // namespace bms::plant
