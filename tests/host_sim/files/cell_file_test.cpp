#include "files/cell_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <string>

#include "files/text_file.hpp"
#include "tests/host_sim/files/rejected_input.hpp"

namespace bms::files {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string table9_text() { return read_file(BMS_SOURCE_DIR "/model/cells/table9.toml"); }

/// The line with which a bad file is rejected.
std::string cell_refusal(const std::string& text) {
  return refusal_by("cell.toml", [&] { parse_cell(text, "cell.toml"); });
}

TEST(CellFile, Table9HasTheValuesAndLimitsOfThePaper) {
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
  ASSERT_EQ(built_in_cells().size(), 7U);
  for (const BuiltInCell& cell : built_in_cells()) EXPECT_EQ(read_cell(cell.name).name, cell.name);
}

TEST(CellFile, ReadsWhetherSensorErrorsAreStates) {
  const std::string without = table9_text(),
                    with = replaced(without, "\n[tolerance]", "errors_are_states = true\n\n[tolerance]");
  EXPECT_FALSE(parse_cell(without, "x").parameters.noise.errors_are_states);
  const CellFile cell = parse_cell(with, "x");
  EXPECT_TRUE(cell.parameters.noise.errors_are_states);
  EXPECT_TRUE(parse_cell(cell_text(cell), "x").parameters.noise.errors_are_states);
  EXPECT_THAT(cell_refusal(replaced(with, "errors_are_states = true", "errors_are_states = 1")),
              HasSubstr("'noise.errors_are_states' is not acceptable, expected true or false"));
}

constexpr const char* temperature_mechanisms = R"(
[mechanism.self_heating]
[mechanism.temperature_resistance]
[mechanism.entropic_ocv]
reference_c = 10
)";

/// The reference temperature of a mechanism.
double reference_of(const CellFile& cell, std::string_view id) {
  for (const model::MechanismSetting& m : cell.mechanisms) {
    const model::MechanismInfo& info = model::catalogue[m.index];
    for (std::size_t k = 0; k < info.parameters; ++k) {
      if (info.id == id && info.parameter[k].name == "reference_c") return m.value[k];
    }
  }
  throw std::runtime_error("not there");
}

TEST(CellFile, ReadsTheReferenceTemperatureAndItsMechanismsTakeIt) {
  const std::string without = table9_text() + temperature_mechanisms,
                    with = replaced(without, "capacity_ah = 6.0", "capacity_ah = 6.0\nreference_temperature_c = -12.5");
  const CellFile usual = parse_cell(without, "x"), cold = parse_cell(with, "x");
  EXPECT_EQ(usual.parameters.reference_temperature_c, 25);
  EXPECT_EQ(cold.parameters.reference_temperature_c, -12.5);
  for (const char* id : {"self_heating", "temperature_resistance"}) {
    EXPECT_EQ(reference_of(usual, id), 25) << id;
    EXPECT_EQ(reference_of(cold, id), -12.5) << id;
  }
  EXPECT_EQ(reference_of(cold, "entropic_ocv"), 10) << "its own";
  EXPECT_THAT(cell_text(usual), Not(HasSubstr("reference_temperature_c")));
  EXPECT_EQ(parse_cell(cell_text(cold), "x").parameters.reference_temperature_c, -12.5);
  EXPECT_EQ(cell_text(parse_cell(cell_text(cold), "x")), cell_text(cold));
}

TEST(CellFile, RejectsAReferenceTemperatureOutOfRangeWithItsLine) {
  for (const char* bad : {"-40.5", "80.5", "nan"}) {
    const std::string text = replaced(table9_text(), "capacity_ah = 6.0",
                                      std::string("capacity_ah = 6.0\nreference_temperature_c = ") + bad);
    const auto line =
        1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(text.find("reference_t")), '\n');
    EXPECT_EQ(cell_refusal(text), "cell.toml:" + std::to_string(line) +
                                      ": 'reference_temperature_c' is out of range, expected -40 to 80 degrees C");
  }
}

