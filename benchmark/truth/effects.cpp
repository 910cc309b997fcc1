#include "benchmark/truth/effects.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace bms::benchmark::truth {

const std::vector<std::string>& catalogue_ids() {
  static const std::vector<std::string> ids = {"ocv_hysteresis",
                                               "slow_polarisation",
                                               "fast_polarisation",
                                               "charge_transfer",
                                               "direction_asymmetry",
                                               "temperature_resistance",
                                               "self_heating",
                                               "entropic_ocv",
                                               "capacity_change",
                                               "coulombic_loss",
                                               "leakage",
                                               "resistance_growth",
                                               "polarisation_growth",
                                               "contact_step",
                                               "contact_intermittent",
                                               "ocv_shape",
                                               "current_offset",
                                               "current_gain",
                                               "current_clipping",
                                               "voltage_offset",
                                               "voltage_gain",
                                               "channel_skew",
                                               "initial_soc"};
  return ids;
}

const std::vector<std::string>& outside_ids() {
  static const std::vector<std::string> ids = {"plating_relaxation", "parallel_imbalance",    "memory_bump",
                                               "adc_nonlinearity",   "periodic_interference", "pressure_memory",
                                               "sticky_converter"};
  return ids;
}

Experiment experiment_for(const std::string& id, plant::Random& random) {
  using enum Profile;
  const auto either = [&](double a, double b) { return chance(random, 0.5) ? a : b; };
  if (id == "ocv_hysteresis") return {.profiles = {minor_loops, full_cycle, hppc}};
  if (id == "slow_polarisation") return {.profiles = {hppc, minor_loops, full_cycle}};
  if (id == "fast_polarisation") return {.profiles = {hppc, multi_rate, drive_two_way}, .step_s = 0.5};
  if (id == "charge_transfer")
    return {.profiles = {multi_rate, drive_two_way}, .current_scale = between(random, 1.2, 1.8)};
  if (id == "direction_asymmetry") return {.profiles = {drive_two_way, minor_loops, multi_rate, hppc}};
  if (id == "temperature_resistance" || id == "temperature_sensor") {
    const bool away = id == "temperature_resistance" && chance(random, 0.25);
    return {.profiles = {drive_two_way, forklift_shift, hppc, multi_rate},
            .swing_k = away ? 0 : sign(random) * between(random, 10, 18),
            .away_from_25 = away};
  }
  if (id == "self_heating") return {.profiles = {multi_rate, drive_two_way, many_cycles}, .current_scale = 1.4};
  if (id == "entropic_ocv")
    return {.profiles = {minor_loops, full_cycle, hppc, storage},
            .swing_k = either(between(random, 15, 22), -between(random, 15, 22))};
  if (id == "capacity_change" || id == "current_gain") return {.profiles = {full_cycle, many_cycles, storage, hppc}};
  if (id == "coulombic_loss") return {.profiles = {many_cycles}};
  if (id == "leakage") return {.profiles = {storage}};
  if (id == "resistance_growth" || id == "polarisation_growth")
    return {.profiles = {hppc, multi_rate, drive_two_way, forklift_shift}};
  if (id == "contact_step" || id == "contact_intermittent")
    return {.profiles = {drive_two_way, forklift_shift, drive_discharge, hppc}};
  if (id == "ocv_shape") return {.profiles = {full_cycle, hppc, storage}};
  if (id == "current_offset") return {.profiles = {full_cycle, storage, minor_loops, many_cycles}};
  if (id == "current_clipping") return {.profiles = {drive_two_way, multi_rate, forklift_shift}, .current_scale = 1.3};
  if (id == "voltage_offset" || id == "voltage_gain") return {.profiles = {hppc, minor_loops, full_cycle, storage}};
  if (id == "channel_skew") return {.profiles = {drive_two_way, multi_rate, forklift_shift, drive_discharge}};
  if (id == "initial_soc") return {.profiles = {full_cycle, hppc, drive_discharge, storage}};
  if (id == "plating_relaxation") return {.profiles = {full_cycle, minor_loops, storage, many_cycles}};
  if (id == "parallel_imbalance") return {.profiles = {full_cycle, minor_loops, hppc}};
  if (id == "memory_bump") return {.profiles = {hppc, full_cycle, storage}};
  if (id == "pressure_memory") return {.profiles = {multi_rate, drive_two_way, many_cycles}, .current_scale = 1.3};
  return {.profiles = {all_profiles.begin(), all_profiles.end()}};
}

