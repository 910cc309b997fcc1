// The collection of the stored data from frames, and the commands that ask for them.
#include "monitor/stored_data.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "can_messages.hpp"
#include "monitor/stored_data_request.hpp"

namespace bms::monitor {
namespace {

using ::testing::HasSubstr;

/// A battery that answers as firmware/can/messages.md describes: two faults, and counters.
class Battery {
 public:
  /// The frames of a part.
  std::vector<can::Frame> part(std::uint32_t k) {
    std::vector<can::Frame> frames;
    const auto send = [&](const auto& message) {
      std::uint8_t& counter = counters_[message.id];
      frames.push_back(message.frame(counter));
      counter = can::next(counter);
    };
    if (k < 16) {
      can::StoredFault fault;
      can::StoredFaultPack pack;
      can::StoredFaultCells cells;
      fault.index = pack.index = cells.index = k;
      fault.number = pack.number = cells.number = (faults - k) & 0xFF;
      if (k == 0) {
        fault.code = can::Faults::first_cause_contactor_welded;
        fault.time = 1'790'000'000;
        pack.soc = 54.5F;
        pack.current = -412.25F;
        pack.highest_temperature = 41;
        pack.lowest_temperature = -7;
        cells.highest_voltage = 3.412F;
        cells.lowest_voltage = 2.871F;
      } else if (k == 1) {
        fault.code = 128 + 5;
        fault.time = 7'200;
      }
      send(fault);
      send(pack);
      send(cells);
      return frames;
    }
    if (k >= 23) {
      send(action(k - 23));
      send(detail(k - 23));
    } else {
      send(counts_of(k - 16));
    }
    if (k == 16) {
      can::StoredUse use;
      use.operating_time = 360'000;
      use.cycles = 12.5F;
      send(use);
    } else if (k == 17) {
      send(throughput());
    } else if (k == 18 || k == 19) {
      can::StoredExtremes extremes;
      extremes.kind = k - 18;
      extremes.voltage = k == 18 ? 2.5F : 3.65F;
      extremes.temperature = k == 18 ? -20.0F : 55.0F;
      extremes.current = k == 18 ? -500.0F : 250.0F;
      send(extremes);
    } else if (k == 20) {
      can::CanErrors errors;
      errors.state = can::CanErrors::state_active;
      errors.dropped = 3;
      send(errors);
    }
    return frames;
  }

  std::uint32_t faults = 2;

 private:
  static can::StoredThroughput throughput() {
    can::StoredThroughput m;
    m.charged = 25'003;
    m.discharged = 25'000;
    return m;
  }
  static can::StoredAction action(std::uint32_t index) {
    can::StoredAction m;
    m.index = index;
    if (index == 0) m.code = can::StoredAction::code_clear_faults;
    if (index == 1) m.code = can::StoredAction::code_session_opened;
    if (index < 2) m.time = 1'790'000'060 - 10 * index;
    return m;
  }
  static can::StoredActionDetail detail(std::uint32_t index) {
    can::StoredActionDetail m;
    m.index = index;
    if (index < 2) m.operator_number = 4'711;
    if (index == 0) m.argument = 1;
    return m;
  }
  can::StoredCounts counts_of(std::uint32_t cause) const {
    can::StoredCounts counts;
    counts.cause = cause;
    counts.resets = 10 * cause;
    counts.faults = faults;
    return counts;
  }

  std::map<std::uint32_t, std::uint8_t> counters_;
};

class StoredDataOnTheBus : public ::testing::Test {
 protected:
  void receive(const can::Frame& frame) { request.receive(bus, bus.receive(to_bus_frame(frame, ++time_us_)), now_s); }
  /// The battery's reaction to a command; `lost` decides which frames do not arrive.
  template <class Lost>
  void answer(const can::Frame& frame, std::uint32_t result, const Lost& lost) {
    const auto command = can::Command::of(frame);
    EXPECT_EQ(command.code, can::Command::code_stored_data);
    can::CommandAnswer reply;
    reply.code = command.code;
    reply.result = result;
    reply.command_counter = can::counter_of(frame);
    receive(reply.frame(answers_ = can::next(answers_)));
    if (result != can::CommandAnswer::result_done) return;
    const std::uint32_t first = command.argument & 0xFF, count = command.argument >> 8;
    asked.emplace_back(first, count);
    for (std::uint32_t k = first; k < (count == 0 ? 39 : first + count); ++k) {
      for (const can::Frame& f : battery.part(k)) {
        now_s += 0.03;
        if (!lost(k, f)) receive(f);
      }
    }
  }
  static constexpr auto nothing_lost = [](std::uint32_t, const can::Frame&) { return false; };