TEST(CellFile, IsIdentifiedByTheHashOfItsText) {
  const std::string text = table9_text();
  EXPECT_EQ(parse_cell(text, "a").hash, parse_cell(text, "b").hash);
  EXPECT_NE(parse_cell(text, "a").hash, parse_cell(text + "\n", "a").hash);
}

TEST(CellFile, WrittenValuesAreReadBackBitForBit) {
  for (const BuiltInCell& built_in : built_in_cells()) {
    CellFile cell = read_cell(built_in.name);
    cell.source = "with \"quotes\", a \\ and\na line";
    cell.parameters.ocv.half_gap_v.size = 0;
    for (std::size_t k = 0; k < cell.parameters.ocv.soc.size; ++k)
      cell.parameters.ocv.half_gap_v.push_back(0.01 / (1.0 + static_cast<double>(k)));
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
    EXPECT_THAT(cell_refusal(replaced(text, "temperature_c = 25.0", "temperature_c = -25.0")),
                HasSubstr("temperatures that ascend"));
    EXPECT_THAT(cell_refusal(replaced(text, "0.0371", "7.0")),
                HasSubstr("'at_temperature.r0_ohm' at -5 degrees C is out of range"));
  }
}

TEST(CellFile, RejectsValuesOutOfRangeAndNamesKeyLineAndRange) {
  const std::string good = table9_text();
  EXPECT_THAT(cell_refusal(replaced(good, "capacity_ah = 6.0", "capacity_ah = -6.0")),
              HasSubstr("'capacity_ah' is out of range, expected 0.01 to 1000 Ah"));
  EXPECT_THAT(cell_refusal(replaced(good, "0.0140197", "0.9")), HasSubstr("'rc.r0_ohm'"));
  EXPECT_THAT(cell_refusal(replaced(good, "420.558", "nan")), HasSubstr("'rc.c1_f'"));
  EXPECT_THAT(cell_refusal(replaced(good, "3.35,  0.39", "-3.35,  0.39")), HasSubstr("a curve that rises"));
  EXPECT_THAT(cell_refusal(replaced(good, "3.167", "3.267")), HasSubstr("pieces that meet within 5 mV"));
  EXPECT_THAT(cell_refusal(replaced(good, "[0.0,   0.1,   0.2", "[0.0,   0.2,   0.1")), HasSubstr("edges that ascend"));
  EXPECT_THAT(cell_refusal(replaced(good, "voltage_v = 0.001", "voltage_v = 0.0")), HasSubstr("'noise.voltage_v'"));
}

