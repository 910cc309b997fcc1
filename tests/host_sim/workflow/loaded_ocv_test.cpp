// The truth is written down here, not taken from the project's own model: a curve, and a resistance that rises near
// empty.
#include "workflow/loaded_ocv.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "files/cell_file.hpp"

namespace bms::workflow {
namespace {

double true_ocv_v(double soc) { return 3.3 + 0.9 * soc - 0.25 * std::exp(-soc / 0.04); }
double true_ohm(double soc) { return 0.1 + 0.15 * std::exp(-soc / 0.03); }

/// From full at a constant current, ten seconds of rest before and two minutes after.
measurement::Recording discharge(double load_a, double capacity_ah, double down_to, double resistance_times = 1) {
  measurement::Recording r;
  double soc = 1, time_s = 0;
  const auto add = [&](double dt_s, double a) {
    time_s += dt_s;
    soc += a * dt_s / (3'600 * capacity_ah);
    r.time_s.edit().push_back(time_s);
    r.current_a.edit().push_back(a);
    r.voltage_v.edit().push_back(true_ocv_v(soc) + a * resistance_times * true_ohm(soc));
  };
  add(0, 0);
  while (soc > down_to) add(18, -load_a);
  for (int k = 0; k < 6; ++k) add(20, 0);
  return r;
}

double ocv_v(const model::OcvTable<double>& ocv, double soc) {
  std::size_t k = 0;
  while (k + 2 < ocv.soc.size && soc >= ocv.soc[k + 1]) ++k;
  return ocv.b0_v[k] + ocv.b1_v[k] * soc;
}

TEST(LoadedOcv, IsTheVoltageUnderLoadPlusTheDropOverTheResistanceOfTheSteps) {
  files::CellFile cell = files::read_cell("table9");
  cell.parameters.capacity_ah = 2;
  const measurement::Recording a = discharge(2, 2, 0.02), b = discharge(2, 2, 0.02, 1.04);
  const LoadedOcv found = take_ocv_from_load({{&a, 1}, {&b, 1}}, cell);
  EXPECT_EQ(found.steps, 4u);
  EXPECT_NEAR(found.soc_min, 0.02, 0.01);
  for (double soc = 0.15; soc < 0.99; soc += 0.02)
    EXPECT_NEAR(ocv_v(cell.parameters.ocv, soc), true_ocv_v(soc), 0.008) << soc;
  // near empty the resistance is known at the last step alone
  for (double soc = 0.03; soc < 0.15; soc += 0.02)
    EXPECT_NEAR(ocv_v(cell.parameters.ocv, soc), true_ocv_v(soc), 2 * 0.1) << soc;
  EXPECT_EQ(model::first_fault(cell.parameters).what, nullptr);
  // no more certain than the resistance that it rests on
  EXPECT_GT(found.error_v, 0.015);
  EXPECT_LT(found.error_v, 0.06);
}

TEST(LoadedOcv, RefusesARecordingWithoutAStepAndOneThatCoversLittle) {
  files::CellFile cell = files::read_cell("table9");
  cell.parameters.capacity_ah = 2;
  const measurement::Recording shallow = discharge(2, 2, 0.8);
  EXPECT_THROW(take_ocv_from_load({{&shallow, 1}}, cell), std::invalid_argument);
  measurement::Recording loaded = discharge(2, 2, 0.02);
  for (double& i : loaded.current_a.edit()) i = -2;
  EXPECT_THROW(take_ocv_from_load({{&loaded, 1}}, cell), std::invalid_argument);
}

}  // namespace
}  // namespace bms::workflow
