#include "benchmark/truth/packs.hpp"

#include <algorithm>
#include <cmath>

#include "benchmark/truth/calibration.hpp"
#include "benchmark/truth/healthy_cells.hpp"
#include "benchmark/truth/laboratory.hpp"
#include "benchmark/truth/pack_faults.hpp"
#include "benchmark/truth/profiles.hpp"

namespace bms::benchmark::truth {

namespace {

constexpr std::size_t fine_per_row = 10;  // steps of the simulation in a row of the recording
constexpr double full_soc = 0.955;
constexpr double least_slope_v = 0.5;  // of the OCV there: a charger stops where the voltage rises

/// How unequal the healthy cells of a pack are: standard deviations.
struct Inequality {
  double soc, capacity, r0, r1, joint, offset_v, gain, warmer_k;
};

Inequality draw_inequality(plant::Random& random) {
  return {.soc = between(random, 0.001, 0.005),
          .capacity = between(random, 0.003, 0.012),
          .r0 = between(random, 0.01, 0.03),
          .r1 = between(random, 0.01, 0.04),
          .joint = between(random, 0.005, 0.02),
          .offset_v = between(random, 0.0003, 0.001),
          .gain = between(random, 0.00005, 0.0002),
          .warmer_k = between(random, 0, 3)};
}

/// What the pack is made of, and its instruments.
struct Build {
  PackSetting setting;
  HealthyCell cell;
  Laboratory lab;
  Inequality unequal;
  double steepness_k = 0;  ///< of the resistances by temperature
  double staggered_s = 0;  ///< in which all channels are read once
  double start_soc = full_soc;
  double fine_s = 0.1;
  std::vector<double> current_a;  ///< true, fine
  double ambient_c = 25;
  std::uint64_t seed = 0;
};

std::vector<double> draw_profile_a(const Build& b, const SlowLog* log, plant::Random& random) {
  const double one_c_v = b.cell.capacity_ah * (b.cell.r0_ohm.at(0.5) + b.cell.r1_ohm.at(0.5));
  const double fastest_charge = std::min(2.0, 0.27 / one_c_v), fastest_discharge = std::min(5.5, 0.75 / one_c_v);
  if (log != nullptr) {
    return draw_load_a({.load = log->load,
                        .step_s = b.fine_s,
                        .duration_s = 3'600 * log->hours,
                        .capacity_ah = b.cell.capacity_ah,
                        .start_soc = b.start_soc,
                        .lowest_soc = 0.12,
                        .highest_soc = full_soc,
                        .fastest_charge = fastest_charge,
                        .fastest_discharge = fastest_discharge},
                       random);
  }
  const Profile profile = chance(random, 0.6) ? Profile::forklift_shift : Profile::drive_two_way;
  return draw_current_a({.profile = b.setting.long_recording ? Profile::forklift_shift : profile,
                         .step_s = b.fine_s,
                         .capacity_ah = b.cell.capacity_ah,
                         .start_soc = b.start_soc,
                         .lowest_soc = 0.12,
                         .highest_soc = full_soc,
                         .duration_s = b.setting.long_recording ? 3'600 * between(random, 48, 80) : 28'800,
                         .fastest_charge = fastest_charge,
                         .fastest_discharge = fastest_discharge},
                        random);
}

Build draw_build(std::uint64_t seed, const SlowLog* log, plant::Random& random) {
  Build b;
  b.seed = seed;
  do {
    b.cell = draw_healthy_cell(random);
  } while (b.cell.ocv_v.slope_at(full_soc) < least_slope_v);
  b.lab = draw_laboratory(b.cell.capacity_ah, false, random);
  b.setting.cells = log == nullptr ? 8 + below(random, 17) : 3 + below(random, chance(random, 0.4) ? 6 : 22);
  b.setting.sensors = 2 + below(random, 5);
  b.setting.voltmeter = chance(random, 0.5);
  b.setting.long_recording = log == nullptr && chance(random, 0.25);
  b.setting.step_s = b.setting.long_recording ? 10 : 1;
  b.setting.capacity_ah = b.cell.capacity_ah;
  b.setting.r0_ohm = b.cell.r0_ohm.at(0.5);
  b.unequal = draw_inequality(random);
  b.steepness_k = between(random, 2'000, 4'000);
  b.staggered_s = chance(random, 0.35) ? b.setting.step_s * between(random, 0.3, 0.95) : 0;
  b.start_soc = full_soc + between(random, -0.01, 0.005);
  b.fine_s = b.setting.step_s / static_cast<double>(fine_per_row);
  b.ambient_c = between(random, 23, 27);
  b.current_a = draw_profile_a(b, log, random);
  b.current_a.resize(b.current_a.size() / fine_per_row * fine_per_row);
  return b;
}

/// The world of one cell: the pack's current, its own state and surroundings, and the faults that are physics.
World world_of(const Build& b, const std::vector<PackFault>& faults, std::size_t cell) {
  plant::Random random(derived_seed(b.seed, 10 + cell));
  World w;
  w.stimulus.step_s = b.fine_s;
  w.stimulus.current_a = b.current_a;
  // the cells in the middle are warmer
  const double place = static_cast<double>(cell) / static_cast<double>(b.setting.cells - 1);
  w.stimulus.ambient_c.assign(b.current_a.size(), b.ambient_c + b.unequal.warmer_k * (4 * place * (1 - place) - 0.5));
  w.start_soc = b.start_soc + b.unequal.soc * random.normal() + size_of(faults, "charge_imbalance", cell);
  w.cell.capacity_factor = (1 + b.unequal.capacity * random.normal()) * (1 - size_of(faults, "capacity_change", cell));
  const double growth = size_of(faults, "resistance_growth", cell);
  w.cell.growth.of_r0 = (1 + b.unequal.r0 * random.normal()) * (1 + growth) - 1;
  w.cell.growth.of_r1 = (1 + b.unequal.r1 * random.normal()) * (1 + growth * between(random, 0.7, 1.3)) - 1;
  w.cell.growth.c1_exponent = between(random, 0, 0.5);
  w.cell.growth.r0_tilt = growth > 0 ? between(random, -0.3, 0.3) : 0;
  w.cell.temperature_law = {.steepness_k = b.steepness_k, .zero_k = 0, .share_of_r0 = between(random, 0.8, 1)};
  w.cell.leak.at_3v3_a = size_of(faults, "leakage", cell) * b.cell.capacity_ah / 24;
  w.cell.contact_scale =
      b.setting.r0_ohm * b.unequal.joint * random.normal() + size_of(faults, "joint_resistance", cell);
  w.cell.contact_ohm.assign(b.current_a.size(), 1.0);
  return w;
}

/// How late a channel is sampled, in fine steps.
std::size_t steps_late(const Build& b, const std::vector<PackFault>& faults, std::size_t cell) {
  const double place = static_cast<double>(cell) / static_cast<double>(b.setting.cells);
  const double delay_s = b.staggered_s * place + size_of(faults, "channel_skew", cell);
  return static_cast<std::size_t>(std::lround(delay_s / b.fine_s));
}

/// What one channel reads of a voltage: sampled late, with its own errors, held.
std::vector<double> channel_of(const Build& b, const std::vector<PackFault>& faults, std::size_t cell,
                               const std::vector<double>& fine_v) {
  plant::Random random(derived_seed(b.seed, 2'000 + cell));
  const double gain = b.unequal.gain * random.normal() + size_of(faults, "voltage_gain", cell);
  double offset_v = b.unequal.offset_v * random.normal() + size_of(faults, "voltage_offset", cell) +
                    size_of(faults, "sense_wire", cell);
  if (cell > 0) offset_v -= size_of(faults, "sense_wire", cell - 1);
  const std::size_t late = steps_late(b, faults, cell);
  std::vector<double> values;
  for (std::size_t k = fine_per_row - 1; k < fine_v.size(); k += fine_per_row)
    values.push_back((1 + gain) * fine_v[k > late ? k - late : 0] + offset_v);
  plant::Channel channel(b.lab.instruments.voltage_v, derived_seed(b.seed, 3'000 + cell));
  values = read_by(channel, b.setting.step_s, values);
  const double held_s = size_of(faults, "channel_held", cell);
  if (held_s > 0) {
    const auto rows = static_cast<std::size_t>(std::lround(held_s / b.setting.step_s)), phase = below(random, rows);
    for (std::size_t k = 1; k < values.size(); ++k) {
      if ((k + phase) % rows != 0) values[k] = values[k - 1];
    }
  }
  return values;
}

std::vector<double> current_of(const Build& b, const std::vector<PackFault>& faults) {
  std::vector<double> mean;
  for (std::size_t k = 0; k < b.current_a.size(); k += fine_per_row) {
    double sum = 0;
    for (std::size_t j = 0; j < fine_per_row; ++j) sum += b.current_a[k + j];
    mean.push_back(sum / fine_per_row + size_of(faults, "current_offset"));
  }
  return read_by(plant::Channel(b.lab.instruments.current_a, derived_seed(b.seed, 4'000)), b.setting.step_s, mean);
}

std::vector<double> rows_of(const std::vector<double>& fine) {
  std::vector<double> rows;
  for (std::size_t k = fine_per_row - 1; k < fine.size(); k += fine_per_row) rows.push_back(fine[k]);
  return rows;
}

/// The sensor sits on the cell in the middle of its share of the cells.
std::vector<double> sensor_of(const Build& b, const std::vector<PackFault>& faults, std::size_t sensor,
                              const std::vector<double>& fine_c) {
  plant::Random random(derived_seed(b.seed, 5'000 + sensor));
  std::vector<double> values = faulty_temperature_c({}, b.fine_s, fine_c);
  values = rows_of(values);
  const double offset_k = 0.4 * random.normal() + size_of(faults, "temperature_sensor", sensor);
  for (double& v : values) v += offset_k;
  return read_by(plant::Channel(b.lab.instruments.temperature_c, derived_seed(b.seed, 6'000 + sensor)),
                 b.setting.step_s, values);
}

/// It includes the cables, and the connections between the cells that no channel sees.
std::vector<double> voltmeter_of(const Build& b, const std::vector<PackFault>& faults, std::vector<double> sum_v) {
  plant::Random random(derived_seed(b.seed, 7'000));
  const double cells = static_cast<double>(b.setting.cells);
  const double gain = 0.0015 * random.normal() + size_of(faults, "pack_voltage");
  const double joint_ohm = cells * b.setting.r0_ohm * between(random, 0, 0.1);
  const std::vector<double> current_a = rows_of(b.current_a);
  for (std::size_t k = 0; k < sum_v.size(); ++k) sum_v[k] = (1 + gain) * (sum_v[k] + joint_ohm * current_a[k]);
  plant::ChannelParameters chain = b.lab.instruments.voltage_v;
  for (double* part : {&chain.drift_sigma, &chain.noise_sigma, &chain.step}) *part *= std::sqrt(cells) * 2;
  return read_by(plant::Channel(chain, derived_seed(b.seed, 8'000)), b.setting.step_s, sum_v);
}

/// The share of its charge that a cell has lost a day, on average over the recording: the leak depends on the voltage.
double mean_leak(const Build& b, const World& world, const std::vector<double>& fine_v) {
  const Leak& leak = world.cell.leak;
  double sum_a = 0;
  for (const double v : fine_v) sum_a += leak.at_3v3_a * growth_of(leak, v);
  const double capacity_ah = b.cell.capacity_ah * world.cell.capacity_factor;
  return 24 * sum_a / static_cast<double>(fine_v.size()) / capacity_ah;
}

/// Mean over the channels that have no fault of their own, except this one.
double usual_steps_late(const Build& b, const std::vector<PackFault>& faults, std::size_t except) {
  double sum = 0, count = 0;
  for (std::size_t k = 0; k < b.setting.cells; ++k) {
    const bool own = size_of(faults, "channel_skew", k) != 0 || size_of(faults, "channel_held", k) != 0;
    if (k == except || own) continue;
    sum += static_cast<double>(steps_late(b, faults, k));
    ++count;
  }
  return sum / count;
}

/// The sizes as they can be measured: what was simulated, relative to the other cells, on average over the recording.
std::vector<PackFault> measurable(const Build& b, std::vector<PackFault> faults, const std::vector<double>& leaks) {
  const std::vector<PackFault> planted = faults;
  for (PackFault& f : faults) {
    if (f.id == "leakage") f.size = leaks[*f.cell];
    if (f.id == "channel_skew")
      f.size =
          b.fine_s * (static_cast<double>(steps_late(b, planted, *f.cell)) - usual_steps_late(b, planted, *f.cell));
  }
  if (b.staggered_s == 0) return faults;
  const std::size_t last = steps_late(b, {}, b.setting.cells - 1);
  faults.push_back(
      {.id = "channels_staggered", .cell = {}, .size = b.fine_s * static_cast<double>(last), .of_data = true});
  return faults;
}

PackCase make(std::uint64_t seed, std::size_t index, bool healthy, std::string_view only, const SlowLog* log) {
  const std::uint64_t own = derived_seed(derived_seed(seed, 0x9AC4), 2 * index + (healthy ? 1 : 0));
  plant::Random random(own);
  const Build b = draw_build(own, log, random);
  PackCase c;
  c.name = "pack " + std::to_string(index + 1) + (healthy ? " healthy" : "");
  c.cell = calibrate(b.cell, b.lab.calibration_share, random);
  c.given_initial_soc = b.start_soc + c.cell.initial_soc_tolerance * between(random, -0.6, 0.6);
  if (!healthy) c.faults = draw_pack_faults(b.setting, only, random);
  const std::size_t cells = b.setting.cells, sensors = b.setting.sensors;
  std::vector<double> sum_v, leaks;
  c.recording.sensor_c.resize(sensors);
  for (std::size_t k = 0; k < cells; ++k) {
    const World world = world_of(b, c.faults, k);
    const CellTrace trace = run_cell(b.cell, world.cell, world.stimulus, world.start_soc);
    c.recording.cell_v.push_back(channel_of(b, c.faults, k, trace.voltage_v));
    leaks.push_back(mean_leak(b, world, trace.voltage_v));
    const std::vector<double> row_v = rows_of(trace.voltage_v);
    sum_v.resize(row_v.size(), 0.0);
    for (std::size_t r = 0; r < row_v.size(); ++r) sum_v[r] += row_v[r];
    for (std::size_t m = 0; m < sensors; ++m) {
      if (k == (2 * m + 1) * cells / (2 * sensors))
        c.recording.sensor_c[m] = sensor_of(b, c.faults, m, trace.temperature_c);
    }
  }
  c.recording.current_a = current_of(b, c.faults);
  if (b.setting.voltmeter) c.recording.pack_v = voltmeter_of(b, c.faults, sum_v);
  for (std::size_t k = 0; k < sum_v.size(); ++k)
    c.recording.time_s.push_back(static_cast<double>(k) * b.setting.step_s);
  c.hours = c.recording.time_s.back() / 3'600;
  c.faults = measurable(b, c.faults, leaks);
  return c;
}

}  // namespace

PackCase make_pack(std::uint64_t seed, std::size_t index, bool healthy, std::string_view only) {
  return make(seed, index, healthy, only, nullptr);
}

PackCase make_slow_pack(std::uint64_t seed, std::size_t index, bool healthy, std::string_view only,
                        const SlowLog& log) {
  PackCase c = make(seed, index, healthy, only, &log);
  slow_down(c.recording, log.rows_s, log.samples_current);
  return c;
}

void slow_down(PackSeries& s, double rows_s, bool samples_current) {
  PackSeries slow = s;
  const auto of_rows = [&](const std::vector<double>& column, bool mean) {
    std::vector<double> values;
    double sum = 0, count = 0, since_s = s.time_s.front();
    for (std::size_t k = 0; k < column.size(); ++k) {
      sum += column[k];
      ++count;
      if (s.time_s[k] - since_s < rows_s && k > 0) continue;
      values.push_back(mean ? sum / count : column[k]);
      sum = count = 0;
      since_s = s.time_s[k];
    }
    return values;
  };
  slow.time_s = of_rows(s.time_s, false);
  slow.current_a = of_rows(s.current_a, !samples_current);
  for (auto* columns : {&slow.cell_v, &slow.sensor_c})
    for (auto& column : *columns) column = of_rows(column, false);
  slow.pack_v = of_rows(s.pack_v, false);
  s = std::move(slow);
}

}  // namespace bms::benchmark::truth