TEST(CellFile, KnowsWhereItWasIdentifiedIfItStatesIt) {
  CellFile cell = read_cell("table9");
  EXPECT_EQ(cell.parameters.range.temperature_min_c, model::IdentifiedRange::unknown);
  EXPECT_EQ(cell_text(cell).find("[range]"), std::string::npos);
  cell.parameters.range.temperature_min_c = -5;
  cell.parameters.range.duration_s = 3'600;
  cell.parameters.tolerance.resistance_per_ev = 0.07;
  const CellFile again = parse_cell(cell_text(cell), "again");
  EXPECT_EQ(again.parameters.range.temperature_min_c, -5);
  EXPECT_EQ(again.parameters.range.temperature_max_c, model::IdentifiedRange::unknown);
  EXPECT_EQ(again.parameters.range.duration_s, 3'600);
  EXPECT_EQ(again.parameters.tolerance.resistance_per_ev, 0.07);
  cell.parameters.range.temperature_max_c = -10;
  EXPECT_THROW(parse_cell(cell_text(cell), "wrong"), BadInput) << "the maximum is below the minimum";
}

TEST(CellFile, ReadsWritesAndChecksPulseRatings) {
  CellFile cell = read_cell("table9");
  EXPECT_FALSE(cell.pulses.stated());
  EXPECT_EQ(cell_text(cell).find("[pulses]"), std::string::npos);
  cell.sources["pulses"] = "data sheet, 6.2";
  cell.pulses.temperature_min_c = 25;
  cell.pulses.charge.for_10s_a = 12;
  cell.pulses.discharge = {18.5, 13};
  const std::string text = cell_text(cell);
  const CellFile again = parse_cell(text, "again");
  EXPECT_EQ(again.pulses.temperature_min_c, 25);
  EXPECT_EQ(again.pulses.charge.for_10s_a, 12);
  EXPECT_EQ(again.pulses.charge.for_30s_a, 0);
  EXPECT_EQ(again.pulses.discharge.for_10s_a, 18.5);
  EXPECT_EQ(again.pulses.discharge.for_30s_a, 13);
  EXPECT_EQ(again.sources.at("pulses"), "data sheet, 6.2");
  EXPECT_EQ(cell_text(again), text);
  EXPECT_THAT(cell_refusal(replaced(text, "charge_10s_a = 12.0", "charge_10s_a = 5.9")),
              HasSubstr("'pulses.charge_10s_a' is out of range, expected charge_current_max_a to 2000 A"));
  EXPECT_THAT(cell_refusal(replaced(text, "discharge_30s_a = 13.0", "discharge_30s_a = nan")),
              HasSubstr("'pulses.discharge_30s_a'"));
  EXPECT_THAT(cell_refusal(replaced(text, "discharge_30s_a = 13.0", "discharge_30s_a = 19.0")),
              HasSubstr("'pulses.discharge_10s_a' is out of range, expected the rating for 30 s or more"));
  EXPECT_THAT(cell_refusal(replaced(text, "temperature_min_c = 25.0", "temperature_min_c = 61.0")),
              HasSubstr("'pulses.temperature_min_c'"));
  EXPECT_THAT(cell_refusal(replaced(text, "temperature_min_c = 25.0\n", "")),
              HasSubstr("'pulses.temperature_min_c' is missing"));
  EXPECT_THAT(cell_refusal(replaced(text, "charge_10s_a = 12.0", "charge_10s_a = 0")),
              HasSubstr("'pulses.charge_10s_a' is 0, expected a current, or no such key"));
  std::string none = replaced(text, "charge_10s_a = 12.0\n", "");
  for (const char* line : {"discharge_10s_a = 18.5\n", "discharge_30s_a = 13.0\n"}) none = replaced(none, line, "");
  EXPECT_THAT(cell_refusal(none), HasSubstr("'pulses' rates no current, expected charge_10s_a,"));
  EXPECT_THAT(cell_refusal(replaced(text, "discharge_30s_a", "discharge_60s_a")), HasSubstr("discharge_60s_a"));
}

TEST(CellFile, RejectsABinaryFile) {
  EXPECT_THAT(cell_refusal(std::string("name = \"x\"\n[\0l]\n", 15)), HasSubstr("cell.toml:2: a control character"));
}

TEST(CellFile, RejectsTextOnWhichTheParserAsserts) {
  for (const char* text : {"[/limits]\n", "[[/]]\n", "[a.\"b\"./]\n", "/ = 1\n"})
    EXPECT_THAT(cell_refusal(text), HasSubstr("expected a cell file in TOML")) << text;
  EXPECT_THAT(cell_refusal("a = 1\nb = [1,\n2]\n[/limits]\n"), HasSubstr("cell.toml:4:"));
}

TEST(CellFile, AcceptsCharactersBeyondAsciiOnlyInCommentsAndTexts) {
  const std::string good = table9_text(), entry = "chemistry = \"LiFePO4\"";
  for (const char* text :
       {"chemistry = \"Zelle \xC3\xA4 \\\" \xC7\xA2 #\"", "chemistry = 'Zelle \xC3\xA4 \" #'",
        "chemistry = \"LiFePO4\"  # gr\xC3\xBC\xC3\x9F\x65 \"", "chemistry = \"\"\"\nZelle # \"'\"\"\""}) {
    EXPECT_NO_THROW(parse_cell(replaced(good, entry, text), "cell.toml")) << text;
  }
  const std::string umlaut = "Zelle \xC3\xA4 ~ ~C3 \xC7\xA2";
  const CellFile cell = parse_cell(replaced(good, entry, "chemistry = \"" + umlaut + "\""), "cell.toml");
  EXPECT_EQ(cell.chemistry, umlaut);
  EXPECT_EQ(parse_cell(cell_text(cell), "cell.toml").chemistry, umlaut);
  EXPECT_NO_THROW(parse_cell("\xEF\xBB\xBF" + good, "cell.toml")) << "a byte order mark";
  for (const char* text : {"chemistry = \xC7\xA2\"table9\"", "chem\xC3\xAFstry = \"table9\"",
                           "chemistry = \"LiFePO4\"\n\xC7\xA2", "chemistry = 'LiFePO4' \xC7\xA2 '"}) {
    EXPECT_THAT(cell_refusal(replaced(good, entry, text)), HasSubstr("cell.toml:")) << text;
  }
}

TEST(CellFile, NamesTheLineOfABadEntry) {
  const std::string good = table9_text();
  const std::string line = cell_refusal(replaced(good, "420.558", "1.0"));
  const std::string before = good.substr(0, good.find("420.558"));
  const auto number = 1 + std::count(before.begin(), before.end(), '\n');
  EXPECT_THAT(line, HasSubstr("cell.toml:" + std::to_string(number) + ":"));
}

TEST(CellFile, RejectsMissingMisspeltAndWronglyTypedKeys) {
  const std::string good = table9_text();
  EXPECT_THAT(cell_refusal(""), HasSubstr("'name' is missing"));
  EXPECT_THAT(cell_refusal("\x01\x02 not toml at all"), HasSubstr("expected a cell file in TOML"));
  const std::size_t last_key = good.rfind("drift_v");
  for (std::size_t end = 0; end < last_key; end += 97) cell_refusal(good.substr(0, end));  // truncated at any place
  EXPECT_THAT(cell_refusal(replaced(good, "capacity_ah = 6.0", "capacity_ah = \"six\"")),
              HasSubstr("expected a number"));
  EXPECT_THAT(cell_refusal(replaced(good, "capacity_ah = 6.0", "capacity_mah = 6000")),
              HasSubstr("'capacity_ah' is missing"));
  EXPECT_THAT(cell_refusal(replaced(good, "r0_ohm", "r0_Ohm")),
              HasSubstr("'rc.r0_ohm' is missing ('r0_Ohm' is there), expected"));
  EXPECT_THAT(cell_refusal(replaced(good, "model_v = 0.003", "model_v = 0.003\nmodell_v = 0.003")),
              HasSubstr("unknown key 'noise.modell_v'"));
  EXPECT_THAT(cell_refusal(replaced(good, "0.7,  0.8,   0.9,   1.0]", "0.7,  0.8,   0.9]")), HasSubstr("ocv"));
  EXPECT_THAT(cell_refusal(replaced(good, "name = \"table9\"", "name = \"../x\\\"\"")), HasSubstr("'name'"));
  EXPECT_THAT(cell_refusal(replaced(good, "1927.32]", "[1927.32]]")), HasSubstr("expected a number"));
  std::string many = "0.5";
  for (int k = 0; k < 100; ++k) many += ", 0.5";
  EXPECT_THAT(cell_refusal(replaced(good, "1927.32]", many + "]")), HasSubstr("at most 64 numbers"));
}

constexpr const char* mechanisms = R"(
[instrument.current_offset]
offset_a = 0.03
offset_a_std = 0.002

[mechanism.initial_soc]
shift = -0.04

[mechanism.ocv_hysteresis]
source = "seen in \"the\" lab"
half_gap_v = 0.0123456789012345
half_gap_v_std = 0.001
decay = 55
)";

