// The forklift board's own image on a core in Unicorn, its CAN controller a register model, other nodes on the wire: what is on the wire is
// what telemetry meant, and whatever the bus does, the firmware goes on estimating and feeding its watchdog.
#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "firmware/application.hpp"
#include "hal/accepted_frames.hpp"
#include "host_sim/cell_file.hpp"
#include "host_sim/firmware_image.hpp"
#include "host_sim/recording.hpp"
#include "host_sim/replay.hpp"
#include "tests/can/response_time.hpp"
#include "tests/firmware/unicorn_board.hpp"

namespace bms {
namespace {

std::vector<hal::CanFrame> meant;  // by the application on this machine

}  // namespace

namespace hal {
bool can_listening() { return true; }
bool can_send(const CanFrame& frame) {
  meant.push_back(frame);
  return true;
}
ResetCause reset_cause() { return ResetCause::power_on; }
std::optional<FaultRecord> last_fault() { return std::nullopt; }
void record(std::span<const std::uint32_t>) {}
bool next_request(CanFrame&) { return false; }
void watchdog_feed() {}
}  // namespace hal

namespace {

using ::testing::IsEmpty;
using hal::CanState;
using Plain = SocEstimator<float>;
using Ids = std::vector<unsigned>;

const CellFile& table9() {
  static const CellFile cell = read_cell("table9");
  return cell;
}
const auto cell_tables = model::prepare<float, model::max_intervals>(table9().parameters);
Estimate<float> step(Plain& estimator, const Sample& sample) { return estimator.step(cell_tables, sample); }
void look(Condition<Plain>& condition, const Plain& estimator, const Sample& sample, const Estimate<float>& e, bool limits_wanted) { condition.update(cell_tables, sample, e, estimator.state(), limits_wanted); }

const std::filesystem::path& image() {
  static const auto path = firmware_image("stm32f405_forklift", table9(), Image::remote);
  return path;
}

std::vector<Sample> part_of_the_shift(std::size_t count) {
  const auto all = samples(read_recording(BMS_SOURCE_DIR "/recordings/forklift_shift.csv"));
  return {all.begin() + 3000, all.begin() + 3000 + static_cast<std::ptrdiff_t>(count)};
}

constexpr std::uint64_t bits_between_samples = 25'000;  // ten a second at 250 kbit/s
constexpr double shortest_watchdog_ms = 1'360;          // 2 s by an oscillator at 47 kHz (datasheet, LSI)

bool same(const hal::CanFrame& a, const hal::CanFrame& b) { return a.id == b.id && a.length == b.length && a.data == b.data; }

class BxcanBoard : public ::testing::Test {
 protected:
  void TearDown() override {
    if (IsSkipped()) return;
    EXPECT_THAT(board.can.violations, IsEmpty());
    EXPECT_LT(board.longest_unfed_ms, shortest_watchdog_ms);
  }

  /// From now on a sample every 100 ms of the wire.
  void queue(const std::vector<Sample>& some) {
    for (std::size_t k = 0; k < some.size(); ++k) {
      for (const hal::CanFrame& f : hal::frames_of(some[k])) board.can.others.push_back({wire_frame(f), board.can.now_bit + bits_between_samples * (k + 1)});
    }
  }
  std::vector<hal::CanFrame> of_board(unsigned id = 0) const {
    std::vector<hal::CanFrame> out;
    for (const SeenFrame& s : board.can.seen) {
      if (s.from_board && (id == 0 || s.frame.id == id)) out.push_back(s.frame);
    }
    return out;
  }
  /// Estimates go on, whatever the bus does.
  void expect_estimates(double during_ms, unsigned at_least) {
    const unsigned before = board.estimates, fed = board.watchdog_feeds;
    board.run_for_ms(during_ms);
    EXPECT_GE(board.estimates - before, at_least);
    EXPECT_GE(board.watchdog_feeds - fed, at_least);
  }
  void expect_nothing_lost_within_an_id() const {
    for (const unsigned id : {0x180U, 0x181U, 0x182U, 0x183U, 0x186U, 0x189U}) {
      const auto frames = of_board(id);
      for (std::size_t k = 0; k < frames.size(); ++k) {
        ASSERT_TRUE(can::intact(frames[k], static_cast<std::uint16_t>(id)));
        ASSERT_EQ(can::counter_of(frames[k]), k % 15) << fmt::format("{:x}, frame {}", id, k);
      }
    }
  }

