// One cell, one start: simulation, replay, diagnosis, identification and their hold-outs compute the same voltage.
#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "replay/replay.hpp"
#include "replay/simulation.hpp"
#include "workflow/diagnose_recordings.hpp"
#include "workflow/diagnosis_comparison.hpp"

namespace bms::workflow {
namespace {

using testing::HasSubstr;
using Random = std::mt19937_64;

double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// A mechanism half as strong as a cell file may state it, at most.
model::MechanismSetting drawn(Random& random, std::size_t index, const model::CellParameters<>& cell) {
  model::MechanismSetting setting = model::default_setting(index, cell);
  for (std::size_t k = 0; k < model::catalogue[index].parameters; ++k) {
    const model::Parameter& p = model::catalogue[index].parameter[k];
    const double at = between(random, -0.5, 0.5);
    const double bound = at < 0 ? p.lower(cell.capacity_ah) : p.upper(cell.capacity_ah);
    if (!p.is_reference_temperature) setting.value[k] += std::abs(at) * (bound - setting.value[k]);
  }
  return setting;
}

/// Pulses of both directions, with the voltage of a simulation and noise. The state of charge stays near its start.
measurement::Recording recording_of(Random& random, const files::CellFile& cell, double start) {
  std::vector<double> time_s, current_a, temperature_c;
  const double one_c = cell.parameters.capacity_ah;
  for (int k = 0; k < 400; ++k) {
    time_s.push_back(2.0 * k);
    const double load_a = (start > 0.5 ? -0.4 : 0.4) * one_c;
    const bool loaded = k > 5 && k % 50 < 30, back = k % 100 >= 70;
    current_a.push_back(loaded ? load_a * (back ? -0.5 : 1.0) : 0);
    temperature_c.push_back(25 + 5 * std::sin(k / 60.0));
  }
  measurement::Recording r;
  r.path = "drawn.csv";
  r.time_s = time_s;
  r.current_a = current_a;
  r.temperature_c = temperature_c;
  const auto tables = model::prepare<double, model::max_intervals>(cell.parameters);
  std::vector<double> voltage_v;
  for (const replay::SimulatedRow& row : replay::simulate(
           {.cell = tables, .capacity_ah = one_c, .time_s = time_s, .current_a = current_a, .initial_soc = start}))
    voltage_v.push_back(row.voltage_v + between(random, -0.01, 0.01));
  r.voltage_v = voltage_v;
  return r;
}

double rms_error_v(const measurement::Column& measured_v, const std::vector<double>& simulated_v) {
  double sum = 0;
  for (std::size_t k = 0; k < simulated_v.size(); ++k) sum += std::pow(measured_v[k] - simulated_v[k], 2);
  return std::sqrt(sum / static_cast<double>(simulated_v.size()));
}

/// The error of one recording by each way through the code.
struct Errors {
  double simulate_v = 0, replay_v = 0, diagnosed_v = 0, held_out_v = 0, identified_v = 0;
};

Errors errors_of(const files::CellFile& cell, const measurement::Recording& r, std::optional<double> given) {
  const StartSoc start = recording_start(r, cell, given).start;
  Errors e;
  const auto tables = model::prepare<double, model::max_intervals>(cell.parameters);
  std::vector<double> simulated_v;
  for (const replay::SimulatedRow& row : replay::simulate({.cell = tables,
                                         .capacity_ah = cell.parameters.capacity_ah,
                                         .mechanisms = cell.mechanisms,
                                         .time_s = r.time_s,
                                         .current_a = r.current_a,
                                         .temperature_c = r.temperature_c,
                                         .initial_soc = start.soc}))
    simulated_v.push_back(row.voltage_v);
  e.simulate_v = rms_error_v(r.voltage_v, simulated_v);

  replay::ReplayResult replay;
  replay.recording = r;
  replay.cell = cell;
  replay.open_loop_soc = start.soc;
  replay.track =
      replay::run_on_host(cell, measurement::SampleList(r), {}, replay::ScalarKind::float64, replay::Timing::none);
  replay::evaluate(replay);
  e.replay_v = rms_error_v(r.voltage_v, replay.open_loop_v);

  DiagnoseResult diagnosed;
  diagnosed.cell = diagnosed.extended_cell = cell;
  diagnosed.diagnosis.cell = cell.parameters;
  diagnosed.recordings = {prepared(r, "drawn", cell, start)};
  diagnosed.holdouts = diagnosed.recordings;
  compare_recordings(diagnosed);
  compare_holdouts(diagnosed);
  e.diagnosed_v = rms_error_v(r.voltage_v, diagnosed.recordings.front().extended_v);
  e.held_out_v = rms_error_v(r.voltage_v, diagnosed.holdouts.front().extended_v);
  e.identified_v = coverage_of(cell, diagnosed.holdouts.front().record).error_v();
  return e;
}

TEST(OneStart, GivesTheSameErrorInEveryCommand) {
  constexpr double microvolt = 1e-6;
  Random random(4711);
  std::vector<files::CellFile> cells;
  for (const char* name : {"table9", "a123_26650", "a123_26650_extended", "a123_esctoolbox_extended"})
    cells.push_back(files::read_cell(name));
  for (std::size_t n = 0; n < 104; ++n) {
    files::CellFile cell = cells[n % cells.size()];
    const bool as_built_in = n < 2 * cells.size();
    for (std::size_t k = 0; k < (as_built_in ? 0U : 3U); ++k) {
      const std::size_t index = k == 0 ? n % model::mechanism_count : random() % model::mechanism_count;
      files::put_mechanism(cell, drawn(random, index, cell.parameters));
    }
    constexpr std::array<std::array<double, 2>, 3> from = {{{0.905, 1}, {0.02, 0.095}, {0.2, 0.8}}};
    const double start = between(random, from[n % 3][0], from[n % 3][1]);
    measurement::Recording r = recording_of(random, cell, start);
    if (n % 2 == 0) r.soc_ref = std::vector<double>(r.rows(), start);
    const Errors e = errors_of(cell, r, n % 2 == 0 ? std::nullopt : std::optional(start));
    std::string mechanisms;
    for (const model::MechanismSetting& m : cell.mechanisms)
      mechanisms += fmt::format(" {}", model::catalogue[m.index].id);
    for (const double other_v : {e.replay_v, e.diagnosed_v, e.held_out_v, e.identified_v})
      EXPECT_NEAR(other_v, e.simulate_v, microvolt) << n << ":" << mechanisms << ", from " << start;
  }
}

TEST(OneStart, OfAHysteresisFollowsTheStateOfCharge) {
  EXPECT_EQ(model::start_position(0, 0.98).position, 1) << "a full cell was charged last";
  EXPECT_EQ(model::start_position(0, 0.02).position, -1) << "an empty one discharged";
  EXPECT_EQ(model::start_position(0, 0.5).position, 0);
  EXPECT_EQ(model::start_position(-0.4, 0.98).position, -0.4) << "the cell file states it";
  EXPECT_FALSE(model::start_position(-0.4, 0.98).known);
  const files::CellFile cell = files::read_cell("a123_26650_extended");
  Random random(1);
  const measurement::Recording r = recording_of(random, cell, 0.97);
  const auto first_v = [&](double initial) {
    files::CellFile with = cell;
    for (model::MechanismSetting& m : with.mechanisms) {
      if (m.index == model::mechanism_index_of<model::OcvHysteresis>) m.value[3] = initial;
    }
    const auto tables = model::prepare<double, model::max_intervals>(with.parameters);
    return replay::simulate({.cell = tables,
                             .capacity_ah = with.parameters.capacity_ah,
                             .mechanisms = with.mechanisms,
                             .time_s = r.time_s,
                             .current_a = r.current_a,
                             .temperature_c = r.temperature_c,
                             .initial_soc = 0.97})
        .front()
        .voltage_v;
  };
  EXPECT_EQ(first_v(0), first_v(1));
  EXPECT_GT(first_v(0), first_v(-1) + 0.01);
}

TEST(RecordingStart, IsTheUsersThenTheColumnsThenThatOfTheFirstVoltage) {
  const files::CellFile cell = files::read_cell("table9");
  Random random(2);
  measurement::Recording r = recording_of(random, cell, 0.1);
  EXPECT_NEAR(recording_start(r, cell).start.soc, 0.1, 0.05);
  EXPECT_FALSE(recording_start(r, cell).start.given);
  r.soc_ref = std::vector<double>(r.rows(), 0.11);
  EXPECT_EQ(recording_start(r, cell).start.soc, 0.11);
  EXPECT_EQ(recording_start(r, cell, 0.12).start.soc, 0.12);
  EXPECT_TRUE(recording_start(r, cell, 0.11).contradiction.empty());
}

TEST(RecordingStart, SaysWhatContradictsItWithNumbers) {
  const files::CellFile cell = files::read_cell("table9");
  Random random(3);
  measurement::Recording r = recording_of(random, cell, 0.98);
  const RecordingStart by_voltage = recording_start(r, cell, 0.3);
  ASSERT_TRUE(by_voltage.start.contradicted_by.has_value());
  EXPECT_NEAR(*by_voltage.start.contradicted_by, 0.98, 0.03);
  EXPECT_THAT(by_voltage.contradiction, HasSubstr("the start of 30.0 % (--initial-soc) is contradicted"));
  EXPECT_THAT(by_voltage.contradiction, HasSubstr("V at rest, is that of"));
  r.soc_ref = std::vector<double>(r.rows(), 0.98);
  const RecordingStart by_column = recording_start(r, cell, 0.3);
  EXPECT_EQ(by_column.start.contradicted_by, 0.98);
  EXPECT_THAT(by_column.contradiction, HasSubstr("the column soc_ref begins at 98.0 %"));
  r.soc_ref = std::vector<double>(r.rows(), 0.3);
  EXPECT_THAT(recording_start(r, cell).contradiction, HasSubstr("(first value of soc_ref) is contradicted"));
}

}  // namespace
}  // namespace bms::workflow
