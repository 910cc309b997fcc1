// The stored data on the bus: what was stored comes back with the right values, part by part.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "tests/firmware/stored_state_fixture.hpp"

namespace bms::firmware {
namespace {

using host_hal::last;
using host_hal::sent;

/// The frames of a message, in the order of sending.
template <class Message>
std::vector<Message> all() {
  std::vector<Message> found;
  for (const can::Frame& frame : sent) {
    if (frame.id == Message::id && can::intact(frame, Message::data_id)) found.push_back(Message::of(frame));
  }
  return found;
}

class StoredDataTest : public StoredStateTest {
 protected:
  static constexpr std::uint32_t parts = 16 + 7 + 16;

  /// Requests parts and collects the frames of the samples that follow.
  std::uint32_t request(HostBoard& board, std::uint32_t argument, int samples = parts + 2) {
    sent.clear();
    send_command(board, can::Command::code_stored_data, argument);
    run(board, samples);
    return last<can::CommandAnswer>()->result;
  }
  /// A sample with a short circuit, which is latched for service.
  void short_circuit(HostBoard& board) {
    Input in = second();
    in.pack.current_ua = -60'000'000;
    board.process_sample(in);
  }
};

TEST_F(StoredDataTest, AFaultComesBackWithTimeAndReadings) {
  HostBoard board(new_chip, start);
  run(board, 5);
  host_hal::calendar = 1'790'000'000;
  short_circuit(board);
  const float soc = last<can::PackState>()->soc;
  EXPECT_EQ(request(board, 0), can::CommandAnswer::result_done);
  const auto faults = all<can::StoredFault>();
  const auto pack = all<can::StoredFaultPack>();
  const auto cells = all<can::StoredFaultCells>();
  ASSERT_EQ(faults.size(), 16U);
  ASSERT_EQ(pack.size(), 16U);
  ASSERT_EQ(cells.size(), 16U);
  std::size_t found = 0;
  for (std::size_t k = 0; k < 16; ++k) {
    EXPECT_EQ(faults[k].index, k);
    EXPECT_EQ(pack[k].index, k);
    EXPECT_EQ(cells[k].index, k);
    EXPECT_EQ(pack[k].number, faults[k].number);
    EXPECT_EQ(cells[k].number, faults[k].number);
    if (faults[k].code != can::Faults::first_cause_short_circuit) continue;
    ++found;
    EXPECT_EQ(faults[k].time, 1'790'000'000U);
    EXPECT_NEAR(pack[k].soc, soc, 0.51);
    EXPECT_EQ(pack[k].current, -60);
    EXPECT_EQ(pack[k].highest_temperature, 25);
    EXPECT_EQ(pack[k].lowest_temperature, 25);
    EXPECT_NEAR(cells[k].highest_voltage, 3.270, 0.001);
    EXPECT_NEAR(cells[k].lowest_voltage, 3.240, 0.001);
  }
  EXPECT_EQ(found, 1U);
  EXPECT_EQ(faults[15].code, 0U) << "no fault";
}

TEST_F(StoredDataTest, WithoutACalendarTheTimeIsThatInOperation) {
  HostBoard board(new_chip, start);
  run(board, 125);
  short_circuit(board);
  request(board, 0);
  EXPECT_EQ(all<can::StoredFault>()[0].time, 120U) << "counted in minutes of operation";
}

TEST_F(StoredDataTest, ReadingsThatAreMissingAreNotKnown) {
  HostBoard board(new_chip, start);
  run(board, 3);
  for (int k = 0; k < 100; ++k) {
    Input in = second();
    in.pack.temperature_cdegc.fill(measurement::no_temperature);
    in.pack.current_ua = measurement::no_reading;
    in.pack.cell_uv[3] = 9'000'000;  // beyond the sensor
    in.pack.cell_uv[7] = 0;          // a broken wire
    board.process_sample(in);
  }
  request(board, 0);
  EXPECT_TRUE(std::isnan(all<can::StoredFaultPack>()[0].highest_temperature));
  EXPECT_TRUE(std::isnan(all<can::StoredFaultPack>()[0].lowest_temperature));
  EXPECT_TRUE(std::isnan(all<can::StoredFaultPack>()[0].current));
  EXPECT_NEAR(all<can::StoredFaultCells>()[0].highest_voltage, 3.270, 0.001);
  EXPECT_NEAR(all<can::StoredFaultCells>()[0].lowest_voltage, 3.240, 0.001);
}

TEST_F(StoredDataTest, FaultsSurviveALossOfPowerAndHaveConsecutiveNumbers) {
  std::vector<std::uint8_t> kept;
  can::StoredFault newest;
  {
    HostBoard board(new_chip, start);
    run(board, 5);
    short_circuit(board);
    request(board, 0);
    newest = all<can::StoredFault>()[0];
    kept = board.flash();
  }
  host_hal::cause = hal::ResetCause::watchdog;  // raises an internal fault
  HostBoard board(kept, start);
  run(board, 200);  // a fault that is stored while they are read would shift their indices
  request(board, 0);
  const auto faults = all<can::StoredFault>();
  const std::uint32_t more = faults[0].number - newest.number;
  ASSERT_GE(more, 1U);
  ASSERT_LT(more, 8U);
  EXPECT_EQ(faults[more].code, newest.code);
  EXPECT_EQ(faults[more].time, newest.time);
  EXPECT_TRUE(std::any_of(faults.begin(), faults.begin() + more,
                          [](const auto& f) { return f.code == can::Faults::first_cause_internal_fault; }));
  for (std::size_t k = 0; k < faults.size(); ++k) EXPECT_EQ(faults[k].number, (faults[0].number - k) & 0xFF);
}

TEST_F(StoredDataTest, ThroughputCyclesAndTimeAreTheSumsOverAllRuns) {
  std::vector<std::uint8_t> kept = new_chip;
  for (int runs = 0; runs < 2; ++runs) {
    HostBoard board(kept, start);
    for (int k = 0; k < 3'601; ++k) {
      Input in = second();
      in.pack.current_ua = k < 1'801 ? 6'000'000 : -12'000'000;
      board.process_sample(in);
    }
    board.shut_down();
    kept = board.flash();
    if (runs == 0) continue;
    request(board, 0);
  }
  EXPECT_NEAR(last<can::StoredUse>()->operating_time, 2 * 3'600U, 60);
  const double discharged_ah = 2 * 12 * 0.5, charged_ah = 2 * 6 * 0.5;
  EXPECT_NEAR(0.1 * last<can::StoredThroughput>()->charged, charged_ah, 0.2);
  EXPECT_NEAR(0.1 * last<can::StoredThroughput>()->discharged, discharged_ah, 0.2);
  EXPECT_NEAR(last<can::StoredUse>()->cycles, discharged_ah / 6, 0.11) << "6 Ah";
}

TEST_F(StoredDataTest, ExtremesAreTheLowestAndTheHighestReadingsOfAllRuns) {
  std::vector<std::uint8_t> kept;
  const auto extremes = [&](HostBoard& board) {
    request(board, 0);
    const auto both = all<can::StoredExtremes>();
    EXPECT_EQ(both.size(), 2U);
    EXPECT_EQ(both[0].kind, can::StoredExtremes::kind_lowest);
    EXPECT_EQ(both[1].kind, can::StoredExtremes::kind_highest);
    return both;
  };
  {
    HostBoard board(new_chip, start);
    run(board, 5);
    Input in = second();
    in.pack.current_ua = -20'000'000;
    in.pack.cell_uv[9] = 2'900'000;
    in.pack.temperature_cdegc = {1'000, 3'100, 2'000, 2'000};
    board.process_sample(in);
    board.shut_down();
    kept = board.flash();
  }
  HostBoard board(kept, start);
  run(board, 5);
  Input in = second();
  in.pack.current_ua = 9'000'000;
  in.pack.cell_uv[2] = 3'500'000;
  in.pack.temperature_cdegc = {-700, 2'000, 2'000, 2'000};
  board.process_sample(in);
  const auto now = extremes(board);
  EXPECT_NEAR(now[0].voltage, 2.900, 0.001);
  EXPECT_NEAR(now[1].voltage, 3.500, 0.001);
  EXPECT_EQ(now[0].temperature, -7);
  EXPECT_EQ(now[1].temperature, 31);
  EXPECT_EQ(now[0].current, -20);
  EXPECT_EQ(now[1].current, 9);
}

TEST_F(StoredDataTest, ResetsAreReturnedByCauseAndCanErrorsSaturate) {
  std::vector<std::uint8_t> kept = new_chip;
  for (const hal::ResetCause cause :
       {hal::ResetCause::power_on, hal::ResetCause::watchdog, hal::ResetCause::watchdog, hal::ResetCause::software}) {
    host_hal::cause = cause;
    HostBoard board(kept, start);
    run(board, 2);
    board.shut_down();
    kept = board.flash();
    host_hal::can_health = {.state = hal::CanState::passive,
                            .transmit_errors = 130,
                            .receive_errors = 7,
                            .dropped = 5'000,
                            .lost = 3,
                            .overruns = 2,
                            .bus_offs = 1,
                            .failed_starts = 40};
    request(board, 0);
  }
  std::map<std::uint32_t, std::uint32_t> resets;
  for (const auto& counts : all<can::StoredCounts>()) resets[counts.cause] = counts.resets;
  const std::map<std::uint32_t, std::uint32_t> expected{
      {can::StoredCounts::cause_unknown, 0},  {can::StoredCounts::cause_power_on, 1},
      {can::StoredCounts::cause_pin, 0},      {can::StoredCounts::cause_software, 1},
      {can::StoredCounts::cause_watchdog, 2}, {can::StoredCounts::cause_brown_out, 0},
      {can::StoredCounts::cause_low_power, 0}};
  EXPECT_EQ(resets, expected);
  const auto errors = last<can::CanErrors>().value();
  EXPECT_EQ(errors.state, can::CanErrors::state_passive);
  EXPECT_EQ(errors.transmit_errors, 130U);
  EXPECT_EQ(errors.receive_errors, 7U);
  EXPECT_EQ(errors.dropped, 4'095U) << "the highest value of the signal";
  EXPECT_EQ(errors.lost, 5U) << "lost by the firmware and by the controller";
  EXPECT_EQ(errors.bus_offs, 1U);
  EXPECT_EQ(errors.failed_starts, 31U);
}

TEST_F(StoredDataTest, APartCanBeRequestedAlone) {
  HostBoard board(new_chip, start);
  run(board, 2);
  EXPECT_EQ(request(board, 7 | 1 << 8), can::CommandAnswer::result_done);
  ASSERT_EQ(all<can::StoredFault>().size(), 1U);
  EXPECT_EQ(all<can::StoredFault>()[0].index, 7U);
  EXPECT_EQ(all<can::StoredFaultCells>().size(), 1U);
  EXPECT_TRUE(all<can::StoredCounts>().empty());
  request(board, 20);
  EXPECT_EQ(all<can::StoredCounts>().size(), 3U) << "the rest from part 20 on";
  EXPECT_EQ(all<can::StoredAction>().size(), 16U);
  request(board, 38 | 9 << 8);
  EXPECT_EQ(all<can::StoredActionDetail>().size(), 1U) << "there are fewer";
  for (const std::uint32_t invalid : {39U, 255U, 40U << 8, 1U << 16, 0xFFFF'FFFFU}) {
    EXPECT_EQ(request(board, invalid), can::CommandAnswer::result_refused) << invalid;
    EXPECT_TRUE(all<can::StoredFault>().empty());
    EXPECT_TRUE(all<can::StoredCounts>().empty());
  }
}

/// The analysis of the bus load counts each message once per sample.
TEST_F(StoredDataTest, NoMessageIsSentTwiceWithASampleAndAtMostThreeAre) {
  HostBoard board(new_chip, start);
  run(board, 2);
  send_command(board, can::Command::code_stored_data, 0);
  std::size_t frames = 0;
  for (int k = 0; k < 45; ++k) {
    sent.clear();
    run(board, 1);
    std::set<std::uint32_t> ids;
    for (const can::Frame& frame : sent) {
      const bool of_the_stored_data =
          (frame.id >= 0x1A4 && frame.id <= 0x1AB) || frame.id == 0x1B4 || frame.id == 0x1B5;
      EXPECT_TRUE(!of_the_stored_data || ids.insert(frame.id).second) << frame.id;
    }
    EXPECT_LE(ids.size(), 3U);
    frames += ids.size();
  }
  EXPECT_EQ(frames, 16U * 3 + 7 + 5 + 16 * 2);
}

TEST_F(StoredDataTest, CountersOfTheFramesFollowEachOther) {
  HostBoard board(new_chip, start);
  run(board, 2);
  request(board, 0);
  int before = -1;
  for (const can::Frame& frame : sent) {
    if (frame.id != can::StoredFault::id) continue;
    EXPECT_EQ(can::counter_of(frame), (before + 1) % 15);
    before = can::counter_of(frame);
  }
  EXPECT_EQ(before, 0) << "sixteen frames";
}

TEST_F(StoredDataTest, AFullLogIsReportedUntilASectorIsErased) {
  FlashModel flash({HostBoard::sectors, HostBoard::sector_bytes}, 1);
  plug_in(&flash);
  storage::Persistence persistence;
  persistence.start(hal::ResetCause::power_on, std::nullopt, std::nullopt);
  EXPECT_EQ(messages::storage(persistence).state, can::Storage::state_works);
  for (int k = 0; k < 10'000 && !persistence.full(); ++k) persistence.set(9, k, storage::Urgency::safety);
  EXPECT_EQ(messages::storage(persistence).state, can::Storage::state_a_record_was_turned_down);
  while (persistence.needs_erase()) persistence.erase_next_sector();
  EXPECT_TRUE(persistence.set(9, 1, storage::Urgency::safety));
  EXPECT_EQ(messages::storage(persistence).state, can::Storage::state_works);
  plug_in(nullptr);
}

}  // namespace
}  // namespace bms::firmware
