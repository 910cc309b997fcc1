#include "files/recording.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <ctime>
#include <functional>
#include <random>

#include "files/cell_file.hpp"
#include "measurement/recording_checks.hpp"
#include "tests/host_sim/files/rejected_input.hpp"

namespace bms::files {
namespace {

using measurement::Recording;
using ::testing::HasSubstr;

/// Twenty good rows with a load that the voltage follows.
std::string rows(const std::string& separator = ",", const std::string& end = "\n") {
  std::string text;
  for (int k = 0; k < 20; ++k) {
    const double current_a = k % 6 < 3 ? -2 : 0.5;
    text += std::to_string(k) + separator + std::to_string(current_a) + separator +
            std::to_string(3.3 + 0.01 * current_a) + end;
  }
  return text;
}
const std::string header = "time_s,current_a,voltage_v\n";

std::string refusal(const std::string& text) {
  const std::string line = refusal_by("log.csv", [&] { parse_recording(text, "log.csv"); });
  EXPECT_THAT(line, HasSubstr(", expected "));
  return line;
}

/// Ids of the warnings that an accepted recording carries.
std::vector<std::string> warnings(const std::string& text) {
  Recording r = parse_recording(text, "log.csv");
  measurement::compare_with_cell(r, read_cell("table9").parameters);
  std::vector<std::string> ids;
  for (const measurement::Warning& w : r.warnings) ids.push_back(w.id);
  return ids;
}

/// Rows with columns of trusted instruments; reference(k): their fields in row k.
std::string with_references(const std::function<std::string(int)>& reference) {
  std::string text = "time_s,current_a,voltage_v,current_ref_a,voltage_ref_v\n";
  for (int k = 0; k < 20; ++k) text += std::to_string(k) + ",0.01,3.3," + reference(k) + "\n";
  return text;
}

TEST(Recording, ReferencesMayBeEmptyWithoutAWarning) {
  const auto references = [](int k) -> std::string {
    if (k < 5) return "0,3.6";
    if (k < 10) return ",3.31";
    return k == 12 ? "nan," : ",";
  };
  const Recording r = parse_recording(with_references(references), "log.csv");
  EXPECT_EQ(r.current_ref_a[4], 0);
  EXPECT_TRUE(std::isnan(r.current_ref_a[5]));
  EXPECT_EQ(r.voltage_ref_v[9], 3.31);
  EXPECT_TRUE(std::isnan(r.voltage_ref_v[12]));
  EXPECT_TRUE(r.warnings.empty());
  const std::vector<measurement::Sample> seen = measurement::samples(r);
  EXPECT_EQ(seen[4].voltage_uv, measurement::no_reading) << "contactor open, a source on the sense wires";
  EXPECT_EQ(seen[9].voltage_uv, 3'300'000) << "a meter on the cell";
}

TEST(Recording, ABadReferenceIsRejected) {
  EXPECT_THAT(refusal(with_references([](int k) { return std::string(k == 3 ? "0.1V," : ","); })),
              HasSubstr("log.csv:5: '0.1V' in column 'current_ref_a' is not a number, expected a number or nothing"));
  EXPECT_THAT(refusal(with_references([](int k) { return std::string(k == 3 ? "0" : ","); })),
              HasSubstr("log.csv:5: 4 fields"));
}

TEST(Recording, ReadsColumnsByNameInAnyOrder) {
  const Recording r = parse_recording(
      "voltage_v,soc_ref,time_s,temperature_c,current_a\n" +
          [] {
            std::string text;
            for (int k = 0; k < 12; ++k) text += "3.3,0.5," + std::to_string(k) + ".5,25,-1.25\n";
            return text;
          }(),
      "log.csv");
  ASSERT_EQ(r.rows(), 12U);
  EXPECT_EQ(r.time_s[3], 3.5);
  EXPECT_EQ(r.current_a[3], -1.25);
  EXPECT_EQ(r.voltage_v[3], 3.3);
  EXPECT_EQ(r.temperature_c[3], 25);
  EXPECT_EQ(r.soc_ref[3], 0.5);
  EXPECT_TRUE(r.warnings.empty());
}

TEST(Recording, EveryDecimalIsRoundedCorrectly) {
  std::mt19937_64 random(1);
  std::string text = header;
  std::vector<std::string> numbers;
  for (int k = 0; k < 5'000; ++k) {
    char number[64];
    const double value = std::ldexp(static_cast<double>(random() >> 11), -static_cast<int>(random() % 100)) *
                         (random() % 2 == 0 ? 1 : -1);
    const double shown = std::fmod(value, 1e6);
    if (random() % 3 == 0)
      std::snprintf(number, sizeof number, "%.3e", shown);
    else if (random() % 2 == 0)
      std::snprintf(number, sizeof number, "%.9f", shown);
    else
      std::snprintf(number, sizeof number, "%.17g", shown);
    numbers.emplace_back(number);
    text += std::to_string(k) + "," + number + ",3.3\n";
  }
  const Recording r = parse_recording(text, "log.csv");
  for (std::size_t k = 0; k < numbers.size(); ++k)
    ASSERT_EQ(r.current_a[k], std::strtod(numbers[k].c_str(), nullptr)) << numbers[k];
}

TEST(Recording, AcceptsTheFormatsOfSpreadsheetsAndLoggers) {
  EXPECT_THAT(warnings("time_s;current_a;voltage_v\n" + rows(";")), ::testing::IsEmpty());
  EXPECT_THAT(warnings("\xEF\xBB\xBF" + header + rows()), ::testing::IsEmpty());
  EXPECT_THAT(warnings("time_s,current_a,voltage_v\r\n" + rows(",", "\r\n")), ::testing::IsEmpty());
  EXPECT_THAT(warnings("# truck 7\n" + header + "# begin\n" + rows() + "\n\n"), ::testing::IsEmpty());
  EXPECT_THAT(warnings("\"time_s\", \"current_a\" ,voltage_v\n" + rows(" , ")), ::testing::IsEmpty());
  EXPECT_THAT(warnings(header + rows(",", ",\n")), ::testing::IsEmpty());
  const std::string without_last_newline = header + rows();
  EXPECT_EQ(parse_recording(without_last_newline.substr(0, without_last_newline.size() - 1), "log.csv").rows(), 20U);
}

TEST(Recording, RejectsFilesThatAreNotRecordings) {
  EXPECT_THAT(refusal(""), HasSubstr("empty"));
  EXPECT_THAT(refusal("# nothing but a comment\n"), HasSubstr("only comments"));
  EXPECT_THAT(refusal(header), HasSubstr("0 rows"));
  EXPECT_THAT(refusal(header + "0,0,3.3\n1,0,3.3\n"), HasSubstr("2 rows, expected 10 or more"));
  EXPECT_THAT(refusal(std::string("\x7f"
                                  "ELF\x02\x01\0\0\0",
                                  9)),
              HasSubstr("not a text file"));
  EXPECT_THAT(refusal("\x89PNG\r\n\x1a\n"), HasSubstr("no column 'time_s'"));
  EXPECT_THAT(refusal("time_s,current_a\n0,0\n"), HasSubstr("no column 'voltage_v'"));
  EXPECT_THAT(refusal("t,i,v\n" + rows()), HasSubstr("column 'i' states no unit, expected --unit current_a=UNIT"));
  EXPECT_THAT(refusal("time_s,current_a,current_a,voltage_v\n"), HasSubstr("twice"));
  EXPECT_THAT(refusal(rows()), HasSubstr("no column"));
}

TEST(Recording, RejectsABadLineAndNamesIt) {
  EXPECT_THAT(refusal(header + rows() + "20,abc,3.3\n"),
              HasSubstr("log.csv:22: 'abc' in column 'current_a' is not a number"));
  EXPECT_THAT(refusal(header + rows() + ",1,3.3\n"), HasSubstr("log.csv:22: '' in column 'time_s'"));
  EXPECT_THAT(refusal(header + rows() + "20,1,3.3V\n"), HasSubstr("'3.3V'"));
  EXPECT_THAT(refusal(header + rows() + "20,1,0x3\n"), HasSubstr("not a number"));
  EXPECT_THAT(refusal(header + rows() + "20,1,inf\n"), HasSubstr("not a number"));
  EXPECT_THAT(refusal(header + rows() + "20,1,1e999\n"), HasSubstr("not a number"));
  EXPECT_THAT(refusal(header + rows() + "20,-,3.3\n"), HasSubstr("not a number"));
  EXPECT_THAT(refusal(header + rows() + "20,1\n"), HasSubstr("log.csv:22: 2 fields, expected 3"));
  EXPECT_THAT(refusal(header + rows() + "20,1,3.3,9\n"), HasSubstr("more fields"));
  EXPECT_THAT(refusal(header + rows() + "20\n"), HasSubstr("1 fields"));
  EXPECT_THAT(refusal(header + rows() + "3,0,3.3\n"), HasSubstr("log.csv:22: time goes back from 19 s to 3 s"));
  EXPECT_THAT(refusal(header + rows() + "nan,0,3.3\n"), HasSubstr("time_s is not a number"));
  EXPECT_THAT(refusal(header + rows() + "1e300,0,3.3\n"), HasSubstr("ten years"));
  EXPECT_THAT(refusal(header + rows() + "20," + std::string(1'000'000, 'x') + ",3.3\n"), HasSubstr("...'"));
  EXPECT_THAT(refusal(header + rows() + "20," + std::string(1'000'000, '9') + ",3.3\n"), HasSubstr("not a number"));
}

TEST(Recording, WarnsOfImplausibleValues) {
  using ::testing::ElementsAre;
  EXPECT_THAT(warnings(header + rows() + "500,0,3.3\n"), ElementsAre("gap"));
  EXPECT_THAT(warnings(header + rows() + "19,0,3.3\n"), ElementsAre("duplicate_time"));
  EXPECT_THAT(warnings(header + rows() + "20,nan,3.3\n21,0,NaN\n"), ElementsAre("missing_reading"));
  EXPECT_THAT(warnings(header + rows() + "20,0,4.3\n"), ElementsAre("outside_cell_range"));
  EXPECT_THAT(warnings("time_s,current_a,voltage_v,operator\n" + replaced(rows(",", ",0\n"), ",0\n", ",7\n")),
              ElementsAre("ignored_column"));
  std::string inverted = header, millivolts = header, milliamperes = header,
              percent = "time_s,current_a,voltage_v,soc_ref\n";
  for (int k = 0; k < 20; ++k) {
    const double i = k % 6 < 3 ? -2 : 0.5, v = 3.3 + 0.01 * i;
    const std::string t = std::to_string(k) + ",";
    inverted += t + std::to_string(-i) + "," + std::to_string(v) + "\n";
    millivolts += t + std::to_string(i) + "," + std::to_string(1e3 * v) + "\n";
    milliamperes += t + std::to_string(1e3 * i) + "," + std::to_string(v) + "\n";
    percent += t + std::to_string(i) + "," + std::to_string(v) + ",55\n";
  }
  EXPECT_THAT(warnings(inverted), ElementsAre("current_inverted"));
  EXPECT_THAT(warnings(millivolts), ElementsAre("voltage_in_mv"));
  EXPECT_THAT(warnings(milliamperes), ElementsAre("current_in_ma"));
  EXPECT_THAT(warnings(percent), ElementsAre("soc_ref_in_percent"));
}

TEST(Recording, AnEmptyFieldIsAMissingReading) {
  const Recording r = parse_recording(header + rows() + "20,,3.3\n21,0,\n", "log.csv");
  EXPECT_TRUE(std::isnan(r.current_a[20]));
  EXPECT_TRUE(std::isnan(r.voltage_v[21]));
  ASSERT_EQ(r.warnings.size(), 1U);
  EXPECT_EQ(r.warnings[0].id, "missing_reading");
  EXPECT_THAT(r.warnings[0].text, HasSubstr("empty or 'nan': 2, the first in line 22"));
}

TEST(Recording, ALastLineThatBreaksOffIsNotUsed) {
  for (const std::string cut : {"20", "20,1", "20,1,3.", "20,1,3", "20,-", "20,1,-"}) {
    const Recording r = parse_recording(header + rows() + cut, "log.csv");
    const bool whole = cut == "20,1,3." || cut == "20,1,3";  // cannot be distinguished from a reading
    EXPECT_EQ(r.rows(), whole ? 21U : 20U) << cut;
    EXPECT_EQ(r.warnings.empty() ? "" : r.warnings[0].id, whole ? "" : "truncated_line") << cut;
  }
}

TEST(Recording, APackHasTheMeanOfItsCells) {
  std::string text = "time_s,current_a,v_2,v_1,t_1\n";
  for (int k = 0; k < 12; ++k) text += std::to_string(k) + ",1,3.4,3.2,25\n";
  const Recording pack = parse_recording(text, "p.csv");
  EXPECT_DOUBLE_EQ(pack.voltage_v[3], 3.3);
  EXPECT_EQ(pack.temperature_c[3], 25);
  ASSERT_EQ(pack.cell_voltage_v.size(), 2U);
  EXPECT_EQ(measurement::cell(pack, 0).voltage_v[3], 3.2);
  EXPECT_EQ(measurement::cell(pack, 1).voltage_v[3], 3.4);
  EXPECT_EQ(measurement::cell(pack, 1).current_a[3], 1);
  EXPECT_THAT(refusal("time_s,current_a,v_1,v_3\n0,1,3.3,3.3\n"), HasSubstr("without a gap"));
  EXPECT_THAT(refusal("time_s,current_a,pack_voltage_v\n" + rows()), HasSubstr("expected --series"));
}

TEST(Recording, RejectsWhatNoInstrumentMeasures) {
  EXPECT_THAT(refusal(header + rows() + "20,1,1e308\n"),
              HasSubstr("log.csv:22: '1e308' in column 'voltage_v' is impossible"));
  EXPECT_THAT(refusal(header + rows() + "20,-1e12,3.3\n"), HasSubstr("'-1e12' in column 'current_a' is impossible"));
  std::string still = header;
  for (int k = 0; k < 20; ++k) still += "7,1,3.3\n";
  EXPECT_THAT(refusal(still), HasSubstr("all rows have the same time, expected times that increase"));
}

TEST(Recording, WarnsOfMillisecondsAndOfMoreChargeThanTheCellHas) {
  std::string milliseconds = header, large = header;
  for (int k = 0; k < 3'600; ++k) {
    const double i = k % 100 < 50 ? -6 : 2;
    milliseconds += std::to_string(1'000 * k) + "," + std::to_string(i) + "," + std::to_string(3.3 + 0.01 * i) + "\n";
    large += std::to_string(k) + "," + std::to_string(10 * i) + "," + std::to_string(3.3 + 0.001 * i) + "\n";
  }
  EXPECT_THAT(warnings(milliseconds), ::testing::ElementsAre("time_in_ms"));
  EXPECT_THAT(warnings(large), ::testing::ElementsAre("outside_cell_range", "charge_exceeds_capacity"));
}

/// Quadratic time would be half a minute.
TEST(Recording, ManyColumnsAreReadInProportionToTheirNumber) {
  std::string text = "time_s,current_a,voltage_v", more;
  for (int k = 0; k < 200'000; ++k) {
    text += ",x";
    more += ",1";
  }
  text += "\n";
  for (int k = 0; k < 12; ++k) text += std::to_string(k) + ",1,3.3" + more + "\n";
  const auto begin = std::clock();
  const Recording r = parse_recording(text, "log.csv");
  EXPECT_LT(std::clock() - begin, 5 * CLOCKS_PER_SEC);
  EXPECT_THAT(r.warnings.front().text, HasSubstr("and 199990 more"));
  EXPECT_LT(r.warnings.front().text.size(), 200U);
}

TEST(Recording, AnyBytesAreEitherReadOrRejected) {
  std::mt19937_64 random(9);
  const std::string good = header + rows();
  for (int run = 0; run < 3'000; ++run) {
    std::string text = good;
    for (std::size_t k = 0; k < 1 + random() % 8; ++k) {
      const std::size_t at = random() % text.size();
      if (random() % 3 == 0)
        text.erase(at, random() % 20);
      else if (random() % 2 == 0)
        text.insert(at, 1, static_cast<char>(random()));
      else
        text[at] = ",;\n.-eE0\"#\r \0"[random() % 13];
      if (text.empty()) text = "\n";
    }
    try {
      const Recording r = parse_recording(text, "log.csv");
      ASSERT_GE(r.rows(), 10U);
      ASSERT_EQ(measurement::samples(r).size(), r.rows());
    } catch (const BadInput& error) {
      ASSERT_THAT(error.what(), HasSubstr("log.csv:"));
      ASSERT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
}

TEST(Recording, AProfileNeedsNoVoltage) {
  const std::string text = "time_s,current_a\n" + [] {
    std::string t;
    for (int k = 0; k < 12; ++k) t += std::to_string(k) + ",1\n";
    return t;
  }();
  EXPECT_EQ(parse_recording(text, "p.csv", VoltageColumn::optional).rows(), 12U);
  EXPECT_THROW(parse_recording(text, "p.csv"), BadInput);
}

}  // namespace
}  // namespace bms::files
