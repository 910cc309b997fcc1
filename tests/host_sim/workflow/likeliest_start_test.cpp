// The start of a recording whose first voltage fits many states of charge.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "files/cell_file.hpp"
#include "replay/simulation.hpp"
#include "workflow/likeliest_start.hpp"

namespace bms::workflow {
namespace {

/// Pulses that discharge `depth` of the capacity of table9 in an hour, with the noise of a voltmeter.
measurement::Recording pulses(const files::CellFile& cell, double start, double depth) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 1e-3);
  std::vector<double> time_s, current_a, voltage_v;
  for (int k = 0; k <= 1'200; ++k) {
    time_s.push_back(3.0 * k);
    current_a.push_back(k < 20 || k % 40 < 10 ? 0 : -depth * cell.parameters.capacity_ah / 0.74);
  }
  const auto tables = model::prepare<double, model::max_intervals>(cell.parameters);
  for (const replay::SimulatedRow& row : replay::simulate({.cell = tables,
                                         .capacity_ah = cell.parameters.capacity_ah,
                                         .time_s = time_s,
                                         .current_a = current_a,
                                         .initial_soc = start}))
    voltage_v.push_back(row.voltage_v + noise(random));
  measurement::Recording r;
  r.time_s = time_s;
  r.current_a = current_a;
  r.voltage_v = voltage_v;
  return r;
}

TEST(LikeliestStart, IsFoundWhereTheFirstVoltageLeavesItOpen) {
  const files::CellFile cell = files::read_cell("table9");
  for (const double start : {0.5, 0.6, 0.7, 0.8, 0.9}) {
    const measurement::Recording r = pulses(cell, start, 0.45);
    for (const double first : {start - 0.15, start + 0.08})
      EXPECT_NEAR(likeliest_start(r, cell, {first, 0.1, false}).soc, start, 0.01) << first;
  }
}

TEST(LikeliestStart, LeavesAKnownStartAndOneThatTheRecordingDoesNotImprove) {
  const files::CellFile cell = files::read_cell("table9");
  const measurement::Recording deep = pulses(cell, 0.8, 0.45), shallow = pulses(cell, 0.55, 0.002);
  EXPECT_EQ(likeliest_start(deep, cell, {0.7, 0.1, true}).soc, 0.7) << "given by the user";
  EXPECT_EQ(likeliest_start(deep, cell, {0.77, 0.01, false}).soc, 0.77) << "known well";
  EXPECT_EQ(likeliest_start(shallow, cell, {0.55, 0.1, false}).soc, 0.55) << "fits already";
  EXPECT_EQ(likeliest_start(deep, cell, {0.7, 0.1, false}).sigma, 0.1);
}

}  // namespace
}  // namespace bms::workflow
