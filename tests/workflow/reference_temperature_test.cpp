#include "workflow/reference_temperature.hpp"

#include <gtest/gtest.h>

#include "host_sim/simulation.hpp"

namespace bms::workflow {
namespace {

model::MechanismSetting setting(const files::CellFile& cell, std::string_view id, std::size_t parameter, double value) {
  model::MechanismSetting s = model::default_setting(model::mechanism_index(id), cell.parameters);
  s.value[parameter] = value;
  return s;
}

/// table9 whose resistances follow the temperature.
files::CellFile warm_cell() {
  files::CellFile cell = files::read_cell("table9");
  model::MechanismSetting s = setting(cell, "temperature_resistance", 0, 50'000);
  s.value[1] = 40'000;
  s.value[3] = 0.3;
  files::put_mechanism(cell, s);
  return cell;
}

std::vector<double> voltages(const files::CellFile& cell) {
  const auto tables = model::prepare<double, model::max_intervals>(cell.parameters);
  std::vector<double> time_s, current_a, temperature_c, v;
  for (int k = 0; k < 3'000; ++k) {
    time_s.push_back(k);
    current_a.push_back(k / 100 % 3 == 0 ? 0 : 6 - k / 100 % 5 * 3);
    temperature_c.push_back(-10 + k * 0.02);
  }
  for (const auto& row : host_sim::simulate({.cell = tables,
                         .capacity_ah = cell.parameters.capacity_ah,
                         .mechanisms = cell.mechanisms,
                         .time_s = time_s,
                         .current_a = current_a,
                         .temperature_c = temperature_c,
                         .initial_soc = 0.6}))
    v.push_back(row.voltage_v);
  return v;
}

TEST(ReferenceTemperature, MovedResistancesGiveTheSameVoltages) {
  const files::CellFile before = warm_cell();
  for (const double c : {20.0, 33.0}) {
    files::CellFile after = before;
    move_resistances(after, c);
    EXPECT_NE(after.parameters.rc.r0_ohm[4], before.parameters.rc.r0_ohm[4]);
    EXPECT_EQ(after.mechanisms[0].value[2], c);
    const auto v = voltages(after), expected = voltages(before);
    for (std::size_t k = 0; k < v.size(); ++k) ASSERT_NEAR(v[k], expected[k], 1e-12) << k;
  }
}

TEST(ReferenceTemperature, WithoutTheMechanismNothingMoves) {
  files::CellFile cell = files::read_cell("table9");
  move_resistances(cell, -10);
  EXPECT_EQ(files::cell_text(cell), files::cell_text(files::read_cell("table9")));
}

TEST(ReferenceTemperature, IdentifiedTablesChangeTheReferenceOfWhatBelongsToThem) {
  files::CellFile cell = warm_cell();
  files::put_mechanism(cell, setting(cell, "self_heating", 0, 2));
  files::put_mechanism(cell, setting(cell, "entropic_ocv", 0, 1e-4));
  cell.parameters.reference_temperature_c = 20;
  const auto reference = [&](std::size_t mechanism, std::size_t parameter) {
    return cell.mechanisms[mechanism].value[parameter];
  };
  state_reference(cell, false);
  EXPECT_EQ(reference(0, 3), 20) << "self_heating";
  EXPECT_EQ(reference(1, 2), 20) << "temperature_resistance";
  EXPECT_EQ(reference(2, 4), 25) << "the OCV is still that of 25 degrees C";
  state_reference(cell, true);
  EXPECT_EQ(reference(2, 4), 20);
}

}  // namespace
}  // namespace bms::workflow