namespace {

/// Resistance in bursts: two states with exponential dwells, each burst of its own size with a power-law tail; mean
/// size about 1.
std::vector<double> bursts(std::uint64_t seed, std::size_t count, double step_s, double between_s, double dwell_s) {
  plant::Random random(seed);
  std::vector<double> ohm(count, 0.0);
  double until_s = -between_s * std::log(1 - random.uniform());
  bool loose = false;
  double size = 0;
  for (std::size_t k = 0; k < count; ++k) {
    while (static_cast<double>(k) * step_s >= until_s) {
      loose = !loose;
      const double dwell = loose ? std::clamp(-dwell_s * std::log(1 - random.uniform()), 1.0, 60.0)
                                 : -between_s * std::log(1 - random.uniform());
      until_s += std::max(dwell, step_s);
      if (loose) size = std::min(0.5 * std::pow(1 - random.uniform(), -1 / 2.2), 5.0);
    }
    if (loose) ohm[k] = size * (0.7 + 0.6 * random.uniform());
  }
  return ohm;
}

double largest(const std::vector<double>& values) {
  double most = 0;
  for (double v : values) most = std::max(most, std::abs(v));
  return most;
}

}  // namespace

Effect draw_effect(const std::string& id, const HealthyCell& cell, const World& world, plant::Random& random) {
  const double size = cell.capacity_ah / 6, one_c_a = cell.capacity_ah;
  const double r0_ohm = cell.r0_ohm.at(0.5), lag_s = cell.r1_ohm.at(0.5) * cell.c1_f.at(0.5);
  const std::uint64_t seed = random.bits();
  const double way = sign(random);
  const auto later_seed = [seed](const World& w) { return w.holdout ? seed + 1 : seed; };

  if (id == "ocv_hysteresis") {
    Hysteresis h;
    h.tilt = between(random, -0.4, 0.4);
    h.on_discharge_branch = chance(random, 1.0 / 3);
    const std::size_t plays = 10 + below(random, 21);
    const double centre = log_between(random, 0.006, 0.06), spread = between(random, 0.8, 1.3);
    double sum = 0;
    for (std::size_t k = 0; k < plays; ++k) {
      const double width = 0.002 * std::pow(100.0, static_cast<double>(k) / static_cast<double>(plays - 1));
      const double off = std::log(width / centre) / spread;
      h.half_width.push_back(width / 2);
      h.share.push_back(std::exp(-off * off / 2) * between(random, 0.6, 1.4));
      sum += h.share.back();
    }
    for (double& share : h.share) share /= sum;
    return {id, ActsOn::cell, 0.001, 0.025, [h](double a, World& w) { (w.cell.hysteresis = h).half_gap_v = a; }};
  }
  if (id == "slow_polarisation") {
    const Diffusion d = {.resistance_ohm = 0,
                         .time_s = log_between(random, 1'200, 12'000),
                         .lag_s = 2 * lag_s};  // relaxes within time_s / 10
    return {id, ActsOn::cell, 0.0003 / size, 0.012 / size,
            [d](double a, World& w) { (w.cell.diffusion = d).resistance_ohm = a; }};
  }
  if (id == "fast_polarisation") {
    const double fastest_s = std::max(0.5, world.stimulus.step_s);
    const double slowest_s = std::max(0.3 * lag_s, 1.5 * fastest_s);
    const FastElement f = {
        .resistance_ohm = 0, .time_s = log_between(random, fastest_s, slowest_s), .spread = between(random, 2, 3)};
    return {id, ActsOn::cell, 0.02 * r0_ohm, 0.8 * r0_ohm,
            [f](double a, World& w) { (w.cell.fast = f).resistance_ohm = a; }};
  }
  if (id == "charge_transfer") {
    const double alpha = between(random, 0.35, 0.65);
    const double r0_part = chance(random, 0.5) ? between(random, 0, 0.5) : 0,
                 r1_part = chance(random, 0.8) || r0_part == 0 ? 1 : 0;
    return {id, ActsOn::cell, 0.02, 0.9, [=](double a, World& w) {
              w.cell.charge_transfer = {.share_of_r0 = a * r0_part, .share_of_r1 = a * r1_part, .alpha = alpha};
            }};
  }
  if (id == "direction_asymmetry") {
    const double width_a = between(random, 0.05, 0.3) * one_c_a;
    return {id, ActsOn::cell, 0.02, 0.35,
            [=](double a, World& w) { w.cell.asymmetry = {.excess = way * a, .width_a = width_a}; }};
  }
  if (id == "temperature_resistance") {
    TemperatureLaw law = {.steepness_k = 0,
                          .zero_k = chance(random, 0.5) ? 0 : between(random, 140, 180),
                          .share_of_r0 = between(random, 0.5, 1)};
    const double like_arrhenius = std::pow((298.15 - law.zero_k) / 298.15, 2);
    return {id, ActsOn::cell, 400, 8'000,
            [=](double a, World& w) { (w.cell.temperature_law = law).steepness_k = a * like_arrhenius; }};
  }
  if (id == "self_heating") {
    const TemperatureLaw law = {
        .steepness_k = between(random, 2'500, 5'500), .zero_k = 0, .share_of_r0 = between(random, 0.6, 1)};
    const double share = between(random, 0.75, 0.9), cooling = between(random, 10, 20);
    return {id, ActsOn::cell, 0.2 / size, 15 / size, [=](double a, World& w) {
              w.cell.temperature_law = law;
              w.cell.core = {.to_can_k_per_w = a, .share_of_heat_capacity = share, .cooling = cooling};
            }};
  }
  if (id == "entropic_ocv") {
    const double crosses = between(random, 0.3, 0.7), swing = between(random, 0.15, 0.3);
    const SmoothRandom wave(random);
    const Curve curve([&](double z) { return way * (std::tanh((z - crosses) / swing) + 0.3 * wave.at(z)); });
    return {id, ActsOn::cell, 0.00002, 0.0006, [curve](double a, World& w) {
              w.cell.entropy_v_per_k = curve;
              w.cell.entropy_scale = a;
            }};
  }
  if (id == "capacity_change")
    return {id, ActsOn::cell, 0.008, 0.25, [](double a, World& w) { w.cell.capacity_factor = 1 - a; }};
  if (id == "coulombic_loss") {
    const double half_a = between(random, 0.2, 1) * one_c_a;
    return {id, ActsOn::cell, 0.0005, 0.03,
            [=](double a, World& w) { w.cell.charge_loss = {.share = a, .half_a = half_a}; }};
  }
  if (id == "leakage") {
    const double per_e_v = between(random, 0.08, 0.3);
    return {id, ActsOn::cell, 0.0002 * one_c_a, 0.015 * one_c_a,
            [=](double a, World& w) { w.cell.leak = {.at_3v3_a = a, .per_e_v = per_e_v}; }};
  }
  if (id == "resistance_growth") {
    const double lean = between(random, -0.3, 0.3);
    return {id, ActsOn::cell, 0.01, 0.8,
            [=](double a, World& w) { w.cell.growth.of_r0 = a, w.cell.growth.r0_lean = lean; }};
  }
  if (id == "polarisation_growth") {
    const double answers = between(random, 0, 0.8);
    return {id, ActsOn::cell, 0.03, 1.2,
            [=](double a, World& w) { w.cell.growth.of_r1 = a, w.cell.growth.c1_answers = answers; }};
  }
  if (id == "contact_step") {
    const double at = between(random, 0.2, 0.75), ramp_s = between(random, 1, 5);
    return {id, ActsOn::cell, 0.02 * r0_ohm, 1.5 * r0_ohm, [=](double a, World& w) {
              w.cell.contact_scale = a;
              w.cell.contact_ohm.assign(w.stimulus.current_a.size(), 1.0);
              if (w.holdout) return;  // it stays
              for (std::size_t k = 0; k < w.cell.contact_ohm.size(); ++k) {
                const double since_s =
                    (static_cast<double>(k) - at * static_cast<double>(w.cell.contact_ohm.size())) * w.stimulus.step_s;
                w.cell.contact_ohm[k] = std::clamp(since_s / ramp_s, 0.0, 1.0);
              }
            }};
  }
  if (id == "contact_intermittent") {
    const double between_s = log_between(random, 120, 1'200), dwell_s = log_between(random, 3, 30);
    return {id, ActsOn::cell, 0.02 * r0_ohm, 1.5 * r0_ohm, [=](double a, World& w) {
              w.cell.contact_scale = a;
              w.cell.contact_ohm =
                  bursts(later_seed(w), w.stimulus.current_a.size(), w.stimulus.step_s, between_s, dwell_s);
            }};
  }
  if (id == "ocv_shape") {
    const double lean = between(random, -0.6, 0.6);
    return {id, ActsOn::cell, 0.003, 0.08,
            [=](double a, World& w) { w.cell.plateau_slide = {.slide = way * a, .lean = lean}; }};
  }
  if (id == "current_offset") {
    const double unsteady = between(random, 0.05, 0.2), correlation_s = log_between(random, 1'800, 7'200);
    return {id, ActsOn::current, 0.0005 * one_c_a, 0.02 * one_c_a, [=](double a, World& w) {
              w.faults.current.offset_scale = a;
              w.faults.current.offset_a =
                  ornstein_uhlenbeck(later_seed(w), w.stimulus.current_a.size(), w.stimulus.step_s, correlation_s);
              for (double& v : w.faults.current.offset_a) v = way * (1 + unsteady * v);
            }};
  }
  if (id == "current_gain")
    return {id, ActsOn::current, 0.005, 0.1, [=](double a, World& w) { w.faults.current.gain = way * a; }};
  if (id == "current_clipping") {
    const double most_a = largest(world.stimulus.current_a), knee = between(random, 8, 16);
    return {id, ActsOn::current, 0.1, 0.6,
            [=](double a, World& w) { w.faults.current.saturates_a = (1 - a) * most_a, w.faults.current.knee = knee; }};
  }
  if (id == "voltage_offset") {
    const double unsteady = between(random, 0.02, 0.08);
    return {id, ActsOn::voltage, 0.001, 0.025, [=](double a, World& w) {
              w.faults.voltage.offset_scale = a;
              w.faults.voltage.offset_v =
                  ornstein_uhlenbeck(later_seed(w), w.stimulus.current_a.size(), w.stimulus.step_s, 5'400);
              for (double& v : w.faults.voltage.offset_v) v = way * (1 + unsteady * v);
            }};
  }
  if (id == "voltage_gain")
    return {id, ActsOn::voltage, 0.0003, 0.008, [=](double a, World& w) { w.faults.voltage.gain = way * a; }};
  if (id == "channel_skew") {
    const double filtered = between(random, 0, 0.5);
    return {id, ActsOn::current, 0.06, 3, [=](double a, World& w) {
              w.faults.current.late_s = way * a;
              (way > 0 ? w.faults.current.filter_s : w.faults.voltage.filter_s) = filtered * a;
            }};
  }
  if (id == "temperature_sensor") {
    if (chance(random, 0.4))
      return {id, ActsOn::temperature, 4, 12, [=](double a, World& w) { w.faults.temperature.offset_k = way * a; }};
    return {id, ActsOn::temperature, 300, 1'500, [](double a, World& w) { w.faults.temperature.lag_s = a; }};
  }
  if (id == "initial_soc") {
    const double room = way > 0 ? 0.99 - world.start_soc : world.start_soc - 0.01, direction = room < 0.06 ? -way : way;
    return {id, ActsOn::start, 0.006, 0.15, [=](double a, World& w) {
              if (!w.holdout) w.believed_soc_excess = direction * a;
            }};
  }

  if (id == "plating_relaxation") {
    const Plating p = {.plateau_v = 0,
                       .hold_s = between(random, 1'200, 3'600),
                       .fill_s = between(random, 400, 1'500),
                       .least_a = between(random, 0.15, 0.3) * one_c_a};
    return {id, ActsOn::cell, 0.001, 0.02, [p](double a, World& w) { (w.cell.plating = p).plateau_v = a; }};
  }
  if (id == "parallel_imbalance") {
    const double exponent = between(random, 0, 1.5);  // -1 would be two cells that share fairly
    return {id, ActsOn::cell, 0.05, 0.6,
            [=](double a, World& w) { w.cell.parallel = {.inequality = a, .resistance_exponent = exponent}; }};
  }
  if (id == "memory_bump") {
    const Memory m = {.bump_v = 0, .turned_at = between(random, 0.3, 0.75), .width = between(random, 0.015, 0.05)};
    return {id, ActsOn::cell, 0.001, 0.02, [=](double a, World& w) { (w.cell.memory = m).bump_v = way * a; }};
  }
  if (id == "adc_nonlinearity") {
    const double period_v = between(random, 0.02, 0.08), phase = between(random, 0, 2 * std::numbers::pi);
    return {id, ActsOn::voltage, 0.0015, 0.012, [=](double a, World& w) {
              w.faults.voltage.inl_v = a, w.faults.voltage.inl_period_v = period_v, w.faults.voltage.inl_phase = phase;
            }};
  }
  if (id == "periodic_interference") {
    const double frequency_hz = log_between(random, 0.0005, 0.005), phase = between(random, 0, 2 * std::numbers::pi),
                 second = between(random, 0, 0.4);
    return {id, ActsOn::voltage, 0.0005, 0.012, [=](double a, World& w) {
              w.faults.voltage.hum_v = a;
              w.faults.voltage.hum.resize(w.stimulus.current_a.size());
              for (std::size_t k = 0; k < w.faults.voltage.hum.size(); ++k) {
                const double turn =
                    2 * std::numbers::pi * frequency_hz * static_cast<double>(k) * w.stimulus.step_s + phase;
                w.faults.voltage.hum[k] = std::sin(turn) + second * std::sin(2 * turn + 1);
              }
            }};
  }
  if (id == "pressure_memory") {
    const double time_constant_s = between(random, 2'400, 4'800);
    return {id, ActsOn::cell, 0.001, 0.03,
            [=](double a, World& w) { w.cell.pressure = {.lift_v = way * a, .time_constant_s = time_constant_s}; }};
  }
  if (id == "sticky_converter")
    return {id, ActsOn::voltage, 0.003, 0.03, [](double a, World& w) { w.faults.voltage.sticks_v = a; }};
  throw std::logic_error("no such effect: " + id);
}

}  // namespace bms::benchmark::truth