  UnicornBoard board{image()};
};

TEST_F(BxcanBoard, WhatIsOnTheWireIsBitForBitWhatTheApplicationMeans) {
  const auto part = part_of_the_shift(40);
  const StartingPoint start = starting_point(Belief{0.8, 0.05}).value();
  meant.clear();
  Application<Plain, step, look> application(start, {table9().hash, 0x000100}, static_cast<float>(table9().parameters.capacity_ah));
  for (const Sample& s : part) application.take(s);
  std::map<unsigned, std::vector<hal::CanFrame>> expected;
  for (const hal::CanFrame& f : meant) expected[f.id].push_back(f);
  EXPECT_GE(expected.size(), 8U);

  for (const std::uint32_t seed : {1U, 2U, 3U}) {
    UnicornBoard one(image(), seed);
    one.can.others.push_back({wire_frame(hal::frame_of(start)), 1'000});
    for (std::size_t k = 0; k < part.size(); ++k) {
      for (const hal::CanFrame& f : hal::frames_of(part[k])) one.can.others.push_back({wire_frame(f), bits_between_samples * (k + 1)});
    }
    one.run_for_ms(100 * static_cast<double>(part.size()) + 150);
    std::map<unsigned, std::vector<hal::CanFrame>> seen;
    for (const SeenFrame& s : one.can.seen) {
      if (s.from_board) seen[s.frame.id].push_back(s.frame);
    }
    ASSERT_EQ(seen.size(), expected.size());
    for (const auto& [id, frames] : expected) {
      ASSERT_EQ(seen[id].size(), frames.size()) << fmt::format("{:x}", id);
      for (std::size_t k = 0; k < frames.size(); ++k) ASSERT_TRUE(same(seen[id][k], frames[k])) << fmt::format("{:x}, frame {}, seed {}", id, k, seed);
    }
    EXPECT_NEAR(can::PackElectrical::of(seen[0x181].back()).voltage, 1e-6 * part.back().voltage_uv, 0.0006);
    EXPECT_EQ(can::Status::of(seen[0x182].back()).sample_counter, part.size());
    EXPECT_GT(one.interrupts_taken, 4'000U);
    EXPECT_THAT(one.can.violations, IsEmpty());
    const hal::CanHealth health = one.can_health();
    EXPECT_EQ(health.state, CanState::active);
    EXPECT_EQ(health.sent, meant.size());
    EXPECT_EQ(health.received, 1 + 2 * part.size());
    EXPECT_EQ(health.dropped + health.lost + health.overruns + health.bus_offs + health.failed_starts, 0U);
  }
}

TEST_F(BxcanBoard, ArbitrationThatIsLostCostsNeitherAFrameNorTheOrder) {
  queue(part_of_the_shift(20));
  for (std::uint64_t k = 0; k < 4'000; ++k) board.can.others.push_back({{0x100, false, false, 4, {}}, 10'000 + 130 * k});  // nearly all of the bus
  board.run_for_ms(2'150);
  EXPECT_GT(board.can.arbitrations_lost, 300U);
  EXPECT_EQ(of_board(0x182).size(), 20U);
  EXPECT_EQ(of_board(0x189).size(), 20U);
  expect_nothing_lost_within_an_id();
  EXPECT_EQ(board.can_health().dropped, 0U);
}

/// Once a second a dozen frames are due at once, 0x183 first and 0x182 last. They leave by urgency, but for the one that was under way.
TEST_F(BxcanBoard, AnUrgentFrameOvertakesThoseInTheMailboxes) {
  queue(part_of_the_shift(5));
  ASSERT_TRUE(board.run_until([&] { return board.estimates == 5; }, 600));
  board.run_for_ms(20);
  const auto frames = of_board();
  ASSERT_EQ(frames.size(), 2 + 5U * 12U);
  const auto begins = [](const hal::CanFrame& f) { return f.id == 0x183; };
  unsigned bursts = 0;
  for (auto first = frames.begin(); first != frames.end(); ++bursts) {
    EXPECT_TRUE(begins(*first));
    const auto end = std::find_if(first + 1, frames.end(), begins);
    EXPECT_TRUE(std::is_sorted(first + 1, end, [](const auto& a, const auto& b) { return a.id < b.id; })) << fmt::format("{:x} {:x} {:x} {:x}", first[1].id, first[2].id, first[3].id, first[4].id);
    first = end;
  }
  EXPECT_EQ(bursts, 5U);
  EXPECT_GE(board.can.aborts, 2U * 5U) << "frames in mailboxes made room";
  EXPECT_EQ(board.can_health().dropped, 0U);
}

/// Samples faster than the bus can tell of them, by another way than the bus, so that frames are sent while others end.
TEST_F(BxcanBoard, AtTheLimitOfTheBusNothingIsLostAndBeyondItTheLeastUrgent) {
  const auto part = part_of_the_shift(1'500);
  board.run_for_ms(20);
  std::size_t next = 0;
  const auto feed = [&](std::size_t count, double every_ms) {
    for (std::size_t k = 0; k < count; ++k, ++next) {
      for (const hal::CanFrame& f : hal::frames_of(part[next])) board.can.deliver(f);
      board.run_for_ms(every_ms);
    }
  };
  // every sample of this recording is a second after the last: a dozen messages each time, 5.7 ms of the wire
  feed(500, 6.02);
  board.run_for_ms(20);
  expect_nothing_lost_within_an_id();
  EXPECT_EQ(of_board(0x19C).size(), 500U);
  EXPECT_EQ(of_board().size(), board.can_health().sent);
  EXPECT_EQ(board.can_health().dropped, 0U);
  const std::size_t told = of_board(0x180).size();

  feed(500, 3.51);
  board.run_for_ms(50);
  const hal::CanHealth health = board.can_health();
  EXPECT_GT(health.dropped, 500U);
  EXPECT_EQ(health.sent + health.dropped, 2 + 12U * 1'000);
  EXPECT_EQ(health.sent, of_board().size());
  EXPECT_EQ(of_board(0x180).size(), told + 500) << "the most urgent is never the one that is dropped";
  EXPECT_EQ(of_board(0x181).size(), told + 500);
  EXPECT_LT(of_board(0x19C).size(), told + 250);
}

TEST_F(BxcanBoard, OfOneIdentifierTheOlderFrameLeavesFirstWhateverMailboxItHas) {
  board.run_for_ms(20);
  std::size_t told = 0;
  for (int time = 0; time < 20; ++time) {
    for (int k = 0; k < 80; ++k) board.can.others.push_back({{0x100, false, false, 8, {}}, 0});  // 39 ms of the wire
    for (const Sample& s : part_of_the_shift(5)) {
      for (const hal::CanFrame& f : hal::frames_of(s)) board.can.deliver(f);
      board.run_for_ms(5 + time % 3);
    }
    told += 5;
    board.run_for_ms(60);
    ASSERT_EQ(of_board(0x180).size(), told);
    ASSERT_EQ(of_board(0x181).size(), told);
  }
  const auto states = of_board(0x180), electrical = of_board(0x181);
  for (std::size_t k = 0; k < told; ++k) {
    ASSERT_EQ(can::counter_of(states[k]), k % 15) << k;
    ASSERT_EQ(can::counter_of(electrical[k]), k % 15) << k;
  }
}

TEST_F(BxcanBoard, AFullFifoAndAFullRingAreCountedAndTheNextSampleIsTaken) {
  board.run_for_ms(20);
  board.receive_interrupt_held = true;
  for (int k = 0; k < 5; ++k) board.can.others.push_back({wire_frame(hal::frame_of(StartingPoint{})), 0});
  board.run_for_ms(10);
  board.receive_interrupt_held = false;
  board.run_for_ms(2);
  EXPECT_EQ(board.can_health().received, 3U);
  EXPECT_EQ(board.can_health().overruns, 1U);

  board.program_held = true;
  for (int k = 0; k < 70; ++k) board.can.others.push_back({wire_frame(hal::frame_of(StartingPoint{})), 0});
  board.run_for_ms(60);
  board.program_held = false;
  board.run_for_ms(2);
  EXPECT_EQ(board.can_health().received, 3U + 64U);
  EXPECT_EQ(board.can_health().lost, 6U);

  queue(part_of_the_shift(1));
  board.run_for_ms(110);
  EXPECT_EQ(board.estimates, 1U);
  EXPECT_EQ(of_board(0x182).size(), 1U);
}

TEST_F(BxcanBoard, NothingButTheAcceptedIdentifiersComesIn) {
  board.run_for_ms(20);
  for (std::uint32_t id = 0; id < 0x800; id += 7) {
    const bool accepted = std::find(hal::accepted_ids.begin(), hal::accepted_ids.end(), id) != hal::accepted_ids.end();
    if (!accepted) board.can.others.push_back({{id, false, false, 8, {}}, 0});
  }
  for (const std::uint32_t id : hal::accepted_ids) {
    board.can.others.push_back({{id, false, true, 8, {}}, 0});                                        // remote request
    for (std::uint32_t tail : {0U, 1U, 0x3FFFFU}) board.can.others.push_back({{id << 18 | tail, true, false, 8, {}}, 0});  // 29 bits
    for (std::uint32_t bit = 0; bit < 11; ++bit) {
      const std::uint32_t near = id ^ 1U << bit;
      if (std::find(hal::accepted_ids.begin(), hal::accepted_ids.end(), near) == hal::accepted_ids.end()) board.can.others.push_back({{near, false, false, 8, {}}, 0});
    }
  }
  ASSERT_TRUE(board.run_until([&] { return board.can.others.empty(); }, 1'000));
  board.run_for_ms(2);
  EXPECT_EQ(board.can_health().received, 0U);
  for (const std::uint32_t id : hal::accepted_ids) board.can.others.push_back({{id, false, false, 8, {}}, 0});
  board.run_for_ms(5);
  EXPECT_EQ(board.can_health().received, hal::accepted_ids.size());
}

TEST_F(BxcanBoard, ACommandComesInAndIsAnswered) {
  can::Command command;
  command.code = can::Command::code_log_of_samples;
  command.argument = 0;
  queue(part_of_the_shift(3));
  board.can.others.push_back({wire_frame(command.frame(5)), board.can.now_bit + bits_between_samples * 3 / 2});
  board.run_for_ms(350);
  ASSERT_EQ(of_board(can::CommandAnswer::id).size(), 1U);
  const auto answer = can::CommandAnswer::of(of_board(can::CommandAnswer::id).front());
  EXPECT_EQ(answer.result, can::CommandAnswer::result_done);
  EXPECT_EQ(answer.command_counter, 5U);
  EXPECT_EQ(of_board(can::SampleCurrent::id).size(), 2U) << "with the second sample it was heard, the third is not logged";
}

TEST_F(BxcanBoard, ErrorsLeadToWarningAndPassiveAndBackAndCostNoFrame) {
  queue(part_of_the_shift(40));
  board.run_for_ms(50);
  std::set<CanState> states;
  board.can.corrupt_sent = 13;
  ASSERT_TRUE(board.run_until([&] { return board.can.corrupt_sent == 0; }, 100));
  EXPECT_EQ(board.can_health().state, CanState::warning) << board.can.transmit_errors();
  board.can.corrupt_sent = 8;
  ASSERT_TRUE(board.run_until([&] { return board.can.transmit_errors() >= 128; }, 100));
  EXPECT_EQ(board.can_health().state, CanState::passive);
  EXPECT_EQ(board.can_health().transmit_errors, board.can.transmit_errors());
  board.run_for_ms(4'100);
  EXPECT_EQ(board.can.attempts_failed, 21U);
  EXPECT_EQ(board.can_health().state, CanState::active) << board.can.transmit_errors();
  EXPECT_EQ(of_board(0x182).size(), 40U);
  expect_nothing_lost_within_an_id();
  EXPECT_EQ(board.can_health().dropped, 0U);
}

TEST_F(BxcanBoard, ComesBackFromBusOffAfterItsRestWhichDoublesWhileNothingGetsOut) {
  queue(part_of_the_shift(200));
  board.run_for_ms(50);
  double rest_ms = 100;
  board.can.corrupt_sent = 3 * 32;
  for (unsigned time = 1; time <= 3; ++time, rest_ms *= 2) {
    ASSERT_TRUE(board.run_until([&] { return board.can.bus_off(); }, 1'500)) << time;
    EXPECT_EQ(board.can_health().state, CanState::bus_off);
    const std::uint32_t sent = board.can_health().sent;
    EXPECT_EQ(board.can.times_off, time);
    ASSERT_TRUE(board.run_until([&] { return !board.can.bus_off(); }, 2'000)) << time;
    const double away_ms = board.ms_at_bit(board.can.back_at_bit - board.can.off_since_bit);
    const double recovery_ms = board.ms_at_bit(128 * 11);
    EXPECT_GE(away_ms, rest_ms + recovery_ms);
    EXPECT_LE(away_ms, rest_ms + recovery_ms + 8) << "sleeps of a millisecond between the steps, others' frames between the recessive bits";
    EXPECT_EQ(board.can_health().sent, sent);
    EXPECT_EQ(board.can_health().bus_offs, time);
  }
  const std::size_t before = of_board(0x182).size();
  expect_estimates(1'000, 9);
  EXPECT_GE(of_board(0x182).size(), before + 9);
  EXPECT_EQ(board.can_health().state, CanState::active);
  EXPECT_GT(board.can_health().dropped, 3U) << "what waited when the bus went off";
  board.can.corrupt_sent = 32;
  ASSERT_TRUE(board.run_until([&] { return board.can.bus_off(); }, 1'500));
  ASSERT_TRUE(board.run_until([&] { return !board.can.bus_off(); }, 2'000));
  EXPECT_LE(board.ms_at_bit(board.can.back_at_bit - board.can.off_since_bit), 100 + board.ms_at_bit(128 * 11) + 8) << "frames got out: the rest is short again";
}

TEST_F(BxcanBoard, AWireThatIsHeldLowAtTheStartStopsNothingButTheBus) {
  board.can.stuck_dominant = true;
  expect_estimates(6'000, 4);
  EXPECT_EQ(board.can_health().state, CanState::starting);
  EXPECT_GE(board.can_health().failed_starts, 3U);
  EXPECT_LE(board.can_health().failed_starts, 10U) << "the rests grow";
  EXPECT_THAT(of_board(), IsEmpty());
  board.can.stuck_dominant = false;
  ASSERT_TRUE(board.run_until([&] { return board.can.on_the_bus(); }, 1'600 + 110));
  queue(part_of_the_shift(5));
  board.run_for_ms(600);
  EXPECT_GE(of_board(0x182).size(), 5U);
  EXPECT_EQ(board.can_health().state, CanState::active);
}

/// Held low while nothing is on it, and in the middle of a frame that the board sends.
TEST_F(BxcanBoard, AWireThatIsHeldLowLaterStopsNothingButTheBusAndWhatIsToldThenIsFresh) {
  for (const bool in_a_frame : {false, true}) {
    queue(part_of_the_shift(3));
    const unsigned before = board.estimates;
    ASSERT_TRUE(board.run_until([&] { return board.estimates >= before + 3; }, 500));
    const auto sending = [&] { return (board.can.read(0x04) & 1U << 8) != 0; };
    if (in_a_frame) ASSERT_TRUE(board.run_until(sending, 50));
    else board.run_for_ms(30);
    board.can.stuck_dominant = true;
    expect_estimates(4'000, 3);
    EXPECT_EQ(board.can.bus_off(), in_a_frame) << "only who sends counts up to bus-off";
    EXPECT_EQ(board.can_health().state, in_a_frame ? CanState::bus_off : CanState::passive);
    board.can.stuck_dominant = false;
    const std::size_t told = of_board(0x182).size();
    ASSERT_TRUE(board.run_until([&] { return of_board(0x182).size() > told; }, 4'500));
    EXPECT_EQ(can::Status::of(of_board(0x182)[told]).sample_counter, board.estimates);
  }
}

TEST_F(BxcanBoard, WithNobodyThereItGoesOnAndTellsWhatIsFreshWithinTheSecondAfterSomebodyCame) {
  board.can.others_acknowledge = false;
  expect_estimates(8'000, 6);
  EXPECT_EQ(board.can.transmit_errors(), 128U) << "no acknowledge makes passive, never bus-off";
  EXPECT_EQ(board.can_health().state, CanState::passive);
  EXPECT_EQ(board.can_health().sent, 0U);
  EXPECT_GT(board.can_health().dropped, 8U);
  EXPECT_THAT(of_board(), IsEmpty());
  board.can.others_acknowledge = true;
  // a second of silence, and the samples that the board gives itself come every 1.2 s
  ASSERT_TRUE(board.run_until([&] { return of_board(0x182).size() == 1; }, 2'300));
  EXPECT_EQ(can::Status::of(of_board(0x182).front()).sample_counter, board.estimates) << "not what waited";
  EXPECT_NE(can::Status::of(of_board(0x182).front()).flags & current_missing, 0U);
  queue(part_of_the_shift(3));
  board.run_for_ms(350);
  EXPECT_EQ(of_board(0x182).size(), 4U);
}

TEST(BxcanBoardAlone, WithoutItsCrystalItStaysOffTheBusAndEstimates) {
  UnicornBoard board(image(), 1, false);
  board.run_for_ms(5'000);
  EXPECT_GE(board.estimates, 3U);
  EXPECT_FALSE(board.can.on_the_bus());
  EXPECT_EQ(board.can_health().state, CanState::starting);
  EXPECT_THAT(board.can.violations, IsEmpty());
}

TEST(BxcanBoardAlone, AtAnotherBitRateNobodyHearsIt) {
  UnicornBoard board(image());
  board.can.bits_per_second = 500'000;
  board.run_for_ms(3'000);
  EXPECT_THAT(board.can.seen, IsEmpty());
  EXPECT_GT(board.can.attempts_failed, 30U);
  EXPECT_GE(board.estimates, 2U);
}

/// Against the bounds of the analysis, which knows nothing of CRC and stuff bits of a certain frame.
TEST(BxcanModel, AFrameHasBetween111And135Bits) {
  std::mt19937 random(5);
  unsigned longest = 0;
  for (int k = 0; k < 20'000; ++k) {
    WireFrame f{static_cast<std::uint32_t>(random() % 0x800), false, false, 8, {}};
    for (auto& byte : f.data) byte = static_cast<std::uint8_t>(k % 2 == 0 ? random() : random() % 2 * 0xFF);
    const unsigned bits = bits_on_the_wire(f);
    EXPECT_GE(bits, 111U);
    EXPECT_LE(bits, can_bus::worst_bits(8));
    longest = std::max(longest, bits);
  }
  EXPECT_GE(longest, 125U);
}

TEST_F(BxcanBoard, PinsAreThoseOfItsPage) {
  board.run_for_ms(5);
  EXPECT_EQ(board.register_value(0x40020400) >> 16 & 15, 10U) << "PB8, PB9: alternate function";
  EXPECT_EQ(board.register_value(0x40020424) & 255, 0x99U) << "9: CAN1";
  EXPECT_EQ(board.register_value(0x4002040C) >> 16 & 3, 1U) << "PB8 pulled up";
}

/// Against the analysis: with the bus full of frames less urgent, the latency of every message from the sample's last bit to its own.
TEST_F(BxcanBoard, EveryFrameComesWithinTheTimeThatTheAnalysisAllows) {
  queue(part_of_the_shift(50));
  for (std::uint64_t k = 0; k < 11'000; ++k) board.can.others.push_back({{0x7F0, false, false, 8, {}}, 5'000 + 120 * k});  // 1 stuff bit in 5: longer than that
  board.run_for_ms(5'200);
  const auto messages = can_bus::messages_on_the_bus(10, 1e-3);
  std::map<unsigned, double> worst_ms;
  std::uint64_t sample_bit = 0;
  double busy_bits = 0;
  for (const SeenFrame& s : board.can.seen) {
    if (s.frame.id == hal::time_frame_id) sample_bit = s.end_bit;
    if (s.from_board) worst_ms[s.frame.id] = std::max(worst_ms[s.frame.id], board.ms_at_bit(s.end_bit - sample_bit));
    busy_bits += static_cast<double>(s.end_bit - s.begin_bit);
  }
  EXPECT_GT(busy_bits / static_cast<double>(board.can.now_bit), 0.95);
  EXPECT_GE(worst_ms.size(), 8U);
  for (std::size_t k = 0; k < messages.size(); ++k) {
    if (!worst_ms.contains(messages[k].id)) continue;
    const double allowed_ms = 1e3 * can_bus::response_on_the_bus_s(messages, k, 250e3);
    fmt::print("{:#05x} {:20} measured {:5.2f} ms, allowed {:5.2f} ms\n", messages[k].id, messages[k].name, worst_ms[messages[k].id], allowed_ms);
    EXPECT_LE(worst_ms[messages[k].id], allowed_ms) << messages[k].name;
  }
}

TEST_F(BxcanBoard, FitsIntoItsBudgetsOfFlashRamAndStack) {
  const ImageSize size = size_of(image());
  EXPECT_LE(size.text + size.data, 64U * 1024);
  EXPECT_LE(size.data + size.bss, 16U * 1024);
  queue(part_of_the_shift(20));
  board.run_for_ms(2'100);
  EXPECT_EQ(board.estimates, 20U);
  EXPECT_LE(board.stack_used(), 4U * 1024);
  EXPECT_GT(board.stack_used(), 500U);
  EXPECT_THAT(forbidden_in(symbols_of(image())), IsEmpty());
  fmt::print("flash {} bytes, RAM {} bytes, stack {} bytes\n", size.text + size.data, size.data + size.bss, board.stack_used());
}

}  // namespace
}  // namespace bms
