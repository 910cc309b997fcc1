// The estimator against cell files with mechanisms at their bounds and in random sets, and against samples that no
// sensor should give, in float, double and fixed point. Each life: blows, then twelve hours of honest data from the
// model itself. Prints a line for each scalar; exit code 1 if a result is not a number, a sigma is not above 0, or a
// life is not back within 5 %. Each life that is not back is printed with its mechanisms.
//
//   hostile_steps STEPS [SEED]      STEPS: of the estimator, in all
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <string>

#include <fmt/format.h>

#include "files/cell_file.hpp"
#include "model/possible_cell.hpp"
#include "replay/replay.hpp"

namespace bms {
namespace {

using Random = std::mt19937_64;
using replay::ScalarKind;

constexpr int honest_s = 12 * 3'600;
constexpr double back_within = 0.05;

struct Tally {
  std::uint64_t lives = 0, steps = 0, not_finite = 0, certain = 0, started_again = 0;
  std::uint64_t not_back = 0, and_certain = 0;  ///< beyond 5 %; and beyond two sigma as well
  double least_sigma = 1, worst = 0;
};

double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// One parameter: left out, at a bound, a hair inside, or anywhere between.
double value_of(Random& random, double usual, double low, double high) {
  switch (random() % 8) {
    case 0:
    case 1:
      return low;
    case 2:
    case 3:
      return high;
    case 4:
      return low + 1e-12 * (high - low);
    case 5:
      return usual;
    default:
      return between(random, low, high);
  }
}

/// Up to seven mechanisms, each once, that run on a board with this scalar and that a cell file may have together.
std::vector<model::MechanismSetting> random_mechanisms(Random& random, const files::CellFile& cell, ScalarKind scalar) {
  std::vector<model::MechanismSetting> all;
  const double capacity_ah = cell.parameters.capacity_ah;
  const std::uint64_t chosen = random() % 8;
  for (std::size_t k = 0; k < model::mechanism_count && all.size() < chosen; ++k) {
    const model::MechanismInfo& info = model::catalogue[k];
    if (!info.on_board || (info.needs_fpu && scalar == ScalarKind::fixed) || random() % 3 == 0) continue;
    model::MechanismSetting setting = model::default_setting(k, cell.parameters);
    for (std::size_t i = 0; i < info.parameters; ++i) {
      setting.value[i] = value_of(random, setting.value[i], info.parameter[i].lower(capacity_ah),
                                  info.parameter[i].upper(capacity_ah));
    }
    if (model::first_fault(setting, capacity_ah) == info.parameters) all.push_back(setting);
  }
  const bool computable = scalar != ScalarKind::fixed || model::fits_fixed_point(cell.parameters, all);
  if (!computable || model::first_impossible_ocv(cell.parameters, all)) return random_mechanisms(random, cell, scalar);
  return all;
}

std::int32_t micro(double value) {
  return static_cast<std::int32_t>(std::lround(1e6 * std::clamp(value, -2'147.0, 2'147.0)));
}

/// A life: the true SOC at its end, and the samples.
struct Life {
  std::vector<measurement::Sample> samples;
  double soc = 0;
};

/// Damages an honest sample.
void strike(Random& random, std::uint64_t kind, measurement::Sample& s, double& duration_s) {
  constexpr std::int32_t most = std::numeric_limits<std::int32_t>::max();
  switch (kind) {
    case 0:
      s.current_ua = measurement::no_reading;
      break;
    case 1:
      s.voltage_uv = measurement::no_reading;
      break;
    case 2:
      s.current_ua = random() % 2 == 0 ? most : -most;
      break;
    case 3:
      s.voltage_uv = random() % 2 == 0 ? most : 0;
      break;
    case 4:
      s.temperature_cdegc = static_cast<std::int16_t>(random());
      break;
    case 5:
      duration_s = 2.6e6;
      break;
    case 6:
      duration_s = 0;
      break;
    case 7:
      s.current_ua = static_cast<std::int32_t>(random());
      s.voltage_uv = static_cast<std::int32_t>(random());
      duration_s = between(random, 0, 100);
      break;
    default:
      break;
  }
}

Life random_life(Random& random, const files::CellFile& cell) {
  const auto tables = model::prepare<double, model::max_intervals>(cell.parameters);
  auto mechanisms = files::on_board(cell.mechanisms);
  for (model::MechanismSetting& m : mechanisms) {  // a board has no time of a recording: a step acts from the start
    if (m.index == model::mechanism_index_of<model::ContactStep>) m.value[1] = -1e12;
  }
  model::OpenLoopSimulation<double> plant(tables, cell.parameters.capacity_ah,
                                          model::chosen<double>(mechanisms, cell.parameters.capacity_ah),
                                          between(random, 0.1, 0.9));
  Life life;
  double time_s = between(random, 0, 1e6);
  std::normal_distribution<double> noise_v(0, 0.001);
  const double c_rate_a = cell.parameters.capacity_ah;
  double direction = -1;
  const auto honest = [&](double current_a, double duration_s) {
    time_s += duration_s;
    const double v = plant.step(time_s, duration_s, current_a, 25.0, [](auto&, double) {});
    measurement::Sample s;
    s.time_us = static_cast<std::uint64_t>(1e6 * time_s);
    s.current_ua = micro(current_a);
    s.voltage_uv = micro(v + noise_v(random));
    s.temperature_cdegc = 2'500;
    return s;
  };
  for (std::uint64_t blows = random() % 6; blows > 0; --blows) {
    const std::uint64_t kind = random() % 10;
    for (std::uint64_t k = random() % 200; k > 0; --k) {
      measurement::Sample s = honest(between(random, -c_rate_a, c_rate_a), 1);
      double duration_s = 1;
      strike(random, kind, s, duration_s);
      time_s += duration_s - 1;  // the plant rests in a gap
      s.time_us = static_cast<std::uint64_t>(1e6 * time_s);
      life.samples.push_back(s);
    }
  }
  for (int k = 0; k < honest_s; ++k) {
    if (plant.soc() < 0.06) direction = 1;
    if (plant.soc() > 0.97) direction = -1;
    life.samples.push_back(honest(direction * (k / 60 % 3 != 0 ? 0.7 : 0.1) * c_rate_a, 1));
  }
  life.soc = plant.soc();
  return life;
}

void live(Random& random, ScalarKind scalar, Tally& tally) {
  files::CellFile cell = files::read_cell("table9");
  cell.mechanisms = random_mechanisms(random, cell, scalar);
  cell.parameters.noise.errors_are_states = random() % 3 == 0;
  const Life life = random_life(random, cell);
  std::optional<measurement::StartingPoint> start;
  if (random() % 2 == 0) start = {static_cast<std::int32_t>(random()), static_cast<std::int32_t>(random())};
  const replay::Track track = replay::run_on_host(cell, life.samples, start, scalar);
  for (const replay::EstimateRow& row : track.rows) {
    ++tally.steps;
    const bool finite = std::isfinite(row.soc) && std::isfinite(row.soc_sigma) && std::isfinite(row.v_rc_v) &&
                        std::isfinite(row.voltage_predicted_v);
    if (!finite) ++tally.not_finite;
    if (!(row.soc_sigma > 0)) ++tally.certain;
    if ((row.flags & estimator::not_a_number) != 0) ++tally.started_again;
    tally.least_sigma = std::min(tally.least_sigma, row.soc_sigma);
  }
  ++tally.lives;
  const double error = std::abs(track.rows.back().soc - life.soc);
  tally.worst = std::max(tally.worst, error);
  if (error < back_within) return;
  ++tally.not_back;
  if (error > 2 * track.rows.back().soc_sigma) ++tally.and_certain;
  std::string names;
  for (const model::MechanismSetting& m : cell.mechanisms) {
    const model::MechanismInfo& info = model::catalogue[m.index];
    names += fmt::format("\n    {}", info.id);
    for (std::size_t k = 0; k < info.parameters; ++k)
      names += fmt::format(" {}={:g}", info.parameter[k].name, m.value[k]);
  }
  fmt::print("  life {}: soc {:.3f} +- {:.3f}, truth {:.3f}, flags {:#x}, errors as states {},{}\n", tally.lives,
             track.rows.back().soc, track.rows.back().soc_sigma, life.soc, track.rows.back().flags,
             cell.parameters.noise.errors_are_states, names);
}

int run(std::uint64_t steps, std::uint64_t seed) {
  bool good = true;
  for (const auto& [scalar, name] :
       {std::pair{ScalarKind::float32, "float"}, {ScalarKind::float64, "double"}, {ScalarKind::fixed, "fixed"}}) {
    Random random(seed);
    Tally t;
    while (t.steps < steps / 3) live(random, scalar, t);
    fmt::print(
        "{}: {} lives, {} steps; not finite {}, sigma 0 {}, started again {}; least sigma {:.2g}; not back within 5 % "
        "after 12 h {}, of these beyond two sigma {}, worst {:.3f}\n",
        name, t.lives, t.steps, t.not_finite, t.certain, t.started_again, t.least_sigma, t.not_back, t.and_certain,
        t.worst);
    good = good && t.not_finite + t.certain + t.not_back == 0;
  }
  return good ? 0 : 1;
}

}  // namespace
}  // namespace bms

int main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "hostile_steps STEPS [SEED]\n");
    return 2;
  }
  return bms::run(std::stoull(argv[1]), argc > 2 ? std::stoull(argv[2]) : 1);
}
