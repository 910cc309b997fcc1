#include "benchmark/truth/laboratory.hpp"

#include <cmath>

namespace bms::benchmark::truth {

namespace {

double draw_step_s(plant::Random& random) {
  const double which = random.uniform();
  if (which < 0.14) return 0.5;
  if (which < 0.28) return 2;
  return 1;
}

}  // namespace

Laboratory draw_laboratory(double one_c_a, bool demanding, plant::Random& random) {
  Laboratory lab;
  lab.calibration_share = demanding ? between(random, 0.85, 1) : between(random, 0.3, 0.8);
  const double drift = demanding ? 1 : between(random, 0.15, 0.9);
  lab.instruments.current_a = {.gain_error = 0.002 * between(random, -1, 1),
                               .drift_sigma = 0.001 * one_c_a * drift * between(random, 0.3, 1),
                               .drift_correlation_s = between(random, 1'800, 7'200),
                               .noise_sigma = between(random, 0.001, 0.003) * one_c_a,
                               .step = between(random, 0.0005, 0.002) * one_c_a};
  lab.instruments.voltage_v = {.gain_error = 0,  // at 3.3 V the drift already contains its effect
                               .drift_sigma = 0.001 * drift,
                               .drift_correlation_s = between(random, 1'800, 7'200),
                               .noise_sigma = between(random, 0.0003, 0.0015),
                               .step = between(random, 0.0005, 0.0015)};
  lab.instruments.temperature_c = {
      .gain_error = 0, .drift_sigma = 0, .drift_correlation_s = 3'600, .noise_sigma = 0.05, .step = 0.1};
  lab.step_s = draw_step_s(random);
  lab.measures_temperature = !chance(random, 0.1);
  return lab;
}

double white_v(const Laboratory& lab, const HealthyCell& cell) {
  const auto variance = [](const plant::ChannelParameters& c) {
    return c.noise_sigma * c.noise_sigma + c.step * c.step / 12;
  };
  const double r0_ohm = cell.r0_ohm.at(0.5);
  return std::sqrt(variance(lab.instruments.voltage_v) + r0_ohm * r0_ohm * variance(lab.instruments.current_a));
}

Series record(const World& world, const MeasuredSeries& measured, const Laboratory& lab, std::uint64_t seed) {
  const double step_s = world.stimulus.step_s;
  const plant::Instruments instruments(lab.instruments, seed);
  Series series;
  series.current_a = read_by(instruments.current_a, step_s, measured.current_a);
  series.voltage_v = converted_v(world, read_by(instruments.voltage_v, step_s, measured.voltage_v));
  if (lab.measures_temperature)
    series.temperature_c = read_by(instruments.temperature_c, step_s, measured.temperature_c);
  series.soc = measured.trace.soc;
  for (std::size_t k = 0; k < measured.current_a.size(); ++k) series.time_s.push_back(static_cast<double>(k) * step_s);
  return series;
}

}  // namespace bms::benchmark::truth