  Battery battery;
  BusState bus;
  StoredDataRequest request;
  double now_s = 100;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> asked;

 private:
  std::int64_t time_us_ = 0;
  std::uint8_t answers_ = 0;
};

TEST_F(StoredDataOnTheBus, AreCollectedWithOneCommand) {
  const auto command = request.due(now_s);
  ASSERT_TRUE(command);
  EXPECT_FALSE(request.due(now_s + 1)) << "the battery may need a moment";
  answer(*command, can::CommandAnswer::result_done, nothing_lost);
  ASSERT_EQ(request.state(), StoredDataRequest::State::complete);
  const StoredData& data = request.data();
  const auto faults = data.stored_faults();
  ASSERT_EQ(faults.size(), 2U);
  EXPECT_EQ(faults[0].name, "processor exception 5");
  EXPECT_FALSE(faults[0].has_calendar_time());
  EXPECT_EQ(faults[1].name, "contactor welded");
  EXPECT_DOUBLE_EQ(faults[1].soc, 0.545);
  EXPECT_DOUBLE_EQ(faults[1].current_a, -412.25);
  EXPECT_DOUBLE_EQ(faults[1].cell_voltage_min_v, 2.871);
  EXPECT_EQ(data.charged_ah, 2'500.3);
  EXPECT_EQ(data.lowest.current_a, -500);
  EXPECT_EQ(data.highest.cell_voltage_v, 3.65);
  EXPECT_EQ(data.resets[4].name, "watchdog");
  EXPECT_EQ(data.resets[4].count, 40);
}

TEST_F(StoredDataOnTheBus, AreWrittenAsCsvOldestFirst) {
  answer(*request.due(now_s), can::CommandAnswer::result_done, nothing_lost);
  EXPECT_EQ(csv_of(request.data()),
            "fault,time_utc,unix_time_s,operating_s,soc,current_a,cell_voltage_max_v,cell_voltage_min_v,"
            "temperature_max_c,temperature_min_c\n"
            "processor exception 5,,,7200,,,,,,\n"
            "contactor welded,2026-09-21 14:13:20,1790000000,,0.545,-412.25,3.412,2.871,41,-7\n");
}

TEST_F(StoredDataOnTheBus, AreWrittenAsJsonAndForAPerson) {
  answer(*request.due(now_s), can::CommandAnswer::result_done, nothing_lost);
  const auto json = nlohmann::json::parse(json_of(request.data(), "can0"));
  EXPECT_EQ(json["command"], "log");
  EXPECT_EQ(json["faults"][1]["name"], "contactor welded");
  EXPECT_EQ(json["faults"][0]["soc"], nullptr);
  EXPECT_EQ(json["operating_s"], 360'000);
  EXPECT_EQ(json["resets"]["power on"], 10);
  EXPECT_EQ(json["can"]["errors"]["Dropped"], 3);
  const std::string text = summary_of(request.data());
  EXPECT_THAT(text, HasSubstr("contactor welded             2026-09-21 14:13:20 UTC"));
  EXPECT_THAT(text, HasSubstr("processor exception 5        after 2.0 h of operation"));
  EXPECT_THAT(text, HasSubstr("100.0 h in operation, 12.5 full cycles"));
  EXPECT_THAT(text, HasSubstr("2500.3 Ah charged, 2500.0 Ah discharged"));
  EXPECT_THAT(text, HasSubstr("cell       2.500 to 3.650 V"));
  EXPECT_THAT(text, HasSubstr("current    -500.00 to 250.00 A"));
}

TEST_F(StoredDataOnTheBus, WhatIsLostIsAskedForAgain) {
  answer(*request.due(now_s), can::CommandAnswer::result_done, [](std::uint32_t k, const can::Frame& f) {
    return (k == 3 && f.id == can::StoredFaultPack::id) || (k == 5 && f.id == can::StoredFault::id);
  });
  EXPECT_EQ(request.state(), StoredDataRequest::State::waiting);
  EXPECT_EQ(request.data().missing_parts(), 2U);
  EXPECT_FALSE(request.due(now_s + 2)) << "more may come";
  now_s += 2.6;
  answer(*request.due(now_s), can::CommandAnswer::result_done,
         [](std::uint32_t k, const can::Frame&) { return k == 5; });
  now_s += 2.6;
  answer(*request.due(now_s), can::CommandAnswer::result_done, nothing_lost);
  EXPECT_EQ(request.state(), StoredDataRequest::State::complete);
  const std::vector<std::pair<std::uint32_t, std::uint32_t>> expected{{0, 0}, {3, 3}, {5, 1}};
  EXPECT_EQ(asked, expected);
}

TEST_F(StoredDataOnTheBus, AFaultThatIsStoredMeanwhileStartsThemAgain) {
  answer(*request.due(now_s), can::CommandAnswer::result_done, [this](std::uint32_t k, const can::Frame& f) {
    if (k == 1 && f.id == can::StoredFaultCells::id) battery.faults = 3;
    return false;
  });
  EXPECT_EQ(request.state(), StoredDataRequest::State::waiting);
  now_s += 2.6;
  answer(*request.due(now_s), can::CommandAnswer::result_done, nothing_lost);
  EXPECT_EQ(request.state(), StoredDataRequest::State::complete);
  EXPECT_EQ(request.data().fault_count, 3);
}

TEST_F(StoredDataOnTheBus, WhatServiceSessionsHaveDoneIsShownWithWhoDidIt) {
  answer(*request.due(now_s), can::CommandAnswer::result_done, nothing_lost);
  const auto actions = request.data().stored_actions();
  ASSERT_EQ(actions.size(), 2U);
  EXPECT_EQ(actions[0].name, "session opened");
  EXPECT_EQ(actions[1].name, "clear faults");
  EXPECT_EQ(actions[1].operator_number, 4'711U);
  EXPECT_THAT(summary_of(request.data()),
              HasSubstr("clear faults                 2026-09-21 14:14:20 UTC        operator 4711, argument 1"));
  EXPECT_EQ(nlohmann::json::parse(json_of(request.data(), "can0"))["actions"][1]["operator"], 4'711);
}

TEST_F(StoredDataOnTheBus, OfFirmwareWithoutServiceSessionsAreCompleteWithoutThem) {
  answer(*request.due(now_s), can::CommandAnswer::result_done,
         [](std::uint32_t k, const can::Frame&) { return k >= 23; });
  EXPECT_EQ(request.state(), StoredDataRequest::State::waiting);
  now_s += 2.6;
  answer(*request.due(now_s), can::CommandAnswer::result_refused, nothing_lost);
  EXPECT_EQ(request.state(), StoredDataRequest::State::complete);
}

TEST_F(StoredDataOnTheBus, AnOldFirmwareAndARefusalEndTheRequest) {
  answer(*request.due(now_s), can::CommandAnswer::result_no_such_command, nothing_lost);
  EXPECT_EQ(request.state(), StoredDataRequest::State::unsupported);
  EXPECT_FALSE(request.due(now_s + 100));
  request = {};
  answer(*request.due(now_s), can::CommandAnswer::result_refused, nothing_lost);
  EXPECT_EQ(request.state(), StoredDataRequest::State::refused);
}

TEST_F(StoredDataOnTheBus, ASilentBatteryIsAskedFiveTimesWithAnotherCounterEachTime) {
  std::vector<int> counters;
  for (; request.state() == StoredDataRequest::State::waiting && now_s < 200; now_s += 0.1) {
    if (const auto command = request.due(now_s)) counters.push_back(can::counter_of(*command));
  }
  EXPECT_EQ(request.state(), StoredDataRequest::State::given_up);
  EXPECT_EQ(counters, (std::vector<int>{1, 2, 3, 4, 5}));
  EXPECT_FALSE(request.answered());
}

}  // namespace
}  // namespace bms::monitor
