#include "monitor/bus_state.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include <fmt/format.h>

#include "files/recording.hpp"
#include "j1939_messages.hpp"
#include "monitor/history.hpp"
#include "monitor/pack_view.hpp"
#include "monitor/results.hpp"
#include "monitor/screen.hpp"
#include "tests/host_sim/monitor/traffic.hpp"

namespace bms::monitor {
namespace {

using ::testing::HasSubstr;

constexpr std::int64_t second_us = 1'000'000;

const MessageState& state(const BusState& bus, const char* message) { return bus.states().at(BusState::find(message)); }

void receive_all(BusState& bus, const std::vector<BusFrame>& frames) {
  for (const BusFrame& frame : frames) bus.receive(frame);
}

BusFrame pack_state(float soc, std::uint8_t counter, std::int64_t time_us) {
  can::PackState m;
  m.soc = soc;
  return to_bus_frame(m.frame(counter), time_us);
}

TEST(BusState, StoresTheLastValueOfEachSignal) {
  Traffic traffic;
  BusState bus;
  for (int k = 0; k < 20; ++k) receive_all(bus, traffic.sample());
  EXPECT_NEAR(bus.reading("PackState", "Soc").value, static_cast<double>(Traffic::soc_percent(19)), 0.001);
  EXPECT_EQ(bus.reading("Status", "SampleCounter").value, 20);
  EXPECT_EQ(bus.reading("Identity", "CellHash").value, 0xCAFE1234);
  EXPECT_EQ(bus.reading("CurrentLimits", "ChargeTenSeconds").value, 24);
  EXPECT_FALSE(bus.reading("SensorErrors", "CurrentOffset").known()) << "never received";
  EXPECT_FALSE(bus.reading("NoSuchMessage", "Soc").known());
  EXPECT_FALSE(bus.reading("PackState", "NoSuchSignal").known());
}

TEST(BusState, AnInvalidValueIsUnknownButNotStale) {
  BusState bus;
  bus.receive(pack_state(54, 0, 0));
  EXPECT_TRUE(bus.reading("PackState", "Soc").known());
  bus.receive(pack_state(can::unknown, 1, 10));
  EXPECT_FALSE(bus.reading("PackState", "Soc").known());
  EXPECT_FALSE(bus.reading("PackState", "Soc").stale) << "the invalid value itself is new";
  can::PackState m;
  m.soc_quality = 15;
  bus.receive(to_bus_frame(m.frame(2), 20));
  EXPECT_FALSE(bus.reading("PackState", "SocQuality").known()) << "the invalid value of an integer signal";
  EXPECT_EQ(pack_view(bus).soc_quality.text, "not known");
}

TEST(BusState, EachMessageOfTheDbcFilesHasItsNamesUnitsAndComments) {
  std::set<std::uint32_t> ids;
  for (const MessageInfo& m : messages()) {
    ids.insert(m.id);
    EXPECT_FALSE(m.signals.empty()) << m.name;
    for (const SignalInfo& s : m.signals) EXPECT_STRNE(s.comment, "") << m.name << "." << s.name;
  }
  EXPECT_EQ(ids.size(), messages().size());
  const MessageInfo& pack = messages().at(BusState::find("PackState"));
  EXPECT_EQ(text_of(pack.signals[0], 2), "carried by counting");
  EXPECT_STREQ(pack.signals[1].name, "Soc");
  EXPECT_STREQ(pack.signals[1].unit, "%");
  EXPECT_EQ(text_of(pack.signals[1], 54.3), "54.300 %");
}

TEST(BusState, CountsFramesThatAreMissingAccordingToTheCounter) {
  BusState bus;
  for (const int counter : {0, 1, 2, 5, 14, 0, 1})
    bus.receive(pack_state(50, static_cast<std::uint8_t>(counter), counter));
  EXPECT_EQ(state(bus, "PackState").frames, 7U);
  EXPECT_EQ(state(bus, "PackState").lost, 2U + 8U);
  EXPECT_EQ(state(bus, "PackState").repeated, 0U);
}

TEST(BusState, ARepeatedFrameIsNotAccepted) {
  BusState bus;
  bus.receive(pack_state(50, 3, 0));
  for (int k = 1; k <= 10; ++k) bus.receive(pack_state(60, 3, k * second_us));
  EXPECT_EQ(state(bus, "PackState").repeated, 10U);
  EXPECT_EQ(bus.reading("PackState", "Soc").value, 50);
  EXPECT_TRUE(bus.reading("PackState", "Soc").stale) << "a sender that repeats a frame hangs";
}

TEST(BusState, ACorruptedFrameOrAWrongLengthChangesNoValue) {
  BusState bus;
  bus.receive(pack_state(50, 0, 0));
  for (std::size_t byte = 0; byte < 8; ++byte) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      BusFrame corrupted = pack_state(60, 1, second_us);
      corrupted.data[byte] = static_cast<std::uint8_t>(corrupted.data[byte] ^ (1U << bit));
      bus.receive(corrupted);
    }
  }
  EXPECT_EQ(state(bus, "PackState").crc_errors, 64U);
  for (const std::uint8_t length : std::initializer_list<std::uint8_t>{0, 1, 7}) {
    BusFrame cut = pack_state(60, 1, second_us);
    cut.length = length;
    bus.receive(cut);
  }
  EXPECT_EQ(state(bus, "PackState").wrong_length, 3U);
  BusFrame of_another = pack_state(60, 1, second_us);
  of_another.id = can::PackElectrical::id;
  bus.receive(of_another);
  EXPECT_EQ(state(bus, "PackElectrical").crc_errors, 1U) << "the CRC includes the data id";
  can::Frame fifteen = to_can_frame(pack_state(60, 0, 0));
  can::protect(fifteen, can::PackState::data_id, 15);
  bus.receive(to_bus_frame(fifteen, second_us));
  EXPECT_EQ(state(bus, "PackState").crc_errors, 65U) << "15 is not a valid counter";
  EXPECT_EQ(state(bus, "PackState").frames, 1U);
  EXPECT_EQ(bus.reading("PackState", "Soc").value, 50);
}