const model::MechanismSetting& setting_of(const CellFile& file, std::string_view id) {
  for (const model::MechanismSetting& m : file.mechanisms) {
    if (model::catalogue[m.index].id == id) return m;
  }
  throw std::runtime_error("not there");
}

TEST(CellFile, MechanismsAreInCatalogueOrderAndMissingParametersAreNeutral) {
  const CellFile cell = parse_cell(table9_text() + mechanisms, "cell.toml");
  ASSERT_EQ(cell.mechanisms.size(), 3U);
  for (std::size_t k = 1; k < 3; ++k) EXPECT_GT(cell.mechanisms[k].index, cell.mechanisms[k - 1].index);
  const auto& hysteresis = setting_of(cell, "ocv_hysteresis");
  EXPECT_EQ(hysteresis.value[0], 0.0123456789012345);
  EXPECT_EQ(hysteresis.deviation[0], 0.001);
  EXPECT_EQ(hysteresis.value[1], 55);
  EXPECT_EQ(hysteresis.value[2], 0);
  EXPECT_EQ(setting_of(cell, "current_offset").deviation[0], 0.002);
  EXPECT_EQ(setting_of(cell, "initial_soc").value[0], -0.04);
  EXPECT_TRUE(read_cell("table9").mechanisms.empty());
}

