#include "monitor/screen.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "tests/host_sim/monitor/traffic.hpp"

namespace bms::monitor {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

BusState after(int samples, std::uint32_t flags = 0) {
  Traffic traffic(0);
  traffic.flags = flags;
  BusState bus;
  for (int k = 0; k < samples; ++k) {
    for (const BusFrame& frame : traffic.sample()) bus.receive(frame);
  }
  return bus;
}

ScreenFacts facts(bool blocks = true) { return {"can0", 0, 0, 8, blocks}; }

std::vector<std::string> rows(const BusState& bus, const ScreenSize& size, bool blocks = true) {
  std::istringstream in(plain_text(screen(bus, facts(blocks), size)));
  std::vector<std::string> all;
  for (std::string row; std::getline(in, row);) all.push_back(row);
  return all;
}

/// Style of the piece that contains `text`.
TextStyle style_of(const std::vector<ScreenLine>& lines, const std::string& text) {
  for (const ScreenLine& line : lines) {
    for (const auto& piece : line.pieces()) {
      if (piece.text.find(text) != std::string::npos) return piece.style;
    }
  }
  ADD_FAILURE() << text << " is not on the screen";
  return TextStyle::plain;
}

TEST(Screen, ShowsTheTemperatureOfTheFrontEndIfItIsSent) {
  BusState bus = after(61);
  can::FrontEnd front_end;
  bus.receive(to_bus_frame(front_end.frame(0), bus.now_us()));
  EXPECT_EQ(rows(bus, {80, 24})[3], "Pack     3.320 V   5.04 A charging   24.2 \u00b0C") << "not known";
  front_end.die_temperature = 72;
  bus.receive(to_bus_frame(front_end.frame(1), bus.now_us()));
  EXPECT_EQ(rows(bus, {80, 24})[3], "Pack     3.320 V   5.04 A charging   24.2 \u00b0C   front end 72 \u00b0C");
}

TEST(Screen, On80x24ShowsTheBatteryAndTheMessages) {
  const auto r = rows(after(61), {80, 24});
  ASSERT_LE(r.size(), 24U);
  EXPECT_EQ(r[0], "bms monitor can0  0:01:00  488 frames  8/s");
  EXPECT_EQ(r[1], "Charge   80.0 % \u00b1 1.7  carried by counting  (display 80.0 %)");
  EXPECT_THAT(r[2], StartsWith("[\u2588\u2588\u2588"));
  EXPECT_THAT(r[2], HasSubstr("\u2592\u2503"));
  EXPECT_EQ(r[3], "Pack     3.320 V   5.04 A charging   24.2 \u00b0C");
  EXPECT_EQ(r[4], "Limits   discharge 60 A (10 s 48 A)   charge 30 A (10 s 24 A)");
  EXPECT_EQ(r[5], "Health   capacity 97.5 % \u00b1 2.4   resistance 112.0 % \u00b1 8.0");
  EXPECT_THAT(r,
              ::testing::Contains(StartsWith("PackState             1.0   0.0 s       61     0     0     0      0")));
}

TEST(Screen, ShowsTheFaultsOfBothMessages) {
  BusState bus = after(3);
  can::Faults faults;
  faults.short_circuit = 1;
  faults.first_cause = 33;
  can::MoreFaults more;
  more.second_line_tripped = 1;
  bus.receive(to_bus_frame(faults.frame(0), 3'000'000));
  bus.receive(to_bus_frame(more.frame(0), 3'000'000));
  std::string all;
  for (const std::string& row : rows(bus, {80, 24})) all += row + '\n';
  EXPECT_THAT(all, HasSubstr("Faults   ShortCircuit"));
  EXPECT_THAT(all, HasSubstr("SecondLineTripped"));
  EXPECT_THAT(all, HasSubstr("FirstCause second line tripped"));
}

TEST(Screen, On40x10ShowsTheMostImportantLines) {
  const auto r = rows(after(61), {40, 10});
  ASSERT_LE(r.size(), 10U);
  for (const std::string& row : r) {
    BusState bus;
    ScreenLine line;
    line.add(row);
    EXPECT_LE(line.columns(), 40U) << row;
  }
  EXPECT_THAT(r[1], StartsWith("Charge   80.0 % \u00b1 1.7"));
  EXPECT_THAT(r[3], StartsWith("Pack     3.320 V   5.04 A"));
  EXPECT_EQ(r[4], "Limits   -60 A  +30 A");
  EXPECT_EQ(r[5], "Health   97.5 %  R 112 %");
}

TEST(Screen, On200x60ShowsEachSignalNextToTheBattery) {
  const auto r = rows(after(61), {200, 60});
  ASSERT_LE(r.size(), 60U);
  std::string all;
  for (const std::string& row : r) all += row + "\n";
  EXPECT_THAT(all, HasSubstr("SecondsSinceAnchor"));
  EXPECT_THAT(all, HasSubstr("0xcafe1234"));
  EXPECT_THAT(all, HasSubstr("ResetCause               power on"));
  EXPECT_THAT(r[2], ::testing::AllOf(StartsWith("Charge   80.0 %"), HasSubstr("Message")));
}

TEST(Screen, FitsEverySizeAndShowsTheChargeIfThereIsRoom) {
  const BusState bus = after(30, 0xFFFFFFFF);
  for (std::size_t columns = 1; columns < 260; columns += 3) {
    for (std::size_t height = 1; height < 80; height += 3) {
      const auto lines = screen(bus, facts(), {columns, height});
      ASSERT_LE(lines.size(), height);
      for (const ScreenLine& line : lines) ASSERT_LE(line.columns(), columns);
      if (columns > 20 && height > 5) {
        ASSERT_THAT(plain_text(lines), HasSubstr("80.0 %")) << columns << "x" << height;
      }
    }
  }
}

TEST(Screen, InAsciiModeContainsOnlyAscii) {
  const std::string text = plain_text(screen(after(5), facts(false), {200, 60}));
  EXPECT_TRUE(std::all_of(text.begin(), text.end(), [](char c) { return (c >= 0x20 && c < 0x7F) || c == '\n'; }));
  EXPECT_THAT(text, HasSubstr("###~~|~"));
}

TEST(Screen, OnlyStaleValuesAreFaint) {
  BusState bus = after(5);
  EXPECT_EQ(style_of(screen(bus, facts(), {80, 24}), "80.0 %"), TextStyle::strong);
  EXPECT_EQ(style_of(screen(bus, facts(), {80, 24}), "discharge 60 A"), TextStyle::plain);
  for (int k = 0; k < 10; ++k) bus.receive(to_bus_frame({0x7AA, 0, {}}, (5 + k) * 1'000'000));
  const auto stale = screen(bus, facts(), {80, 24});
  for (const char* text : {"80.0 %", " V", "discharge 60 A", "capacity", "PackState"})
    EXPECT_EQ(style_of(stale, text), TextStyle::faint) << text;
  EXPECT_THAT(plain_text(stale), Not(HasSubstr("silent"))) << "frames still arrive";
  bus.advance_time(60'000'000);
  EXPECT_THAT(plain_text(screen(bus, facts(), {80, 24})), HasSubstr("silent for 46 s"));
}

TEST(Screen, ShowsTheErrorsOfTheBus) {
  BusState bus = after(5);
  EXPECT_THAT(plain_text(screen(bus, facts(), {80, 24})), Not(HasSubstr("Bus  ")));
  BusFrame corrupted = Traffic(5'000'000).sample().back();
  corrupted.data[3] = static_cast<std::uint8_t>(corrupted.data[3] ^ 1);
  bus.receive(corrupted);
  bus.receive(to_bus_frame({0x7AA, 0, {}}, 5'000'000));
  ScreenFacts more = facts();
  more.dropped = 17;
  more.malformed = 3;
  const auto lines = screen(bus, more, {80, 24});
  EXPECT_THAT(plain_text(lines), HasSubstr("Bus      17 dropped by the kernel, 1 CRC errors, 3 malformed lines"));
  EXPECT_THAT(plain_text(lines), HasSubstr("Other ids 7AA:1"));
  EXPECT_EQ(style_of(lines, "17 dropped"), TextStyle::alarm);
}

TEST(Screen, SaysThatNoFramesWereReceived) {
  EXPECT_THAT(plain_text(screen({}, facts(), {80, 24})), HasSubstr("no frames received yet"));
  EXPECT_EQ(status_line({}, facts()), "0:00:00  no BMS message in 0 frames");
}

TEST(Screen, ASourceNameCannotContainEscapeCodes) {
  ScreenFacts malicious = facts();
  malicious.source = "slcan:/dev/\x1b]0;x\x07\xff";
  EXPECT_EQ(plain_text(screen(after(1), malicious, {80, 24})).find_first_of("\x1b\x07\xff"), std::string::npos);
}

TEST(Screen, AFrameIsOneSynchronisedUpdateWithoutClearingFirst) {
  const std::string frame = ansi_frame(screen(after(5), facts(), {80, 24}));
  EXPECT_THAT(frame, StartsWith("\x1b[?2026h\x1b[H"));
  EXPECT_THAT(frame, ::testing::EndsWith("\x1b[J\x1b[?2026l"));
  EXPECT_THAT(frame, Not(HasSubstr("\x1b[2J")));
  EXPECT_THAT(frame, Not(::testing::EndsWith("\n"))) << "a line end after the last row would scroll the screen";
  EXPECT_THAT(frame, HasSubstr("\x1b[1m80.0 %\x1b[0m"));
}

TEST(StatusLine, ShowsTheBatteryInOneLine) {
  EXPECT_EQ(status_line(after(61), facts()),
            "0:01:00  79.99 % +- 1.72  3.320 V  5.04 A  24.2 degC  carried by counting");
  BusState bus = after(5);
  bus.advance_time(24'000'000);
  EXPECT_THAT(status_line(bus, facts()), HasSubstr("stale for 20 s"));
}

}  // namespace
}  // namespace bms::monitor