TEST(BusState, IsStaleAfterThreeCyclesOrThreeSeconds) {
  Traffic traffic(0);
  BusState bus;
  receive_all(bus, traffic.sample());
  for (const char* name : {"PackState", "CurrentLimits"}) {  // without a cycle time; one second
    const std::size_t k = BusState::find(name);
    BusState later = bus;
    later.advance_time(3 * second_us);
    EXPECT_FALSE(later.stale(k)) << name;
    later.advance_time(3 * second_us + 1);
    EXPECT_TRUE(later.stale(k)) << name;
  }
  EXPECT_TRUE(bus.stale(BusState::find("SensorErrors"))) << "never received";
}

TEST(BusState, RateFollowsThePeriodOfTheMessage) {
  Traffic traffic(0, 50'000);
  BusState bus;
  for (int k = 0; k < 200; ++k) receive_all(bus, traffic.sample());
  EXPECT_NEAR(state(bus, "PackState").rate_hz(), 20, 0.01);
  EXPECT_NEAR(state(bus, "Health").rate_hz(), 1, 0.01);
}

TEST(BusState, AClockSetBackDoesNotMakeMessagesStaleForever) {
  Traffic first(1'000'000 * second_us), second(100 * second_us);
  BusState bus;
  for (int k = 0; k < 60; ++k) receive_all(bus, first.sample());
  for (int k = 0; k < 60; ++k) receive_all(bus, second.sample());
  EXPECT_FALSE(bus.stale(BusState::find("PackState")));
  EXPECT_NEAR(bus.duration_s(), 118, 0.01);
  for (int k = 0; k < 5; ++k) bus.receive(to_bus_frame({0x7AA, 0, {}}, (160 + k) * second_us));
  EXPECT_TRUE(bus.stale(BusState::find("PackState"))) << "no longer received";
}

TEST(BusState, UnknownIdsHaveATableOfFixedSizeAndTheOthersAreCounted) {
  BusState bus;
  for (std::uint32_t id = 0; id < 100'000; ++id) {
    BusFrame frame;
    frame.kind = FrameKind::extended;
    frame.long_id = true;
    frame.id = id;
    bus.receive(frame);
    bus.receive(to_bus_frame({0x7AA, 0, {}}, 0));
  }
  EXPECT_EQ(bus.unknown_ids().size(), 64U);
  EXPECT_EQ(bus.unknown_frames(), 200'000U);
  EXPECT_EQ(bus.unknown_ids()[1].id, 0x7AAU);
  EXPECT_EQ(bus.unknown_ids()[1].frames, 100'000U);
  EXPECT_EQ(bus.unknown_overflow(), 100'000U - 63U);
}

TEST(BusState, FramesOfOtherKindsAreCountedAndNotDecoded) {
  BusState bus;
  for (const FrameKind kind : {FrameKind::remote, FrameKind::error, FrameKind::fd, FrameKind::extended}) {
    BusFrame frame = pack_state(50, 0, 0);
    frame.kind = kind;
    bus.receive(frame);
  }
  EXPECT_EQ(bus.frames(), 4U);
  EXPECT_EQ(bus.accepted(), 0U);
  EXPECT_EQ(bus.remote(), 1U);
  EXPECT_EQ(bus.errors(), 1U);
  EXPECT_EQ(bus.fd(), 1U);
  EXPECT_EQ(bus.unknown_frames(), 1U);
}

TEST(BusState, AFrameOfTheJ1939ProfileIsDecodedWithoutCounterAndCrc) {
  BusState bus;
  BusFrame frame;  // DC_SOURCE_STATUS_1, packed by hand: 52.8 V, 12.345 A discharge
  frame.kind = FrameKind::extended;
  frame.long_id = true;
  frame.id = 0x19FFFD80;
  frame.length = 8;
  frame.data = {1, 120, 0x20, 0x04, 0x39, 0xC4, 0x35, 0x77};
  for (int k = 0; k < 3; ++k) {
    frame.time_us = k * second_us;
    EXPECT_EQ(bus.receive(frame), BusState::find("DcSourceStatus1"))
        << "without a counter the same bytes are a new frame";
  }
  EXPECT_EQ(bus.accepted(), 3U);
  EXPECT_EQ(bus.unknown_frames(), 0U);
  EXPECT_NEAR(bus.reading("DcSourceStatus1", "Voltage").value, 52.8, 1e-9);
  EXPECT_NEAR(bus.reading("DcSourceStatus1", "Current").value, 12.345, 1e-9) << "32 bits do not fit in a float";
  EXPECT_EQ(state(bus, "DcSourceStatus1").repeated, 0U);
  EXPECT_THAT(json_of(bus, {}), HasSubstr("\"DcSourceStatus1\""));
  EXPECT_THAT(plain_text(screen(bus, {}, {120, 40})), HasSubstr("DcSourceStatus1"));
  for (std::size_t k = 4; k < 8; ++k) frame.data[k] = 0xFF;
  bus.receive(frame);
  EXPECT_FALSE(bus.reading("DcSourceStatus1", "Current").known());
  frame.length = 7;
  bus.receive(frame);
  EXPECT_EQ(state(bus, "DcSourceStatus1").wrong_length, 1U);
  frame.kind = FrameKind::standard;
  frame.long_id = false;
  frame.id &= 0x7FF;
  bus.receive(frame);
  EXPECT_EQ(bus.unknown_frames(), 1U) << "its lower eleven bits are a different id";
}

TEST(BusState, IsCompleteAfterASampleAndTheLongestCycle) {
  Traffic traffic(0);
  BusState bus;
  receive_all(bus, traffic.sample());
  EXPECT_FALSE(bus.complete()) << "SensorErrors may still arrive";
  receive_all(bus, traffic.sample());
  EXPECT_FALSE(bus.complete());
  receive_all(bus, traffic.sample());
  EXPECT_TRUE(bus.complete());
  BusState noise;
  for (int k = 0; k < 100; ++k) noise.receive(to_bus_frame({0x7AA, 0, {}}, k * second_us));
  EXPECT_FALSE(noise.complete());
}

TEST(BusState, AcceptsAnyFrames) {
  std::mt19937_64 random(4);
  BusState bus;
  for (int run = 0; run < 200'000; ++run) {
    BusFrame frame;
    frame.time_us = static_cast<std::int64_t>(random() % 100'000'000'000'000'000);
    frame.kind = static_cast<FrameKind>(random() % 5);
    if (frame.kind == FrameKind::standard)
      frame.id = static_cast<std::uint32_t>(0x180 + random() % 16);
    else
      frame.id = run % 4 == 0 ? can::j1939::DcSourceStatus1::id : static_cast<std::uint32_t>(random() % 0x1FFFFFFF);
    frame.long_id = frame.kind == FrameKind::extended;
    frame.length = static_cast<std::uint8_t>(random() % 9);
    for (std::uint8_t& byte : frame.data) byte = static_cast<std::uint8_t>(random());
    if (frame.kind == FrameKind::standard && random() % 2 == 0) {  // valid but for its values
      for (const MessageInfo& m : messages()) {
        if (m.id != frame.id || m.long_id) continue;
        can::Frame whole = to_can_frame(frame);
        whole.length = 8;
        can::protect(whole, m.data_id, static_cast<std::uint8_t>(random() % 15));
        frame = to_bus_frame(whole, frame.time_us);
      }
    }
    bus.receive(frame);
    if (run % 1'000 == 0) {
      EXPECT_FALSE(json_of(bus, {}).empty());
      EXPECT_FALSE(csv_row(bus).empty());
      EXPECT_FALSE(screen(bus, {}, {200, 60}).empty());
    }
  }
  EXPECT_GT(bus.accepted(), 10'000U);
}

TEST(PackView, NamesTheFlagsOfTheEstimateThatAreSet) {
  Traffic traffic;
  traffic.flags = 1U << 2 | 1U << 9 | 1U << 30;
  BusState bus;
  receive_all(bus, traffic.sample());
  const PackView view = pack_view(bus);
  ASSERT_EQ(view.flags.size(), 3U);
  EXPECT_EQ(view.flags[0].text, "voltage stuck");
  EXPECT_EQ(view.flags[1].text, "more than one state of charge fits");
  EXPECT_EQ(view.flags[2].text, "unknown flags 0x40000000");
}

TEST(Results, CsvHasAFieldForEachColumnAndOmitsStaleValues) {
  Traffic traffic(0);
  BusState bus;
  receive_all(bus, traffic.sample());
  const auto commas = [](const std::string& text) { return std::count(text.begin(), text.end(), ','); };
  EXPECT_EQ(commas(csv_head()), commas(csv_row(bus)));
  EXPECT_THAT(csv_head(), ::testing::StartsWith("time_s,current_a,voltage_v,temperature_c,"));
  EXPECT_THAT(csv_head(), HasSubstr(",PackState.Soc [%],"));
  EXPECT_THAT(csv_row(bus), HasSubstr(",80,"));
  bus.advance_time(100 * second_us);
  EXPECT_EQ(csv_row(bus), "0.000000" + std::string(static_cast<std::size_t>(commas(csv_head())), ',') + "\n");
}

/// What bms diagnose --pack reads.
TEST(Results, CsvOfAPackHasTheCellsAndTheirMeanAsARecording) {
  BusState bus;
  can::PackElectrical electrical;
  electrical.current = -5;
  electrical.voltage = 13.22F;
  can::CellVoltages1 cells;
  cells.cell1 = 3.301F;
  cells.cell2 = 3.302F;
  cells.cell4 = 3.309F;
  receive_all(bus, {to_bus_frame(electrical.frame(0), 0), to_bus_frame(cells.frame(0), 0)});
  EXPECT_THAT(csv_head(), HasSubstr(",v_1,v_2,"));
  EXPECT_THAT(csv_head(), HasSubstr(",t_1,"));
  EXPECT_THAT(csv_head(), HasSubstr(",pack_voltage_v,"));
  std::string rows = csv_head();
  for (int k = 0; k < 12; ++k) {
    std::string row = csv_row(bus);
    rows += fmt::format("{}", k) + row.substr(row.find(','));
  }
  const measurement::Recording r = files::parse_recording(rows, "monday.csv");
  ASSERT_EQ(r.cell_voltage_v.size(), 4U) << "no empty columns of cells that the pack does not have";
  EXPECT_DOUBLE_EQ(r.cell_voltage_v[0][0], 3.301);
  EXPECT_TRUE(std::isnan(r.cell_voltage_v[2][0])) << "not known";
  EXPECT_NEAR(r.voltage_v[0], 3.304, 1e-6) << "the mean of the cells";
  EXPECT_DOUBLE_EQ(r.pack_voltage_v[0], 13.22);
  EXPECT_TRUE(r.cell_temperature_c.empty());
}

TEST(History, StoresOneHourWithAtMostTwoPointsPerSecond) {
  Traffic traffic(0, 100'000);
  BusState bus;
  History history;
  for (int k = 0; k < 60'000; ++k) {
    receive_all(bus, traffic.sample());
    if (history.is_due(bus.now_us())) history.add(point_of(bus), bus.now_us());
  }
  EXPECT_EQ(history.count(), 12'000U);
  EXPECT_EQ(history.first(), 12'000U - History::capacity);
  EXPECT_NEAR(history.at(history.first()).time_s, 2'400, 0.01);
  EXPECT_NEAR(history.at(history.count() - 1).time_s, 5'999.5, 0.01);
}

}  // namespace
}  // namespace bms::monitor