/// Its state would have neither a variance nor noise. Host and generator of the firmware's header both ask on_board().
TEST(CellFile, AMechanismWithStatesAndWithoutStrengthIsNotComputed) {
  const std::string base = read_cell("table9").text;
  for (const char* table :
       {"[mechanism.ocv_hysteresis]\n", "[mechanism.ocv_hysteresis]\nhalf_gap_v = 0.0\ninitial = 1.0\n",
        "[mechanism.slow_polarisation]\ntime_constant_s = 900.0\n", "[mechanism.self_heating]\n"}) {
    const CellFile cell = parse_cell(base + "\n" + table, "c.toml");
    EXPECT_EQ(cell.mechanisms.size(), 1U) << table;
    EXPECT_TRUE(on_board(cell.mechanisms).empty()) << table;
  }
  const CellFile cell = parse_cell(base + "\n[mechanism.ocv_hysteresis]\nhalf_gap_v = 0.001\n", "c.toml");
  EXPECT_EQ(on_board(cell.mechanisms).size(), 1U);
}

/// Keys of cell files are a public interface. The files are those that 0.1.0 was shipped with.
TEST(CellFile, FilesOfVersion010AreReadWithEveryValue) {
  for (const std::string name : {"a123_26650_extended", "a123_esctoolbox_extended"}) {
    const std::string path = BMS_SOURCE_DIR "/tests/host_sim/files/version_0_1_0/" + name + ".toml";
    const CellFile cell = read_cell(path);
    EXPECT_EQ(cell.name, name);
    std::ifstream in(path);
    std::string table, line;
    std::size_t values = 0;
    while (std::getline(in, line)) {
      if (line.starts_with("[")) table = line.substr(1, line.find(']') - 1);
      const std::size_t equals = line.find(" = ");
      if (!table.starts_with("mechanism.") || equals == std::string::npos || line.starts_with("source")) continue;
      const std::string key = line.substr(0, equals);
      const model::MechanismSetting& m = setting_of(cell, table.substr(std::string("mechanism.").size()));
      const model::MechanismInfo& info = model::catalogue[m.index];
      std::size_t k = 0;
      while (k < info.parameters && key != info.parameter[k].name) ++k;
      ASSERT_LT(k, info.parameters) << table << " " << key;
      EXPECT_EQ(m.value[k], std::stod(line.substr(equals + 3))) << table << " " << key;
      ++values;
    }
    EXPECT_GE(values, 9U);
    EXPECT_TRUE(cell.parameters.noise.errors_are_states);
    EXPECT_EQ(cell.parameters.ocv.half_gap_v.size, cell.parameters.ocv.soc.size);
  }
}

