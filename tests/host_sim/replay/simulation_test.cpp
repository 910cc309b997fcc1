#include "replay/simulation.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "experiments/experiment.hpp"
#include "files/cell_file.hpp"
#include "identification/goodness_of_fit.hpp"

namespace bms::replay {
namespace {

TEST(Simulation, CountsTheChargeAndRestsAtTheOpenCircuitVoltage) {
  const auto p = files::read_cell("table9").parameters;
  const auto cell = model::prepare<double, model::max_intervals>(p);
  std::vector<double> time_s, current_a;
  for (int k = 0; k <= 7'200; ++k) {
    time_s.push_back(k);
    current_a.push_back(k > 0 && k <= 1'800 ? -6 : 0);  // half an hour at 1C, then rest
  }
  const auto rows = simulate(
      {.cell = cell, .capacity_ah = p.capacity_ah, .time_s = time_s, .current_a = current_a, .initial_soc = 0.95});
  EXPECT_NEAR(rows.back().soc, 0.45, 1e-12);
  EXPECT_NEAR(rows.back().voltage_v, 3.281 + 0.01 * 0.45, 1e-9);
  EXPECT_NEAR(rows[1'800].voltage_v - rows[1'801].voltage_v, -6 * 0.0132 - 0.0085 * 6 * 0.082, 0.005);
}

TEST(Figures, FitIsEquationA6AndIgnoresMissingReadings) {
  identification::FitFigure fit;
  identification::ErrorFigure error;
  const double measured[] = {1, 2, 3, std::nan(""), 4}, simulated[] = {1, 2, 3, 7, 3};
  for (int k = 0; k < 5; ++k) {
    fit.add(measured[k], simulated[k]);
    error.add(measured[k] - simulated[k]);
  }
  EXPECT_NEAR(fit.percent(), 100 * (1 - 1 / std::sqrt(5.0)), 1e-12);
  EXPECT_EQ(error.count(), 4U);
  EXPECT_NEAR(error.rms(), 0.5, 1e-12);
  EXPECT_EQ(error.max(), 1);
}

TEST(Experiment, EveryProfileStaysWithin1CAndIsReproducible) {
  for (const experiments::Experiment& e : experiments::experiments()) {
    const auto a = *experiments::experiment(e.name, {.capacity_ah = 2.5}),
               b = *experiments::experiment(e.name, {.capacity_ah = 2.5});
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t k = 0; k < a.size(); ++k) {
      ASSERT_LE(std::abs(a[k].current_a), 2.5) << e.name << " at " << a[k].time_s;
      ASSERT_EQ(a[k].current_a, b[k].current_a);
    }
  }
  EXPECT_FALSE(experiments::experiment("no_such_thing", {}).has_value());
}

TEST(Experiment, DiagnosticProfilesStayWithinTheCellAndHaveInstructions) {
  int designs = 0;
  for (const experiments::Experiment& e : experiments::experiments()) {
    if (std::isnan(e.start_soc)) continue;
    ++designs;
    EXPECT_FALSE(e.instruction.empty()) << e.name;
    double soc = e.start_soc, before_s = 0;
    const std::vector<experiments::ProfileRow> rows =
        experiments::experiment(e.name, {.capacity_ah = 2.5, .step_s = e.step_s}).value();
    for (const experiments::ProfileRow& row : rows) {
      soc += row.current_a * (row.time_s - before_s) / 3'600 / 2.5;
      before_s = row.time_s;
      ASSERT_GT(soc, 0.05) << e.name << " at " << row.time_s;
      ASSERT_LT(soc, 0.98) << e.name << " at " << row.time_s;
      if (row.contactor_open) {
        ASSERT_EQ(row.current_a, 0) << e.name;
      }
      if (std::isfinite(row.source_v)) {
        ASSERT_TRUE(row.contactor_open) << "the sense wires must not be disconnected from a loaded cell: " << e.name;
      }
    }
    EXPECT_LE(before_s, 12 * 3'600) << e.name;
  }
  EXPECT_GE(designs, 10);
}

}  // namespace
}  // namespace bms::replay
