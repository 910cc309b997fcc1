#include "benchmark/truth/scaled_effect.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace bms::benchmark::truth {

namespace {

/// The world without the `unknown` effects, with what was measured as its input. A fault of the current sensor thus
/// becomes a cell through which the measured current flows.
World reference_world(const World& healthy, const std::vector<ScaledEffect>& known,
                      const std::vector<ScaledEffect>& unknown, const World& full, const MeasuredSeries& measured) {
  World world = healthy;
  for (const ScaledEffect& scaled : unknown) {
    const ActsOn acts_on = scaled.effect.kind->acts_on;
    if (acts_on == ActsOn::current) world.stimulus.current_a = measured.current_a;
    if (acts_on == ActsOn::temperature) world.stimulus.resistance_temperature_c = measured.temperature_c;
    if (acts_on == ActsOn::start) world.start_soc = full.start_soc + full.given_soc_error;
  }
  return with_effects(std::move(world), known);
}

/// Search over the logarithm of the amplitude: secant steps between bounds that close in.
class AmplitudeSearch {
 public:
  AmplitudeSearch(double least, double most)
      : least_(std::log(least)),
        most_(std::log(most)),
        low_(least_),
        high_(most_),
        place_(low_ + 0.4 * (high_ - low_)) {}

  double amplitude() const { return std::exp(place_); }

  /// off: logarithm of the wanted strength over the strength at the amplitude. Returns false where the search ends.
  bool next(double off) {
    if (std::abs(off) < tolerance) return false;
    (off > 0 ? low_ : high_) = place_;
    if (has_before_ && std::abs(place_ - before_place_) > same)
      slope_ = std::clamp((before_off_ - off) / (place_ - before_place_), 0.4, 3.0);
    has_before_ = true;
    before_place_ = place_;
    before_off_ = off;
    double next = place_ + off / slope_;
    if (next >= most_ - same || next <= least_ + same)
      next = std::clamp(next, least_, most_);
    else if (next <= low_ || next >= high_)
      next = (low_ + high_) / 2;
    if (std::abs(next - place_) < same) return false;
    place_ = next;
    return true;
  }

 private:
  static constexpr double tolerance = 0.04;  // of the strength, relative
  static constexpr double same = 1e-9;
  const double least_, most_;
  double low_, high_, place_, slope_ = 1;
  double before_place_ = 0, before_off_ = 0;
  bool has_before_ = false;
};

}  // namespace

MeasuredSeries observe(const HealthyCell& cell, const World& world, const std::vector<double>& source_v) {
  const double step_s = world.stimulus.step_s;
  MeasuredSeries measured;
  measured.trace = run_cell(cell, world.cell, world.stimulus, world.start_soc);
  for (std::size_t k = 0; k < source_v.size(); ++k) {
    if (std::isfinite(source_v[k])) measured.trace.voltage_v[k] = source_v[k];
  }
  measured.current_a = faulty_current_a(world.faults.current, step_s, world.stimulus.current_a);
  measured.voltage_v = faulty_voltage_v(world.faults.voltage, step_s, measured.trace.voltage_v);
  measured.temperature_c = faulty_temperature_c(world.faults.temperature, step_s, measured.trace.temperature_c);
  return measured;
}

World with_effects(World world, const std::vector<ScaledEffect>& effects) {
  for (const ScaledEffect& scaled : effects) scaled.effect.drawn.apply(scaled.amplitude, world);
  return world;
}

std::vector<double> converted_v(const World& world, std::vector<double> voltage_v) {
  stick(world.faults.voltage, voltage_v);
  return voltage_v;
}

std::vector<double> difference_v(const HealthyCell& cell, const World& healthy, const std::vector<ScaledEffect>& known,
                                 const std::vector<ScaledEffect>& unknown) {
  std::vector<ScaledEffect> all = known;
  all.insert(all.end(), unknown.begin(), unknown.end());
  const World full = with_effects(healthy, all);
  const MeasuredSeries with = observe(cell, full);
  const World reference = reference_world(healthy, known, unknown, full, with);
  const std::vector<double> without_v = converted_v(reference, observe(cell, reference).voltage_v);
  std::vector<double> d = converted_v(full, with.voltage_v);
  for (std::size_t k = 0; k < d.size(); ++k) d[k] -= without_v[k];
  return d;
}

ScaledEffect scale(const HealthyCell& cell, const World& healthy, const std::vector<ScaledEffect>& known, Effect effect,
                   const DetectionScale& detection_scale, double wanted) {
  constexpr int most_trials = 7;
  constexpr double weakest = 1e-6;  // for the logarithm
  ScaledEffect scaled = {std::move(effect), 0, 0};
  AmplitudeSearch search(scaled.effect.drawn.least, scaled.effect.drawn.most);
  for (int k = 0; k < most_trials; ++k) {
    scaled.amplitude = search.amplitude();
    scaled.strength = detection_scale.strength(difference_v(cell, healthy, known, {scaled}));
    if (!search.next(std::log(wanted / std::max(scaled.strength, weakest)))) break;
  }
  return scaled;
}

}  // namespace bms::benchmark::truth