TEST(CellFile, EveryMechanismIsWrittenAndReadBackBitForBit) {
  CellFile cell = read_cell("table9");
  for (std::size_t index = model::mechanism_count; index-- > 0;) {
    model::MechanismSetting m = model::default_setting(index, cell.parameters);
    for (std::size_t k = 0; k < model::catalogue[index].parameters; ++k) {
      const model::Parameter& p = model::catalogue[index].parameter[k];
      m.value[k] =
          p.lower(6) + (p.upper(6) - p.lower(6)) * (k == 0 ? 1.0 : 0.123456789);  // a value on a bound is inside
      m.deviation[k] = k == 1 ? 0 : 0.1 / 3;
    }
    put_mechanism(cell, m);
  }
  cell.sources["mechanism.leakage"] = "a drawer";
  const CellFile again = parse_cell(cell_text(cell), "again");
  ASSERT_EQ(again.mechanisms.size(), model::mechanism_count);
  for (std::size_t index = 0; index < model::mechanism_count; ++index) {
    EXPECT_EQ(again.mechanisms[index].index, index);
    EXPECT_EQ(again.mechanisms[index].value, cell.mechanisms[index].value) << model::catalogue[index].id;
    EXPECT_EQ(again.mechanisms[index].deviation, cell.mechanisms[index].deviation) << model::catalogue[index].id;
  }
  EXPECT_EQ(again.sources.at("mechanism.leakage"), "a drawer");
  EXPECT_EQ(cell_text(again), cell_text(cell));
}

