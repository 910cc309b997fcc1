// Tables as testers, loggers and homes write them: clocks, dates, steps, words in place of readings, a reading a row.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "files/recording.hpp"
#include "files/recording_text.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "tests/host_sim/files/rejected_input.hpp"

namespace bms::files {
namespace {

using ::testing::HasSubstr;

constexpr const char* own = "time_s,current_a,voltage_v\n";

measurement::Recording read(const std::string& text, bool keep_all = false) {
  ReadOptions options;
  options.keep_all = keep_all;
  options.refuse_doubtful = true;
  return parse_recording(text, "log.csv", VoltageColumn::required, options);
}
std::string refused(const std::string& text) {
  return refusal_by("log.csv", [&] { read(text); });
}
/// The text of the warning with this id; empty without it.
std::string warning(const measurement::Recording& r, const std::string& id) {
  for (const measurement::Warning& w : r.warnings) {
    if (w.id == id) return w.text;
  }
  return {};
}
/// header and a line for each k, from what `line` returns for it.
std::string table(const std::string& header, int rows, const std::function<std::string(int)>& line) {
  std::string text = header;
  for (int k = 0; k < rows; ++k) text += line(k) + "\n";
  return text;
}

TEST(TableWithSeparatorsAtTheEnd, HasNoColumnThere) {
  for (const char* end : {"", ",", ",,,"}) {
    for (const char* of_header : {"", ",", ",,"}) {
      const std::string header = fmt::format("Time (s),Current (A),Voltage (V),Note{}\n", of_header);
      const std::string text = table(header, 12, [&](int k) { return fmt::format("{},1,3.3,x{}", k, end); });
      EXPECT_EQ(read(text, true).rows(), 12U) << "'" << end << "' '" << of_header << "'";
      EXPECT_EQ(read(table(own, 12, [&](int k) { return fmt::format("{},1,3.3{}", k, end); })).rows(), 12U) << end;
    }
  }
  EXPECT_THAT(refused(table(own, 12, [](int k) { return fmt::format("{},1,3.3,,4", k); })), HasSubstr("more fields"));
}

TEST(TableWithDateAndTime, HasBothInItsTimes) {
  const auto line = [](int k) { return fmt::format("{:02}.01.2023;{:02}:00:{:02};0,5;3,3", k < 6 ? 9 : 10, 8, 2 * k); };
  const measurement::Recording r = read(table("Date;Time;Current[A];Voltage[V]\n", 12, line));
  EXPECT_EQ(r.time_s.front(), 0);
  EXPECT_EQ(r.time_s[6] - r.time_s[5], 86'402);
  EXPECT_THAT(r.read_as, HasSubstr("date from 'Date'"));
  EXPECT_EQ(warning(r, "ignored_column"), "");
  const auto american = [](int k) {
    return fmt::format("01/{:02}/2023,{:02}:30:00 {},0.5,3.3", 9 + k / 2, 12, k % 2 ? "PM" : "AM");
  };
  const measurement::Recording half = read(
      table("Time,Date,Current[A],Voltage[V]\n", 1, [](int) { return std::string("12:30:00 AM,01/09/2023,0.5,3.3"); }) +
      table("", 11, [](int k) { return fmt::format("{:02}:30:00 {},01/09/2023,0.5,3.3", k % 12 + 1, "AM"); }));
  EXPECT_EQ(half.time_s[1], 3'600) << "12:30 AM is half an hour after midnight";
  EXPECT_THAT(refused(table("Date,Time,Current[A],Voltage[V]\n", 12, american) + "never,08:00:00,0.5,3.3\n"),
              HasSubstr("'never' in column 'Date' is not a date"));
}

TEST(TableOfAClock, GoesOnAfterMidnight) {
  const auto line = [](int k) {
    const int s = (86'394 + k) % 86'400;
    return fmt::format("{:02}:{:02}:{:02},1,3.3", s / 3'600, s / 60 % 60, s % 60);
  };
  const measurement::Recording r = read(table("Time,Current (A),Voltage (V)\n", 12, line));
  EXPECT_EQ(r.duration_s(), 11);
  EXPECT_THAT(warning(r, "repair_midnight"), HasSubstr("1, the first in line 8"));
  const std::string again = table("Time,Current (A),Voltage (V)\n", 24, [](int k) {
    return fmt::format("{:02}:00:{:02},1,3.3", k < 12 ? 20 : 0, k);  // a test that began again, or a night without rows
  });
  EXPECT_THAT(refused(again), HasSubstr("time goes back"));
}

TEST(TableOfLocalTime, GoesOnWhenDaylightSavingTimeEndsAndSaysWhenItMayBegin) {
  const auto local = [](const char* day, int before_h, int after_h, const char* zone) {
    return table("timestamp,Current (A),Voltage (V)\n", 20, [&](int k) {
      return k < 10 ? fmt::format("{} {:02}:59:{:02}{},1,3.3", day, before_h, 50 + k, zone)
                    : fmt::format("{} {:02}:00:{:02}{},1,3.3", day, after_h, k - 10, zone);
    });
  };
  const measurement::Recording autumn = read(local("2025-10-26", 2, 2, ""));
  EXPECT_EQ(autumn.duration_s(), 19);
  EXPECT_THAT(warning(autumn, "repair_daylight_saving"), HasSubstr("1, in line 12"));
  EXPECT_THAT(refused(local("2025-10-26", 2, 2, "Z")), HasSubstr("time goes back")) << "UTC has none";
  EXPECT_THAT(refused(local("2025-10-26", 2, 1, "")), HasSubstr("time goes back")) << "two hours";
  const measurement::Recording spring = read(local("2025-03-30", 1, 3, ""));
  EXPECT_EQ(spring.duration_s(), 19 + 3'600) << "a gap, perhaps";
  EXPECT_THAT(warning(spring, "daylight_saving"), HasSubstr("leaps by an hour in line 12"));
}

TEST(TableOfATester, LeavesSingleRowsWithAWrongTimeOut) {
  const std::string zero = table(own, 30, [](int k) { return fmt::format("{},1,3.3", k % 10 == 9 ? 0 : 100 + k); });
  const measurement::Recording r = read(zero);
  EXPECT_EQ(r.rows(), 27U);
  EXPECT_THAT(warning(r, "repair_time_back"), HasSubstr("3, the first in line 11; they are left out"));
  const measurement::Recording back =
      read(table(own, 30, [](int k) { return fmt::format("{},1,3.3", k == 20 ? 18.6 : k); }));
  EXPECT_EQ(back.rows(), 29U);
  EXPECT_EQ(back.time_s[20], 21);
  EXPECT_THAT(refused(table(own, 30, [](int k) { return fmt::format("{},1,3.3", k == 20 ? 17 : k); })),
              HasSubstr("log.csv:22: time goes back from 19 s to 17 s"));
  EXPECT_THAT(refused(table(own, 30, [](int k) { return fmt::format("{},1,3.3", k < 15 ? k : k - 15); })),
              HasSubstr("time goes back"))
      << "it begins again";
  EXPECT_THAT(refused(table(own, 30, [](int k) { return fmt::format("{},1,3.3", k % 2 == 0 ? k : k - 1.5); })),
              HasSubstr("time goes back in many rows"));
}

TEST(TableOfATester, OfArbinHasSecondsWithoutSayingSo) {
  const auto line = [](int k) { return fmt::format("{},{},1,3.3", k + 1, 0.5 * k); };
  const measurement::Recording r = read(table("Data_Point,Test_Time,Current,Voltage\n", 12, line));
  EXPECT_EQ(r.time_s[11], 5.5);
  EXPECT_THAT(r.read_as, HasSubstr("Arbin"));
  EXPECT_THAT(refused(table("Nr,Test_Time,Current (A),Voltage (V)\n", 12, line)), HasSubstr("--unit time_s=s"));
}

TEST(TableOfATester, LeavesRepeatedRowsOut) {
  const measurement::Recording r = read(table(own, 24, [](int k) { return fmt::format("{},1,3.3", k / 2); }));
  EXPECT_EQ(r.rows(), 12U);
  EXPECT_THAT(warning(r, "repair_repeated_row"), HasSubstr("12, the first in line 3"));
  const measurement::Recording other = read(table(own, 24, [](int k) { return fmt::format("{},{},3.3", k / 2, k); }));
  EXPECT_EQ(other.rows(), 24U) << "the same time alone is not a repetition";
}

TEST(TableOfATester, WithAClockForEachStepHasOneStepAfterTheOther) {
  const auto line = [](int k) { return fmt::format("1,{},{},{},3.3", k / 5 + 1, 10 * (k % 5), k); };
  const measurement::Recording r = read(table("Cycle,Step,Step Time (s),Current (A),Voltage (V)\n", 15, line));
  ASSERT_EQ(r.rows(), 15U);
  EXPECT_EQ(r.time_s[4], 40);
  EXPECT_EQ(r.time_s[5], 40) << "the next step begins where the last one ended";
  EXPECT_EQ(r.time_s[14], 120);
  EXPECT_THAT(r.read_as, HasSubstr("steps by 'Step', one after the other"));
  EXPECT_THAT(refused(table("Step,Step Time (s),Current (A),Voltage (V)\n", 15,
                            [](int k) { return fmt::format("1,{},1,3.3", 10 * (k % 5)); })),
              HasSubstr("time goes back"))
      << "within a step";
}

TEST(TableWithWordsInPlaceOfReadings, HasMissingReadings) {
  const std::vector<std::string> words = {"none", "None", "unavailable", "unknown", "NaN", "null", ""};
  const auto line = [&](int k) {
    return fmt::format("{},1,{}", k,
                       static_cast<std::size_t>(k) < words.size() ? words[static_cast<std::size_t>(k)] : "3.3");
  };
  const measurement::Recording r = read(table(own, 12, line));
  EXPECT_EQ(std::count_if(r.voltage_v.begin(), r.voltage_v.end(), [](double v) { return std::isnan(v); }), 7);
  EXPECT_THAT(warning(r, "missing_reading"), HasSubstr("word such as 'unavailable': 7, the first in line 2"));
  EXPECT_THAT(refused(table(own, 12, [](int k) { return fmt::format("{},1,nothing", k); })), HasSubstr("'nothing'"));
}

TEST(TableWithTheOverflowOfATester, HasAMissingReadingThere) {
  const measurement::Recording r =
      read(table(own, 12, [](int k) { return fmt::format("{},{},3.3", k, k == 0 ? "-3.4028235E+38" : "1"); }));
  EXPECT_TRUE(std::isnan(r.current_a[0]));
  EXPECT_THAT(warning(r, "repair_overflow"), HasSubstr("1, the first in line 2"));
  EXPECT_EQ(warning(r, "missing_reading"), "");
  EXPECT_THAT(refused(table(own, 12, [](int k) { return fmt::format("{},4e12,3.3", k); })), HasSubstr("impossible"));
}

TEST(LongTable, IsOneRowForReadingsThatBelongTogether) {
  std::string text = "entity_id,state,last_changed\n";
  const auto add = [&](const char* entity, const std::string& state, int s, int ms) {
    text += fmt::format("sensor.bms_{},{},2025-08-31T22:00:{:02}.{:03}Z\n", entity, state, s, ms);
  };
  for (int k = 0; k < 12; ++k) add("cell_voltage_2", fmt::format("{}", 3.2 + 0.001 * k), 5 * k, 200);
  for (int k = 0; k < 12; ++k) add("cell_voltage_1", fmt::format("{}", 3.3 + 0.001 * k), 5 * k, 100);
  for (int k = 0; k < 12; k += 3) add("current", k == 6 ? "unavailable" : fmt::format("{}", k), 5 * k, 0);
  add("charging", "on", 7, 0);
  const measurement::Recording r = read(text);
  ASSERT_EQ(r.rows(), 12U);
  ASSERT_EQ(r.cell_voltage_v.size(), 2U);
  EXPECT_DOUBLE_EQ(r.cell_voltage_v[0][4], 3.304);
  EXPECT_DOUBLE_EQ(r.cell_voltage_v[1][4], 3.204);
  EXPECT_EQ(r.current_a[5], 3) << "held";
  EXPECT_TRUE(std::isnan(r.current_a[7])) << "unavailable, until the next";
  EXPECT_EQ(r.current_a[9], 9);
  EXPECT_EQ(r.time_s[1] - r.time_s[0], 5);
  EXPECT_THAT(warning(r, "missing_reading"), HasSubstr("'unavailable': 1"));
}

TEST(LongTable, NamesItsEntitiesIfTheirNamesSayNothing) {
  const auto text = [](const char* current, const char* voltage) {
    return table("entity_id,state,last_changed\n", 12,
                 [&](int k) { return fmt::format("{},1,{}\n{},3300,{}", current, k * 10, voltage, k * 10); });
  };
  EXPECT_THAT(refused(text("sensor.a", "sensor.b")),
              HasSubstr("--map current_a=ENTITY with one of: sensor.a, sensor.b"));
  EXPECT_THAT(refused(text("sensor.x_current", "sensor.y_current")), HasSubstr("are both current_a"));
  ReadOptions options;
  options.map = {"current_a=sensor.a", "voltage_v=sensor.b"};
  options.unit = {"voltage_v=mV"};
  const measurement::Recording r =
      parse_recording(text("sensor.a", "sensor.b"), "log.csv", VoltageColumn::required, options);
  EXPECT_EQ(r.voltage_v[3], 3.3);
}

TEST(WrittenRecording, BeginsWithTheRepairsThatWereMade) {
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "out.csv").string(), bdf = (folder.path() / "out.bdf.csv").string();
  const measurement::Recording r =
      read(table(own, 30, [](int k) { return fmt::format("{},1,3.3", k == 20 ? 18.6 : k); }));
  write_recording(r, path, false);
  write_recording(r, bdf, true);
  EXPECT_THAT(read_file(path), ::testing::StartsWith("# repaired: rows whose time is 0 or a little before"));
  EXPECT_THAT(read_file(bdf), ::testing::StartsWith("Test Time / s"));
  EXPECT_EQ(read_recording(path).rows(), 29U);
  EXPECT_EQ(warning(read_recording(path), "repair_time_back"), "") << "nothing to repair any more";
}

}  // namespace
}  // namespace bms::files
