#include "host_sim/cell_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "host_sim/text_file.hpp"
#include "tests/host_sim/refusal.hpp"

namespace bms {
namespace {

using ::testing::HasSubstr;

std::string table9_text() { return read_file(BMS_SOURCE_DIR "/model/cells/table9.toml"); }

/// The one line that a bad file is refused with.
std::string refusal(const std::string& text) {
  return refusal_by("cell.toml", [&] { parse_cell(text, "cell.toml"); });
}

TEST(CellFile, HoldsThePapersTable9AndLimits) {
  const CellFile cell = read_cell("table9");
  EXPECT_EQ(cell.name, "table9");
  const auto& p = cell.parameters;
  EXPECT_EQ(p.capacity_ah, 6);
  EXPECT_EQ(p.limits.voltage_min_v, 2.0);
  EXPECT_EQ(p.limits.voltage_max_v, 3.65);
  ASSERT_EQ(p.ocv.b0_v.size, 10U);
  EXPECT_EQ(p.ocv.b0_v[9], 2.126);
  EXPECT_EQ(p.ocv.b1_v[0], 3.35);
  ASSERT_EQ(p.rc.soc.size, 10U);
  EXPECT_EQ(p.rc.r0_ohm[4], 0.013237);
  EXPECT_EQ(p.rc.r1_ohm[9], 0.0072376);
  EXPECT_EQ(p.rc.c1_f[0], 420.558);
  EXPECT_EQ(p.tolerance.ocv_v, 0.0015);
}

TEST(CellFile, EveryBuiltInCellIsAccepted) {
  ASSERT_EQ(built_in_cells().size(), 2U);
  for (const BuiltInCell& cell : built_in_cells()) EXPECT_EQ(read_cell(cell.name).name, cell.name);
}

TEST(CellFile, TellsWhichFileItIsByAHash) {
  const std::string text = table9_text();
  EXPECT_EQ(parse_cell(text, "a").hash, parse_cell(text, "b").hash);
  EXPECT_NE(parse_cell(text, "a").hash, parse_cell(text + "\n", "a").hash);
}

TEST(CellFile, WhatIsWrittenIsReadBackDigitForDigit) {
  for (const BuiltInCell& built_in : built_in_cells()) {
    CellFile cell = read_cell(built_in.name);
    cell.source = "with \"quotes\", a \\ and\na line";
    cell.parameters.ocv.half_gap_v.size = 0;
    for (std::size_t k = 0; k < cell.parameters.ocv.soc.size; ++k) cell.parameters.ocv.half_gap_v.push_back(0.01 / (1.0 + static_cast<double>(k)));
    cell.parameters.ocv.lean = -0.7;
    cell.at_temperature = {{-5, cell.parameters.rc}, {25, cell.parameters.rc}};
    cell.at_temperature[0].rc.r0_ohm[0] = 0.0371;
    const std::string text = cell_text(cell);
    const CellFile again = parse_cell(text, "again");
    EXPECT_EQ(cell_text(again), replaced(text, "a \\\\ and a line", "a \\\\ and a line"));
    EXPECT_EQ(again.parameters.rc.c1_f[2], cell.parameters.rc.c1_f[2]);
    EXPECT_EQ(again.parameters.ocv.half_gap_v[3], cell.parameters.ocv.half_gap_v[3]);
    EXPECT_EQ(again.parameters.noise.current_unknown_a, cell.parameters.noise.current_unknown_a);
    EXPECT_EQ(again.sources.at("rc"), cell.sources.at("rc"));
    ASSERT_EQ(again.at_temperature.size(), 2U);
    EXPECT_EQ(again.at_temperature[0].rc.r0_ohm[0], 0.0371);
    EXPECT_THAT(refusal(replaced(text, "temperature_c = 25.0", "temperature_c = -25.0")), HasSubstr("temperatures that ascend"));
    EXPECT_THAT(refusal(replaced(text, "0.0371", "7.0")), HasSubstr("'at_temperature.r0_ohm' at -5 degrees C is out of range"));
  }
}

TEST(CellFile, RefusesWhatIsOutOfRangeAndNamesKeyLineAndExpectation) {
  const std::string good = table9_text();
  EXPECT_THAT(refusal(replaced(good, "capacity_ah = 6.0", "capacity_ah = -6.0")), HasSubstr("'capacity_ah' is out of range, expected 0.01 to 1000 Ah"));
  EXPECT_THAT(refusal(replaced(good, "0.0140197", "0.9")), HasSubstr("'rc.r0_ohm'"));
  EXPECT_THAT(refusal(replaced(good, "420.558", "nan")), HasSubstr("'rc.c1_f'"));
  EXPECT_THAT(refusal(replaced(good, "3.35,  0.39", "-3.35,  0.39")), HasSubstr("a curve that rises"));
  EXPECT_THAT(refusal(replaced(good, "3.167", "3.267")), HasSubstr("pieces that meet within 5 mV"));
  EXPECT_THAT(refusal(replaced(good, "[0.0,   0.1,   0.2", "[0.0,   0.2,   0.1")), HasSubstr("edges that ascend"));
  EXPECT_THAT(refusal(replaced(good, "voltage_v = 0.001", "voltage_v = 0.0")), HasSubstr("'noise.voltage_v'"));
}

TEST(CellFile, NamesTheLineOfTheEntryThatIsWrong) {
  const std::string good = table9_text();
  const std::string line = refusal(replaced(good, "420.558", "1.0"));
  const std::string before = good.substr(0, good.find("420.558"));
  const auto number = 1 + std::count(before.begin(), before.end(), '\n');
  EXPECT_THAT(line, HasSubstr("cell.toml:" + std::to_string(number) + ":"));
}

TEST(CellFile, RefusesWhatIsMissingMisspeltOrOfTheWrongKind) {
  const std::string good = table9_text();
  EXPECT_THAT(refusal(""), HasSubstr("'name' is missing"));
  EXPECT_THAT(refusal("\x01\x02 not toml at all"), HasSubstr("expected a cell file in TOML"));
  const std::size_t last_key = good.rfind("drift_v");
  for (std::size_t end = 0; end < last_key; end += 97) refusal(good.substr(0, end));  // cut off anywhere
  EXPECT_THAT(refusal(replaced(good, "capacity_ah = 6.0", "capacity_ah = \"six\"")), HasSubstr("expected a number"));
  EXPECT_THAT(refusal(replaced(good, "capacity_ah = 6.0", "capacity_mah = 6000")), HasSubstr("'capacity_ah' is missing"));
  EXPECT_THAT(refusal(replaced(good, "model_v = 0.003", "model_v = 0.003\nmodell_v = 0.003")), HasSubstr("unknown key 'noise.modell_v'"));
  EXPECT_THAT(refusal(replaced(good, "0.7,  0.8,   0.9,   1.0]", "0.7,  0.8,   0.9]")), HasSubstr("ocv"));
  EXPECT_THAT(refusal(replaced(good, "name = \"table9\"", "name = \"../x\\\"\"")), HasSubstr("'name'"));
  EXPECT_THAT(refusal(replaced(good, "1927.32]", "[1927.32]]")), HasSubstr("expected a number"));
  std::string many = "0.5";
  for (int k = 0; k < 100; ++k) many += ", 0.5";
  EXPECT_THAT(refusal(replaced(good, "1927.32]", many + "]")), HasSubstr("at most 64 numbers"));
}

TEST(CellFile, AMissingFileIsRefusedWithTheNamesOfTheBuiltInCells) {
  try {
    read_cell("table10");
    FAIL();
  } catch (const BadInput& error) {
    EXPECT_THAT(error.what(), HasSubstr("table9, a123_26650"));
  }
  EXPECT_THROW(read_cell("/nowhere/cell.toml"), BadInput);
  EXPECT_THROW(read_cell("/tmp"), BadInput);
}

}  // namespace
}  // namespace bms