TEST(CellFile, AMissingParameterIsAcceptedForACellOfAnySize) {
  for (const double capacity_ah : {0.01, 2.5, 1'000.0}) {
    model::CellParameters<> p;
    p.capacity_ah = capacity_ah;
    for (std::size_t index = 0; index < model::mechanism_count; ++index) {
      EXPECT_EQ(model::first_fault(model::default_setting(index, p), capacity_ah), model::catalogue[index].parameters)
          << model::catalogue[index].id;
    }
  }
}

TEST(CellFile, RejectsAMechanismThatIsUnknownMisspeltOutOfRangeOrInTheWrongTable) {
  const std::string good = table9_text() + mechanisms;
  EXPECT_THAT(cell_refusal(replaced(good, "mechanism.ocv_hysteresis", "mechanism.hysteresis")),
              HasSubstr("unknown key 'mechanism.hysteresis', expected one of: "));
  EXPECT_THAT(cell_refusal(replaced(good, "mechanism.ocv_hysteresis", "mechanism.hysteresis")),
              HasSubstr("ocv_hysteresis"));
  EXPECT_THAT(cell_refusal(replaced(good, "instrument.current_offset", "mechanism.current_offset")),
              HasSubstr("unknown key 'mechanism.current_offset'"));
  EXPECT_THAT(cell_refusal(replaced(good, "mechanism.initial_soc", "instrument.initial_soc")),
              HasSubstr("unknown key 'instrument.initial_soc'"));
  EXPECT_THAT(cell_refusal(replaced(good, "decay = 55", "dekay = 55")),
              HasSubstr("unknown key 'mechanism.ocv_hysteresis.dekay', expected one of: decay, decay_std, half_gap_v"));
  EXPECT_THAT(cell_refusal(replaced(good, "decay = 55", "decay = \"fast\"")), HasSubstr("expected a number"));
  EXPECT_THAT(cell_refusal(replaced(good, "decay = 55", "decay = nan")),
              HasSubstr("'mechanism.ocv_hysteresis.decay' is out of range, expected 8 to 400"));
  EXPECT_THAT(cell_refusal(replaced(good, "offset_a = 0.03", "offset_a = 4")),
              HasSubstr("'instrument.current_offset.offset_a' is out of range, expected -1.8 to 1.8 A"));
  EXPECT_THAT(cell_refusal(replaced(good, "half_gap_v_std = 0.001", "half_gap_v_std = -1")),
              HasSubstr("'mechanism.ocv_hysteresis.half_gap_v_std' is out of range, expected 0 or more"));
  EXPECT_THAT(cell_refusal("mechanism = 1\n" + table9_text()),
              HasSubstr("'mechanism' is not acceptable, expected a table"));
  const std::string line = cell_refusal(replaced(good, "decay = 55", "decay = 1"));
  const auto number = std::count(good.begin(), good.end(), '\n');
  EXPECT_THAT(line, HasSubstr("cell.toml:" + std::to_string(number) + ":"));
}

TEST(CellFile, RejectsMechanismsThatTogetherAreNoCell) {
  const std::string branch = table9_text() + "\n[mechanism.branch_temperature]\nshift_at_50_v = 0.05\n" +
                             "energy_at_50_j_per_mol = 100000.0\nreference_c = ";
  EXPECT_THAT(cell_refusal(branch + "25.0\n"), HasSubstr("at 35 % and -20 degrees C the mechanisms together move the "
                                                         "voltage at rest by -1.26 V, expected at most 0.5 V"));
  // one energy lower and the shift of a real cell
  const std::string real = replaced(replaced(branch, "0.05", "0.001"), "100000.0", "40000.0");
  EXPECT_NO_THROW(parse_cell(real + "25.0\n", "cell.toml"));
  // a gap that is four times as large in the cold of -40 degrees C: three times as large, and negative, without it
  const std::string exchanged =
      table9_text() + "\n[mechanism.branch_temperature]\ngap_at_50 = 4.0\n" +
      "reference_c = -40.0\n\n[mechanism.ocv_hysteresis]\nhalf_gap_v = 0.02\nmeasured = 1.0\n";
  EXPECT_THAT(cell_refusal(exchanged), HasSubstr("below the discharge branch, expected above it"));
}

TEST(CellFile, FixedPointRefusesResistancesThatItDoesNotHold) {
  const auto cell = [](const std::string& mechanism) { return parse_cell(table9_text() + mechanism, "cell.toml"); };
  const std::string lag = "\n[mechanism.slow_polarisation]\nsurface_lag_s = 200.0\nresistance_ohm = ";
  EXPECT_NO_THROW(reject_if_fpu_needed(cell(lag + "0.002\n")));
  EXPECT_THROW(reject_if_fpu_needed(cell(lag + "1e-14\nfaster_share = 1e-5\n")), BadInput) << "rounds to nothing";
  EXPECT_THROW(reject_if_fpu_needed(cell(lag + "0.0\ntime_constant_s = 20000.0\n")), BadInput) << "5 nV a second";
  const std::string cold = "\n[mechanism.temperature_resistance]\nr0_activation_j_per_mol = ";
  EXPECT_NO_THROW(reject_if_fpu_needed(cell(cold + "30000.0\nreference_c = 25.0\n")));
  EXPECT_THROW(reject_if_fpu_needed(cell(cold + "60000.0\nreference_c = 80.0\n")), BadInput) << "more than 1 ohm";
}

TEST(CellFile, FixedPointRefusesTheLargestC1) {
  const auto with_c1 = [](const char* farad) { return replaced(table9_text(), "420.558", farad); };
  EXPECT_NO_THROW(reject_if_fpu_needed(parse_cell(with_c1("100000.0"), "cell.toml")));
  EXPECT_THROW(reject_if_fpu_needed(parse_cell(with_c1("100001.0"), "cell.toml")), BadInput);
  EXPECT_EQ(parse_cell(with_c1("1000000.0"), "cell.toml").parameters.rc.c1_f[0], 1'000'000);
  EXPECT_THAT(cell_refusal(with_c1("1000001.0")), HasSubstr("expected 100 to 1000000 F"));
}

TEST(CellFile, AMissingFileIsRejectedWithTheNamesOfTheBuiltInCells) {
  try {
    read_cell("table10");
    FAIL();
  } catch (const BadInput& error) {
    EXPECT_THAT(error.what(), HasSubstr("a123_esctoolbox_extended, nmc_lg_m50, nca_kim2011, lto_madani2019"));
  }
  EXPECT_THROW(read_cell("/nowhere/cell.toml"), BadInput);
  EXPECT_THROW(read_cell("/tmp"), BadInput);
}

constexpr const char* healthy = R"(
[healthy]
source = "two blocks of drive.csv"
beyond_tolerance_v = 0.0125

[[healthy.block]]
recording = "drive.csv"
start_s = 0.0
duration_s = 1800.5
error_v = 0.004
soc = [0.4, 0.7]
current_a = [-5.0, 2.0]
causes = ["voltage_gain", "unknown"]
gains = [123.4, 5.0]

[[healthy.block]]
recording = "drive.csv"
start_s = 1800.5
duration_s = 1800.0
error_v = 0.003
soc = [0.3, 0.4]
current_a = [-5.0, 2.0]
temperature_c = [21.0, 24.5]
causes = []
gains = []

[[healthy.regime]]
axis = "soc"
from = 0.3
to = 0.4
hours = 0.5
bias_v = -0.001
rms_v = 0.003
spread_v = 0.0005
parts = 2.0
)";

