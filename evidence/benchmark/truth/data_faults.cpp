#include "benchmark/truth/data_faults.hpp"

#include <algorithm>
#include <cmath>

#include "benchmark/truth/random_functions.hpp"

namespace bms::benchmark::truth {

namespace {

/// A fault of stretches of a recording. Each stretch begins under load, so that the voltage changes within it.
struct Stretches {
  std::size_t fewest, choices;  ///< number of stretches: fewest + 0 .. choices - 1
  double shortest, longest;     ///< duration in s, or in sampling steps
  bool in_steps;
  enum class Effect { removes_rows, repeats_first, repeats_first_or_zero } effect;
};

template <int factor>
void scale_current(Series& recording, Series& holdout, Answer& answer, plant::Random&) {
  answer.start_s = recording.time_s.front();
  answer.end_s = recording.time_s.back();
  for (double& i : recording.current_a) i *= factor;
  for (double& i : holdout.current_a) i *= factor;
}

/// A row under load: the one with the largest current of a few random ones.
std::size_t draw_row_under_load(const Series& series, plant::Random& random) {
  const std::size_t count = series.time_s.size();
  std::size_t at = 0;
  double most = 0;
  for (int k = 0; k < 60; ++k) {
    const std::size_t guess = count / 20 + below(random, count * 8 / 10);
    if (std::abs(series.current_a[guess]) > most) {
      most = std::abs(series.current_a[guess]);
      at = guess;
    }
    if (k > 3 && most > 0) break;
  }
  return at;
}

void remove_rows(const std::vector<bool>& missing, Series& series) {
  for (std::vector<double>* values :
       {&series.time_s, &series.current_a, &series.voltage_v, &series.temperature_c, &series.soc}) {
    if (values->empty()) continue;
    std::size_t kept = 0;
    for (std::size_t k = 0; k < missing.size(); ++k) {
      if (!missing[k]) (*values)[kept++] = (*values)[k];
    }
    values->resize(kept);
  }
}

void spoil_stretches(const Stretches& fault, Series& series, Answer& answer, plant::Random& random) {
  const std::size_t count = series.time_s.size();
  const double step_s = series.time_s[1] - series.time_s[0];
  std::vector<bool> touched(count, false);
  const std::vector<double> before_v = series.voltage_v;
  const std::size_t stretches = fault.fewest + below(random, fault.choices);
  for (std::size_t n = 0; n < stretches; ++n) {
    const std::size_t from = draw_row_under_load(series, random);
    const double seconds = between(random, fault.shortest, fault.longest) * (fault.in_steps ? step_s : 1);
    const auto samples = static_cast<std::size_t>(seconds / step_s);
    const std::size_t to = std::min(count - 2, from + std::max<std::size_t>(samples, 1));
    const bool to_zero = chance(random, 0.6) && fault.effect == Stretches::Effect::repeats_first_or_zero;
    for (std::size_t k = from; k < to; ++k) {
      touched[k] = true;
      if (fault.effect != Stretches::Effect::removes_rows) series.voltage_v[k] = to_zero ? 0 : series.voltage_v[from];
    }
  }
  const auto first = std::find(touched.begin(), touched.end(), true);
  const auto last = std::find(touched.rbegin(), touched.rend(), true);
  answer.start_s = series.time_s[static_cast<std::size_t>(first - touched.begin())];
  answer.end_s = series.time_s[count - 1 - static_cast<std::size_t>(last - touched.rbegin())];
  std::vector<double> d(count);
  for (std::size_t k = 0; k < count; ++k) d[k] = series.voltage_v[k] - before_v[k];
  answer.effect_rms_v = rms(d);
  if (fault.effect == Stretches::Effect::removes_rows) remove_rows(touched, series);
}

void clock_gaps(Series& recording, Series&, Answer& answer, plant::Random& random) {
  spoil_stretches({.fewest = 5,
                   .choices = 8,
                   .shortest = 40,
                   .longest = 400,
                   .in_steps = false,
                   .effect = Stretches::Effect::removes_rows},
                  recording, answer, random);
}

void stuck_voltage(Series& recording, Series&, Answer& answer, plant::Random& random) {
  spoil_stretches({.fewest = 1,
                   .choices = 3,
                   .shortest = 360,
                   .longest = 2'400,
                   .in_steps = false,
                   .effect = Stretches::Effect::repeats_first},
                  recording, answer, random);
}

void voltage_dropouts(Series& recording, Series&, Answer& answer, plant::Random& random) {
  spoil_stretches({.fewest = 20,
                   .choices = 80,
                   .shortest = 1,
                   .longest = 8,
                   .in_steps = true,
                   .effect = Stretches::Effect::repeats_first_or_zero},
                  recording, answer, random);
}

}  // namespace

const std::array<DataFault, 5> data_faults = {{{"inverted_current", scale_current<-1>},
                                               {"clock_gaps", clock_gaps},
                                               {"stuck_voltage", stuck_voltage},
                                               {"milliampere", scale_current<1'000>},
                                               {"voltage_dropouts", voltage_dropouts}}};

double rms(const std::vector<double>& values) {
  double sum = 0;
  for (double v : values) sum += v * v;
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

}  // namespace bms::benchmark::truth
