#include "benchmark/truth/cases.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "benchmark/truth/calibration.hpp"
#include "benchmark/truth/detection_scale.hpp"
#include "benchmark/truth/effects.hpp"
#include "benchmark/truth/healthy_cells.hpp"

namespace bms::benchmark::truth {

namespace {

enum class Kind { null, single, pair, outside, data_fault };

struct Slot {
  Kind kind;
  std::size_t number;  ///< among those of its kind
};

std::uint64_t mixed(std::uint64_t a, std::uint64_t b) { return plant::Random(plant::Random(a).bits() ^ b).bits(); }

/// Which kind of case an index holds: the composition, shuffled, so that an index says nothing.
Slot slot_of(Split split, std::uint64_t stream, std::size_t index) {
  using enum Kind;
  constexpr std::array round = {null, single, single, pair,       null, single, outside, null, single, single,
                                pair, null,   single, data_fault, null, single, pair,    null, single, outside};
  std::vector<std::size_t> order(case_count(split));
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  plant::Random random(stream);
  for (std::size_t k = order.size() - 1; k > 0; --k) std::swap(order[k], order[below(random, k + 1)]);
  const std::size_t place = order[index % order.size()];
  const Kind kind = round[place % round.size()];
  const auto in_round = static_cast<std::size_t>(std::count(round.begin(), round.end(), kind));
  const auto before = static_cast<std::size_t>(
      std::count(round.begin(), round.begin() + static_cast<std::ptrdiff_t>(place % round.size()), kind));
  return {kind, place / round.size() * in_round + before};
}

/// What all share: how well the cell was calibrated and how it is measured.
struct Laboratory {
  double calibration_share = 0.6;
  plant::InstrumentParameters instruments;
  double step_s = 1;
  bool measures_temperature = true;
};

Laboratory draw_laboratory(double one_c_a, bool demanding, plant::Random& random) {
  Laboratory lab;
  lab.calibration_share = demanding ? between(random, 0.85, 1) : between(random, 0.3, 0.8);
  const double drift = demanding ? 1 : between(random, 0.15, 0.9);
  lab.instruments.current_a = {.gain_error = 0.002 * between(random, -1, 1),
                               .drift_sigma = 0.001 * one_c_a * drift * between(random, 0.3, 1),
                               .drift_correlation_s = between(random, 1'800, 7'200),
                               .noise_sigma = between(random, 0.001, 0.003) * one_c_a,
                               .step = between(random, 0.0005, 0.002) * one_c_a};
  lab.instruments.voltage_v = {.gain_error = 0,  // what it would add to 3.3 V is in the drift
                               .drift_sigma = 0.001 * drift,
                               .drift_correlation_s = between(random, 1'800, 7'200),
                               .noise_sigma = between(random, 0.0003, 0.0015),
                               .step = between(random, 0.0005, 0.0015)};
  lab.instruments.temperature_c = {
      .gain_error = 0, .drift_sigma = 0, .drift_correlation_s = 3'600, .noise_sigma = 0.05, .step = 0.1};
  const double which = random.uniform();
  lab.step_s = which < 0.14 ? 0.5 : which < 0.28 ? 2 : 1;
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

/// What instruments without chance would read, and the truth behind it.
struct MeasuredSeries {
  std::vector<double> current_a, voltage_v, temperature_c;
  CellTrace trace;
};

/// source_v: what the voltage channel is connected to where that is not the cell; empty: always the cell.
MeasuredSeries observe(const HealthyCell& cell, const World& world, const std::vector<double>& source_v = {}) {
  const double step_s = world.stimulus.step_s;
  MeasuredSeries seen;
  seen.trace = run_cell(cell, world.cell, world.stimulus, world.start_soc);
  for (std::size_t k = 0; k < source_v.size(); ++k) {
    if (std::isfinite(source_v[k])) seen.trace.voltage_v[k] = source_v[k];
  }
  seen.current_a = faulty_current_a(world.faults.current, step_s, world.stimulus.current_a);
  seen.voltage_v = faulty_voltage_v(world.faults.voltage, step_s, seen.trace.voltage_v);
  seen.temperature_c = faulty_temperature_c(world.faults.temperature, step_s, seen.trace.temperature_c);
  return seen;
}

std::vector<double> stuck(const World& world, std::vector<double> voltage_v) {
  stick(world.faults.voltage, voltage_v);
  return voltage_v;
}

struct ScaledEffect {
  Effect effect;
  double amplitude = 0;
  double strength = 0;
};

World with_effects(World world, const std::vector<ScaledEffect>& effects) {
  for (const ScaledEffect& sized : effects) sized.effect.apply(sized.amplitude, world);
  return world;
}

/// The world that somebody who does not know of `unknown` takes this to be: without it, but with what was measured. A
/// fault of the current sensor is thus a cell through which the measured current flows.
World believed(const World& healthy, const std::vector<ScaledEffect>& known, const std::vector<ScaledEffect>& unknown,
               const World& full, const MeasuredSeries& seen) {
  World world = healthy;
  for (const ScaledEffect& sized : unknown) {
    if (sized.effect.acts_on == ActsOn::current) world.stimulus.current_a = seen.current_a;
    if (sized.effect.acts_on == ActsOn::temperature) world.stimulus.resistance_temperature_c = seen.temperature_c;
    if (sized.effect.acts_on == ActsOn::start) world.start_soc = full.start_soc + full.believed_soc_excess;
  }
  return with_effects(std::move(world), known);
}

std::vector<double> difference_v(const HealthyCell& cell, const World& healthy, const std::vector<ScaledEffect>& known,
                                 const std::vector<ScaledEffect>& unknown) {
  std::vector<ScaledEffect> all = known;
  all.insert(all.end(), unknown.begin(), unknown.end());
  const World full = with_effects(healthy, all);
  const MeasuredSeries with = observe(cell, full);
  const World other = believed(healthy, known, unknown, full, with);
  const std::vector<double> without_v = stuck(other, observe(cell, other).voltage_v);
  std::vector<double> d = stuck(full, with.voltage_v);
  for (std::size_t k = 0; k < d.size(); ++k) d[k] -= without_v[k];
  return d;
}

/// Scales the effect until it is as visible as wanted or leaves its physical range.
ScaledEffect scale(const HealthyCell& cell, const World& healthy, const std::vector<ScaledEffect>& known, Effect effect,
                   const DetectionScale& detection_scale, double wanted) {
  ScaledEffect sized = {std::move(effect), 0, 0};
  const double least = sized.effect.least, most = sized.effect.most;
  const auto strength_at = [&](double amplitude) {
    sized.amplitude = amplitude;
    return sized.strength = detection_scale.strength(difference_v(cell, healthy, known, {sized}));
  };
  double low = std::log(least), high = std::log(most), place = low + 0.4 * (high - low), slope = 1;
  double before_place = 0, before = 0;
  for (int k = 0; k < 7; ++k) {
    const double off = std::log(wanted / std::max(strength_at(std::exp(place)), 1e-6));
    if (std::abs(off) < 0.04) break;
    (off > 0 ? low : high) = place;
    if (k > 0 && std::abs(place - before_place) > 1e-9)
      slope = std::clamp((before - off) / (place - before_place), 0.4, 3.0);
    before_place = place, before = off;
    double next = place + off / slope;
    if (next >= std::log(most) - 1e-9 || next <= std::log(least) + 1e-9)
      next = std::clamp(next, std::log(least), std::log(most));
    else if (next <= low || next >= high)
      next = (low + high) / 2;
    if (std::abs(next - place) < 1e-9) break;
    place = next;
  }
  return sized;
}

struct Range {
  double lowest = 0.04, highest = 0.965;
};
constexpr Range allowed_soc = {0.025, 0.985};

/// By how much soc leaves what is allowed, at either end.
Range excess(const std::vector<double>& soc) {
  const auto [low, high] = std::minmax_element(soc.begin(), soc.end());
  return {std::max(0.0, allowed_soc.lowest - *low), std::max(0.0, *high - allowed_soc.highest)};
}

struct Setting {
  Profile profile = Profile::hppc;
  double step_s = 1, duration_s = 0, current_scale = 1;
  double start_soc = 0.9;
  Ambient ambient = Ambient::constant;
  double ambient_start_c = 25, swing_k = 0;
  std::uint64_t seed = 0;
};

World make_world(const HealthyCell& cell, const Setting& setting, const Range& range, bool holdout) {
  plant::Random random(setting.seed);
  const double one_c_v = cell.capacity_ah * (cell.r0_ohm.at(0.5) + cell.r1_ohm.at(0.5));
  World world;
  world.holdout = holdout;
  world.start_soc = std::clamp(setting.start_soc, range.lowest + 0.02, range.highest);
  world.stimulus.step_s = setting.step_s;
  world.stimulus.current_a = draw_current_a({.profile = setting.profile,
                                             .step_s = setting.step_s,
                                             .capacity_ah = cell.capacity_ah,
                                             .start_soc = world.start_soc,
                                             .lowest_soc = range.lowest,
                                             .highest_soc = range.highest,
                                             .duration_s = setting.duration_s,
                                             .current_scale = setting.current_scale,
                                             .fastest_charge = std::min(2.0, 0.27 / one_c_v),
                                             .fastest_discharge = std::min(5.5, 0.75 / one_c_v)},
                                            random);
  plant::Random weather(mixed(setting.seed, 1));
  world.stimulus.ambient_c = draw_ambient_c(setting.ambient, setting.ambient_start_c, setting.swing_k,
                                            world.stimulus.current_a.size(), weather);
  return world;
}

Setting draw_setting(const Experiment& experiment, double usual_step_s, bool holdout, plant::Random& random) {
  Setting s;
  s.profile = one_of(random, experiment.profiles);
  s.current_scale = experiment.current_scale;
  s.step_s = experiment.step_s > 0 ? std::min(experiment.step_s, usual_step_s) : usual_step_s;
  const bool has_an_end = s.profile == Profile::full_cycle || s.profile == Profile::storage;
  if (!holdout && has_an_end && experiment.step_s == 0) s.step_s = std::max(s.step_s, 1.0);
  const double least_s = std::max(9'000.0, 5'000 * s.step_s), most_s = std::min(28'800.0, 25'000 * s.step_s);
  s.duration_s = holdout      ? std::clamp(between(random, 3'600, 14'400), 3'600.0, 25'000 * s.step_s)
                 : has_an_end ? most_s
                              : between(random, least_s, most_s);
  s.start_soc = draw_start_soc(s.profile, random);
  s.seed = random.bits();
  if (experiment.swing_k != 0) {
    s.ambient = chance(random, 0.7) ? Ambient::step_and_back : Ambient::wave;
    s.swing_k = experiment.swing_k;
    s.ambient_start_c = experiment.swing_k > 0 ? between(random, 12, 25) : between(random, 25, 32);
  } else if (experiment.away_from_25) {
    s.ambient_start_c = chance(random, 0.5) ? between(random, 8, 16) : between(random, 33, 40);
  } else {
    s.ambient_start_c = between(random, 21, 29);
  }
  return s;
}

Series measure(const World& world, const MeasuredSeries& seen, const Laboratory& lab, std::uint64_t seed) {
  const double step_s = world.stimulus.step_s;
  const plant::Instruments instruments(lab.instruments, seed);
  Series series;
  series.current_a = read_by(instruments.current_a, step_s, seen.current_a);
  series.voltage_v = read_by(instruments.voltage_v, step_s, seen.voltage_v);
  stick(world.faults.voltage, series.voltage_v);
  if (lab.measures_temperature) series.temperature_c = read_by(instruments.temperature_c, step_s, seen.temperature_c);
  series.soc = seen.trace.soc;
  for (std::size_t k = 0; k < seen.current_a.size(); ++k) series.time_s.push_back(static_cast<double>(k) * step_s);
  return series;
}

/// Run later: what chance does is new, what is wrong has stayed.
Series run_test_plan(const HealthyCell& cell, const std::vector<ScaledEffect>& effects, Laboratory lab,
                     std::uint64_t seed, const TestPlan& test_plan) {
  plant::Random random(seed);
  World world;
  world.holdout = true;
  world.start_soc = test_plan.start_soc;
  world.stimulus = {.step_s = test_plan.step_s,
                    .current_a = test_plan.current_a,
                    .ambient_c = test_plan.ambient_c,
                    .resistance_temperature_c = {}};
  const double laboratory_c = between(random, 21, 29);
  for (double& c : world.stimulus.ambient_c) c = std::isfinite(c) ? c : laboratory_c;
  world = with_effects(std::move(world), effects);
  lab.measures_temperature = lab.measures_temperature || test_plan.measures_temperature;
  const MeasuredSeries seen = observe(cell, world, test_plan.source_v);
  Series series = measure(world, seen, lab, random.bits());
  series.terminal_v = seen.trace.voltage_v;
  if (world.cell.contact_scale != 0) {
    for (std::size_t k = 0; k < series.terminal_v.size(); ++k)
      series.terminal_v[k] -= world.cell.contact_scale * world.cell.contact_ohm[k] * test_plan.current_a[k];
  }
  return series;
}

double rms(const std::vector<double>& values) {
  double sum = 0;
  for (double v : values) sum += v * v;
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

void locate(const std::vector<double>& d, double step_s, const std::vector<double>& soc, Answer& answer) {
  double most = 0;
  for (double v : d) most = std::max(most, std::abs(v));
  bool any = false;
  for (std::size_t k = 0; k < d.size(); ++k) {
    if (std::abs(d[k]) <= 0.2 * most) continue;
    const double time_s = static_cast<double>(k) * step_s;
    if (!any) answer.start_s = time_s, answer.soc_from = answer.soc_to = soc[k];
    any = true;
    answer.end_s = time_s;
    answer.soc_from = std::min(answer.soc_from, soc[k]);
    answer.soc_to = std::max(answer.soc_to, soc[k]);
  }
}

/// Two that one recording can hold and that do not stand for the same.
bool go_together(const std::string& a, const std::string& b) {
  const std::vector<std::vector<std::string>> alike = {
      {"current_offset", "current_gain", "current_clipping", "channel_skew"},
      {"voltage_offset", "voltage_gain"},
      {"temperature_resistance", "self_heating"},
      {"leakage", "coulombic_loss", "current_offset"},
      {"contact_step", "contact_intermittent"},
      {"charge_transfer", "polarisation_growth", "self_heating"},
      {"slow_polarisation", "polarisation_growth"},
      {"capacity_change", "current_gain", "coulombic_loss"},
      {"capacity_change", "ocv_shape", "initial_soc"},
  };
  if (a == b) return false;
  return std::none_of(alike.begin(), alike.end(), [&](const std::vector<std::string>& group) {
    return std::count(group.begin(), group.end(), a) > 0 && std::count(group.begin(), group.end(), b) > 0;
  });
}

std::vector<std::string> draw_pair(plant::Random& random) {
  if (chance(random, 0.06)) return {"temperature_resistance", "temperature_sensor"};
  for (;;) {
    const std::string a = one_of(random, catalogue_ids()), b = one_of(random, catalogue_ids());
    if (go_together(a, b)) return {a, b};
  }
}

Experiment joined(const std::vector<Experiment>& experiments) {
  Experiment all = experiments.front();
  for (const Experiment& e : experiments) {
    all.current_scale = std::max(all.current_scale, e.current_scale);
    if (all.swing_k == 0) all.swing_k = e.swing_k;
    all.away_from_25 = all.away_from_25 || e.away_from_25;
    if (e.step_s > 0) all.step_s = e.step_s;
    std::vector<Profile> shared;
    for (Profile p : all.profiles) {
      if (std::count(e.profiles.begin(), e.profiles.end(), p) > 0) shared.push_back(p);
    }
    if (shared.empty())
      all.profiles.insert(all.profiles.end(), e.profiles.begin(), e.profiles.end());
    else
      all.profiles = shared;
  }
  return all;
}

constexpr std::array data_faults = {"inverted_current", "clock_gaps", "stuck_voltage", "milliampere",
                                    "voltage_dropouts"};

void spoil(const std::string& fault, Series& series, Series& holdout, Answer& answer, plant::Random& random) {
  const std::size_t count = series.time_s.size();
  answer.start_s = series.time_s.front(), answer.end_s = series.time_s.back();
  if (fault == "inverted_current" || fault == "milliampere") {
    const double factor = fault == "milliampere" ? 1'000 : -1;
    for (double& i : series.current_a) i *= factor;
    for (double& i : holdout.current_a) i *= factor;
    return;
  }
  // under load, so that something happens meanwhile
  const auto somewhere = [&] {
    std::size_t at = 0;
    double most = 0;
    for (int k = 0; k < 60; ++k) {
      const std::size_t guess = count / 20 + below(random, count * 8 / 10);
      if (std::abs(series.current_a[guess]) > most) most = std::abs(series.current_a[guess]), at = guess;
      if (k > 3 && most > 0) break;
    }
    return at;
  };
  const double step_s = series.time_s[1] - series.time_s[0];
  const auto samples = [&](double seconds) { return static_cast<std::size_t>(seconds / step_s); };
  std::vector<bool> missing(count, false), touched(count, false);
  const std::vector<double> before_v = series.voltage_v;
  const std::size_t times = fault == "clock_gaps"      ? 5 + below(random, 8)
                            : fault == "stuck_voltage" ? 1 + below(random, 3)
                                                       : 20 + below(random, 80);
  for (std::size_t n = 0; n < times; ++n) {
    const std::size_t from = somewhere();
    const double seconds = fault == "clock_gaps"      ? between(random, 40, 400)
                           : fault == "stuck_voltage" ? between(random, 360, 2'400)
                                                      : between(random, 1, 8) * step_s;
    const std::size_t to = std::min(count - 2, from + std::max<std::size_t>(samples(seconds), 1));
    const bool to_zero = chance(random, 0.6);
    for (std::size_t k = from; k < to; ++k) {
      touched[k] = true;
      if (fault == "clock_gaps")
        missing[k] = true;
      else
        series.voltage_v[k] = fault == "voltage_dropouts" && to_zero ? 0 : series.voltage_v[from];
    }
  }
  const auto first = std::find(touched.begin(), touched.end(), true);
  const auto last = std::find(touched.rbegin(), touched.rend(), true);
  answer.start_s = series.time_s[static_cast<std::size_t>(first - touched.begin())];
  answer.end_s = series.time_s[count - 1 - static_cast<std::size_t>(last - touched.rbegin())];
  std::vector<double> d(count);
  for (std::size_t k = 0; k < count; ++k) d[k] = series.voltage_v[k] - before_v[k];
  answer.effect_rms_v = rms(d);
  for (std::vector<double>* values :
       {&series.time_s, &series.current_a, &series.voltage_v, &series.temperature_c, &series.soc}) {
    if (values->empty()) continue;
    std::size_t kept = 0;
    for (std::size_t k = 0; k < count; ++k) {
      if (!missing[k]) (*values)[kept++] = (*values)[k];
    }
    values->resize(kept);
  }
}

struct Attempt {
  Case made;
  bool good = true;  ///< else it is taken only if nothing better comes
};

bool follows_temperature(const std::string& id) {
  return id == "temperature_resistance" || id == "temperature_sensor" || id == "self_heating" || id == "entropic_ocv";
}

Attempt attempt(const Slot& slot, const std::vector<std::string>& ids, plant::Random& random) {
  const bool demanding = slot.kind == Kind::null && slot.number % 3 == 0;
  const HealthyCell cell = draw_healthy_cell(random);
  Laboratory lab = draw_laboratory(cell.capacity_ah, demanding, random);

  std::vector<Experiment> experiments;
  for (const std::string& id : ids) {
    experiments.push_back(experiment_for(id, random));
    if (follows_temperature(id)) lab.measures_temperature = true;
  }
  Experiment experiment =
      ids.empty() ? Experiment{.profiles = {all_profiles.begin(), all_profiles.end()}} : joined(experiments);
  if (chance(random, 1.0 / 3)) experiment.profiles = {all_profiles.begin(), all_profiles.end()};
  if (demanding) {
    if (chance(random, 0.6)) {
      experiment.current_scale = between(random, 1.3, 1.8);
      experiment.profiles = {Profile::multi_rate, Profile::drive_two_way, Profile::forklift_shift};
    }
    if (chance(random, 0.6)) experiment.swing_k = sign(random) * between(random, 8, 18);
  }
  const bool steady_temperature = std::count(ids.begin(), ids.end(), "self_heating") > 0;
  if (experiment.swing_k == 0 && !steady_temperature && chance(random, 0.2))
    experiment.swing_k = sign(random) * between(random, 3, 12);

  Setting setting = draw_setting(experiment, lab.step_s, false, random);
  Experiment later = experiment;
  later.profiles = {all_profiles.begin(), all_profiles.end()};
  Setting later_setting = draw_setting(later, setting.step_s, true, random);
  for (Setting* s : {&setting, &later_setting}) {
    if (steady_temperature) s->ambient = Ambient::constant, s->ambient_start_c = 25;
  }
  Range range, later_range;
  if (chance(random, 0.35)) range.lowest = between(random, 0.04, 0.25);
  if (chance(random, 0.35)) later_range.lowest = between(random, 0.04, 0.25);

  // draws that must not change when the range of soc is narrowed
  const std::uint64_t shape_seed = random.bits(), instrument_seed = random.bits();
  std::vector<double> wanted;
  for (std::size_t n = 0; n < ids.size(); ++n)
    wanted.push_back(slot.kind == Kind::pair ? log_between(random, 2.6, 8) : log_between(random, 0.5, 8));

  Attempt result;
  Case& made = result.made;
  Answer& answer = made.answer;
  World healthy, full;
  MeasuredSeries seen;
  std::vector<ScaledEffect> sized;
  std::vector<std::vector<double>> shares_v;
  for (int narrowed = 0; narrowed < 5; ++narrowed) {
    healthy = make_world(cell, setting, range, false);
    const CellTrace trace = run_cell(cell, {}, healthy.stimulus, healthy.start_soc);
    sized.clear();
    if (!ids.empty()) {
      const DetectionScale detection_scale(cell, healthy.stimulus, trace, white_v(lab, cell));
      for (std::size_t n = 0; n < ids.size(); ++n) {
        plant::Random shape(mixed(shape_seed, n));
        const Effect effect = draw_effect(ids[n], cell, healthy, shape);
        // the thermometer is judged in a cell whose resistances follow the temperature
        sized.push_back(scale(cell, healthy, ids[n] == "temperature_sensor" ? sized : std::vector<ScaledEffect>{},
                              effect, detection_scale, wanted[n]));
      }
      if (sized.size() == 2) {
        shares_v.clear();
        for (std::size_t n = 0; n < 2; ++n) {
          shares_v.push_back(difference_v(cell, healthy, {sized[1 - n]}, {sized[n]}));
          sized[n].strength = detection_scale.strength(shares_v[n]);
        }
        result.good = std::abs(detection_scale.cosine_similarity(shares_v[0], shares_v[1])) < 0.85;
      }
    }
    full = with_effects(healthy, sized);
    seen = observe(cell, full);
    const Range over = excess(seen.trace.soc);
    if (over.lowest == 0 && over.highest == 0) break;
    range.lowest += over.lowest > 0 ? over.lowest + 0.01 : 0;
    range.highest -= over.highest > 0 ? over.highest + 0.01 : 0;
    if (range.highest - range.lowest < 0.3) break;
    if (narrowed == 4) result.good = false;
  }
  for (const ScaledEffect& s : sized) {
    answer.ids.push_back(s.effect.id);
    answer.strengths.push_back(s.strength);
    answer.amplitudes.push_back(s.amplitude);
  }
  answer.strength = answer.strengths.empty() ? 0 : *std::min_element(answer.strengths.begin(), answer.strengths.end());
  for (const ScaledEffect& s : sized) {
    const bool smallest = s.amplitude <= s.effect.least * 1.001;  // nobody would name less: then it may be plain to see
    if (slot.kind == Kind::pair ? s.strength < 2 || s.strength > 12
                                : s.strength < 0.45 || (s.strength > 9 && !smallest))
      result.good = false;
  }
  if (!sized.empty()) {
    const std::vector<double> d = difference_v(cell, healthy, {}, sized);
    answer.effect_rms_v = rms(d);
    locate(d, healthy.stimulus.step_s, seen.trace.soc, answer);
  }

  World later_world;
  MeasuredSeries later_seen;
  for (int narrowed = 0; narrowed < 6; ++narrowed) {
    later_world = with_effects(make_world(cell, later_setting, later_range, true), sized);
    later_seen = observe(cell, later_world);
    const Range over = excess(later_seen.trace.soc);
    if (over.lowest == 0 && over.highest == 0) break;
    later_range.lowest += over.lowest > 0 ? over.lowest + 0.01 : 0;
    later_range.highest -= over.highest > 0 ? over.highest + 0.01 : 0;
    if (narrowed == 5) result.good = false;
  }

  made.recording = measure(full, seen, lab, instrument_seed);
  made.holdout = measure(later_world, later_seen, lab, mixed(instrument_seed, 1));
  made.run_test = [cell, sized, lab, seed = mixed(instrument_seed, 2)](const TestPlan& test_plan) {
    return run_test_plan(cell, sized, lab, seed, test_plan);
  };
  made.cell = calibrate(cell, lab.calibration_share, random);
  const double told = std::clamp(0.0025 * random.normal(), -0.005, 0.005);
  made.believed_initial_soc = std::clamp(full.start_soc + full.believed_soc_excess + told, 0.0, 1.0);
  made.holdout_initial_soc = std::round(200 * later_world.start_soc) / 200;
  const std::vector<double> clean_v = stuck(full, seen.voltage_v);
  std::vector<double> noise_v = made.recording.voltage_v;
  for (std::size_t k = 0; k < noise_v.size(); ++k) noise_v[k] -= clean_v[k];
  answer.noise_floor_v = rms(noise_v);
  answer.profile = name_of(setting.profile);
  return result;
}

}  // namespace

std::size_t case_count(Split split) { return split == Split::development ? 120 : 240; }

Case make_case(Split split, std::uint64_t seed, std::size_t index) {
  const std::uint64_t stream =
      mixed(split == Split::development ? 0x6465'7665'6C6F'7000U : 0x6669'6E61'6C00'0000U, seed);
  const Slot slot = slot_of(split, stream, index);
  plant::Random random(mixed(stream, index + 1));
  const std::size_t turn = static_cast<std::size_t>(stream % 1'009);

  Attempt best;
  for (int k = 0; k < 6; ++k) {
    std::vector<std::string> ids;
    if (slot.kind == Kind::single) ids = {catalogue_ids()[(slot.number + turn) % catalogue_ids().size()]};
    if (slot.kind == Kind::outside) ids = {outside_ids()[(slot.number + turn) % outside_ids().size()]};
    if (slot.kind == Kind::pair) ids = draw_pair(random);
    Attempt next = attempt(slot, ids, random);
    const bool good = next.good;
    if (k == 0 || good || (slot.kind == Kind::pair && next.made.answer.strength > best.made.answer.strength))
      best = std::move(next);
    if (good) break;
  }
  Case made = std::move(best.made);
  made.answer.kind = case_kinds[static_cast<std::size_t>(slot.kind)];
  if (slot.kind == Kind::data_fault) {
    made.run_test = nullptr;
    made.answer.ids = {data_faults[(slot.number + turn) % data_faults.size()]};
    spoil(made.answer.ids.front(), made.recording, made.holdout, made.answer, random);
  }
  const std::string digits = std::to_string(index);
  made.name = (split == Split::development ? "development-" : "final-") +
              std::string(digits.size() < 3 ? 3 - digits.size() : 0, '0') + digits;
  return made;
}

}  // namespace bms::benchmark::truth