TEST(CellFile, HealthyDataAreReadAndWrittenAgain) {
  const CellFile cell = parse_cell(table9_text() + healthy, "x");
  ASSERT_EQ(cell.healthy.blocks.size(), 2U);
  EXPECT_NEAR(cell.healthy.hours(), 1.0001, 0.0001);
  EXPECT_EQ(cell.healthy.recordings(), 1U);
  EXPECT_EQ(cell.healthy.blocks[0].gains[0].cause, "voltage_gain");
  EXPECT_EQ(cell.healthy.blocks[0].gains[0].gain, 123.4);
  EXPECT_FALSE(cell.healthy.blocks[0].temperature_c.known());
  EXPECT_EQ(cell.healthy.blocks[1].temperature_c.high, 24.5);
  EXPECT_TRUE(cell.healthy.blocks[1].gains.empty());
  EXPECT_EQ(cell.healthy.regimes.at(0).bias_v, -0.001);
  EXPECT_EQ(cell.healthy.regimes.at(0).parts, 2);
  EXPECT_EQ(cell.healthy.beyond_tolerance_v, 0.0125);
  const std::string older =
      replaced(replaced(healthy, "parts = 2.0\n", "high_v = 0.004\n"), "beyond_tolerance_v = 0.0125\n", "");
  EXPECT_EQ(parse_cell(table9_text() + older, "x").healthy.regimes.at(0).parts, 1);
  const std::string text = cell_text(cell);
  EXPECT_EQ(text.substr(text.find("\n[healthy]")), healthy);
  EXPECT_THAT(cell_text(parse_cell(table9_text(), "x")), Not(HasSubstr("healthy")));
}

TEST(CellFile, BadHealthyDataAreRejected) {
  const auto with = [&](const std::string& what, const std::string& by) {
    return cell_refusal(table9_text() + replaced(healthy, what, by));
  };
  EXPECT_THAT(with("gains = [123.4, 5.0]", "gains = [123.4]"), HasSubstr("expected 2 numbers"));
  EXPECT_THAT(with("123.4", "-1.0"), HasSubstr("numbers of 0 or more"));
  EXPECT_THAT(with("soc = [0.4, 0.7]", "soc = [0.7, 0.4]"), HasSubstr("the smallest and the largest value"));
  EXPECT_THAT(with("duration_s = 1800.5", "duration_s = 0.0"), HasSubstr("more than 0 s"));
  EXPECT_THAT(with("error_v = 0.004", "eror_v = 0.004"), HasSubstr("error_v"));
  EXPECT_THAT(with("to = 0.4", "to = 0.2"), HasSubstr("more than 'from'"));
  EXPECT_THAT(with("[[healthy.regime]]", "[[healthy.regimes]]"), HasSubstr("unknown key 'healthy.regimes'"));
}

}  // namespace
}  // namespace bms::files
