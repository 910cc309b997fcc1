// The forklift board's image on a disturbed bus: whatever the bus does, the firmware continues to estimate and to feed
// its watchdog, and loses no frame that it need not lose.
#include <algorithm>
#include <random>

#include "hal/accepted_frames.hpp"
#include "tests/firmware/bxcan_board.hpp"

namespace bms::firmware {
namespace {

TEST_F(BxcanBoard, LostArbitrationLosesNoFrameAndKeepsTheOrder) {
  queue(part_of_the_shift(20));
  for (std::uint64_t k = 0; k < 4'000; ++k)
    board.can.others.push_back({{0x100, false, false, 4, {}}, 10'000 + 130 * k});  // nearly all of the bus
  board.run_for_ms(2'150);
  EXPECT_GT(board.can.arbitrations_lost, 300U);
  EXPECT_EQ(of_board(0x182).size(), 20U);
  EXPECT_EQ(of_board(0x189).size(), 20U);
  expect_nothing_lost_within_an_id();
  EXPECT_EQ(board.can_health().dropped, 0U);
}

/// Once a second two dozen frames are due at once; 0x196 is queued first and 0x182 last. They leave in the order of
/// their identifiers, except for the two that begin while the others are still being queued, which takes longer than a
/// frame of 0.5 ms.
TEST_F(BxcanBoard, AnUrgentFrameOvertakesFramesInTheMailboxes) {
  const auto part = part_of_the_shift(5);
  const std::size_t expected = expected_frames(part).size();
  queue(part);
  ASSERT_TRUE(board.run_until([&] { return board.estimates == 5; }, 600));
  board.run_for_ms(20);
  const auto frames = of_board();
  ASSERT_EQ(frames.size(), expected);
  const auto begins = [](const can::Frame& f) { return f.id == 0x196; };
  unsigned bursts = 0;
  for (auto first = frames.begin(); first != frames.end(); ++bursts) {
    EXPECT_TRUE(begins(*first));
    const auto end = std::find_if(first + 1, frames.end(), begins);
    ASSERT_GT(end - first, 2);
    EXPECT_TRUE(std::is_sorted(first + 2, end, [](const auto& a, const auto& b) { return a.id < b.id; }))
        << fmt::format("{:x} {:x} {:x} {:x}", first[1].id, first[2].id, first[3].id, first[4].id);
    first = end;
  }
  EXPECT_EQ(bursts, 5U);
  EXPECT_GE(board.can.aborts, 2U * 5U) << "frames left their mailboxes for more urgent ones";
  EXPECT_EQ(board.can_health().dropped, 0U);
}

/// Samples arrive faster than the bus can carry the messages. They do not use the bus themselves.
TEST_F(BxcanBoard, NothingIsLostAtTheLimitOfTheBusAndBeyondItTheLeastUrgent) {
  const auto part = part_of_the_shift(1'000);
  const auto all = expected_frames(part), first = expected_frames({part[0]});
  const double sample_ms = ms_on_the_wire(all) / static_cast<double>(part.size());
  const std::uint32_t least_urgent = std::ranges::max(all, {}, &can::Frame::id).id;
  // the samples of this recording are a second apart, so every message is sent each time
  EXPECT_NEAR(static_cast<double>(all.size()), static_cast<double>((first.size() - 2) * part.size()), 20)
      << "the starting point is sent once, a change of faults at once";
  run_until_it_listens(board);
  std::size_t next = 0;
  const auto feed = [&](std::size_t count, double every_ms) {
    for (std::size_t k = 0; k < count; ++k, ++next) {
      const double until = board.now_ms() + every_ms;
      deliver(part[next]);
      board.run_for_ms(until - board.now_ms());
    }
  };
  feed(500, 1.05 * sample_ms);
  board.run_for_ms(20);
  expect_nothing_lost_within_an_id();
  EXPECT_EQ(of_board(least_urgent).size(), 500U);
  EXPECT_EQ(of_board().size(), board.can_health().sent);
  EXPECT_EQ(board.can_health().dropped, 0U);
  const std::size_t published = of_board(0x180).size();

  feed(500, 0.6 * sample_ms);
  board.run_for_ms(50);
  const hal::CanHealth health = board.can_health();
  EXPECT_GT(health.dropped, 500U);
  EXPECT_EQ(health.sent + health.dropped, all.size());
  EXPECT_EQ(health.sent, of_board().size());
  EXPECT_EQ(of_board(0x180).size(), published + 500) << "the most urgent frame is never dropped";
  EXPECT_EQ(of_board(0x181).size(), published + 500);
  EXPECT_LT(of_board(least_urgent).size(), published + 250);
}

TEST_F(BxcanBoard, FramesOfOneIdentifierLeaveInOrderWhateverTheirMailbox) {
  run_until_it_listens(board);
  std::size_t published = 0;
  for (int time = 0; time < 20; ++time) {
    for (int k = 0; k < 80; ++k) board.can.others.push_back({{0x100, false, false, 8, {}}, 0});  // 39 ms of the wire
    for (const Pack& p : part_of_the_shift(5)) {
      deliver(p);
      board.run_for_ms(5 + time % 3);
    }
    published += 5;
    board.run_for_ms(60);
    ASSERT_EQ(of_board(0x180).size(), published);
    ASSERT_EQ(of_board(0x181).size(), published);
  }
  const auto states = of_board(0x180), electrical = of_board(0x181);
  for (std::size_t k = 0; k < published; ++k) {
    ASSERT_EQ(can::counter_of(states[k]), k % 15) << k;
    ASSERT_EQ(can::counter_of(electrical[k]), k % 15) << k;
  }
}

TEST_F(BxcanBoard, AFullFifoAndAFullRingAreCountedAndTheNextSampleIsReceived) {
  run_until_it_listens(board);
  board.receive_interrupt_held = true;
  for (int k = 0; k < 5; ++k) board.can.others.push_back({wire_frame(hal::frame_of(measurement::StartingPoint{})), 0});
  board.run_for_ms(10);
  board.receive_interrupt_held = false;
  board.run_for_ms(2);
  EXPECT_EQ(board.can_health().received, 3U);
  EXPECT_EQ(board.can_health().overruns, 1U);

  board.program_held = true;
  for (int k = 0; k < 70; ++k) board.can.others.push_back({wire_frame(hal::frame_of(measurement::StartingPoint{})), 0});
  board.run_for_ms(60);
  board.program_held = false;
  board.run_for_ms(2);
  EXPECT_EQ(board.can_health().received, 3U + 64U);
  EXPECT_EQ(board.can_health().lost, 6U);

  queue(part_of_the_shift(1));
  board.run_for_ms(130);
  EXPECT_EQ(board.estimates, 1U);
  EXPECT_EQ(of_board(0x182).size(), 1U);
}

TEST_F(BxcanBoard, OnlyAcceptedIdentifiersAreReceived) {
  run_until_it_listens(board);
  for (std::uint32_t id = 0; id < 0x800; id += 7) {
    const bool accepted = std::find(hal::request_and_sample_ids.begin(), hal::request_and_sample_ids.end(), id) !=
                          hal::request_and_sample_ids.end();
    if (!accepted) board.can.others.push_back({{id, false, false, 8, {}}, 0});
  }
  for (const std::uint32_t id : hal::request_and_sample_ids) {
    board.can.others.push_back({{id, false, true, 8, {}}, 0});  // remote request
    for (std::uint32_t tail : {0U, 1U, 0x3FFFFU})
      board.can.others.push_back({{id << 18 | tail, true, false, 8, {}}, 0});  // 29 bits
    for (std::uint32_t bit = 0; bit < 11; ++bit) {
      const std::uint32_t near = id ^ 1U << bit;
      if (std::find(hal::request_and_sample_ids.begin(), hal::request_and_sample_ids.end(), near) ==
          hal::request_and_sample_ids.end())
        board.can.others.push_back({{near, false, false, 8, {}}, 0});
    }
  }
  ASSERT_TRUE(board.run_until([&] { return board.can.others.empty(); }, 1'000));
  board.run_for_ms(2);
  EXPECT_EQ(board.can_health().received, 0U);
  for (const std::uint32_t id : hal::request_and_sample_ids) board.can.others.push_back({{id, false, false, 8, {}}, 0});
  ASSERT_TRUE(board.run_until([&] { return board.can.others.empty(); }, 100));
  board.run_for_ms(2);
  EXPECT_EQ(board.can_health().received, hal::request_and_sample_ids.size());
}

TEST_F(BxcanBoard, ErrorsLeadToWarningAndPassiveAndBackWithoutLossOfAFrame) {
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

TEST_F(BxcanBoard, ReturnsFromBusOffAfterAPauseThatDoublesWhileNothingGetsOut) {
  queue(part_of_the_shift(200));
  board.run_for_ms(50);
  double pause_ms = 100;
  board.can.corrupt_sent = 3 * 32;
  for (unsigned time = 1; time <= 3; ++time, pause_ms *= 2) {
    ASSERT_TRUE(board.run_until([&] { return board.can.bus_off(); }, 1'500)) << time;
    EXPECT_EQ(board.can_health().state, CanState::bus_off);
    const std::uint32_t sent = board.can_health().sent;
    EXPECT_EQ(board.can.times_off, time);
    ASSERT_TRUE(board.run_until([&] { return !board.can.bus_off(); }, 2'000)) << time;
    const double away_ms = board.ms_at_bit(board.can.back_at_bit - board.can.off_since_bit);
    const double recovery_ms = board.ms_at_bit(128 * 11);
    EXPECT_GE(away_ms, pause_ms + recovery_ms);
    EXPECT_LE(away_ms, pause_ms + recovery_ms + 7 + longest_sample_ms)
        << "plus sleeps of a millisecond between the steps, and frames of other nodes between the recessive bits";
    EXPECT_EQ(board.can_health().sent, sent);
    EXPECT_EQ(board.can_health().bus_offs, time);
  }
  const std::size_t before = of_board(0x182).size();
  expect_estimates(1'000, 9);
  EXPECT_GE(of_board(0x182).size(), before + 9);
  EXPECT_EQ(board.can_health().state, CanState::active);
  EXPECT_GT(board.can_health().dropped, 3U) << "the frames that waited when the bus went off";
  board.can.corrupt_sent = 32;
  ASSERT_TRUE(board.run_until([&] { return board.can.bus_off(); }, 1'500));
  ASSERT_TRUE(board.run_until([&] { return !board.can.bus_off(); }, 2'000));
  EXPECT_LE(board.ms_at_bit(board.can.back_at_bit - board.can.off_since_bit),
            100 + board.ms_at_bit(128 * 11) + 7 + longest_sample_ms)
      << "frames got out: the pause is short again";
}

TEST_F(BxcanBoard, AWireHeldLowFromTheStartStopsOnlyTheBus) {
  board.can.stuck_dominant = true;
  expect_estimates(6'000, empty_samples_in(6));
  EXPECT_EQ(board.can_health().state, CanState::starting);
  EXPECT_GE(board.can_health().failed_starts, 3U);
  EXPECT_LE(board.can_health().failed_starts, 10U) << "the pauses grow";
  EXPECT_THAT(of_board(), IsEmpty());
  board.can.stuck_dominant = false;
  ASSERT_TRUE(board.run_until([&] { return board.can.on_the_bus(); }, 1'600 + 110));
  queue(part_of_the_shift(5));
  board.run_for_ms(600);
  EXPECT_GE(of_board(0x182).size(), 5U);
  EXPECT_EQ(board.can_health().state, CanState::active);
}

/// The wire is held low on an idle bus, and during a frame of the board.
TEST_F(BxcanBoard, AWireHeldLowLaterStopsOnlyTheBusAndNewValuesFollow) {
  for (const bool in_a_frame : {false, true}) {
    queue(part_of_the_shift(3));
    const unsigned before = board.estimates;
    ASSERT_TRUE(board.run_until([&] { return board.estimates >= before + 3; }, 500));
    const auto sending = [&] { return (board.can.read(0x04) & 1U << 8) != 0; };
    if (in_a_frame)
      ASSERT_TRUE(board.run_until(sending, 50));
    else
      board.run_for_ms(30);
    board.can.stuck_dominant = true;
    expect_estimates(4'000, empty_samples_in(4));
    EXPECT_EQ(board.can.bus_off(), in_a_frame) << "only a sender reaches bus-off";
    EXPECT_EQ(board.can_health().state, in_a_frame ? CanState::bus_off : CanState::passive);
    board.can.stuck_dominant = false;
    const std::size_t published = of_board(0x182).size();
    ASSERT_TRUE(board.run_until([&] { return of_board(0x182).size() > published; }, 4'500));
    EXPECT_EQ(can::Status::of(of_board(0x182)[published]).sample_counter, board.estimates);
  }
}

TEST_F(BxcanBoard, WithoutOtherNodesItContinuesAndSendsNewValuesWithinASecondOfTheFirstAcknowledge) {
  board.can.others_acknowledge = false;
  expect_estimates(8'000, empty_samples_in(8));
  EXPECT_EQ(board.can.transmit_errors(), 128U) << "missing acknowledges lead to error passive, never to bus-off";
  EXPECT_EQ(board.can_health().state, CanState::passive);
  EXPECT_EQ(board.can_health().sent, 0U);
  EXPECT_GT(board.can_health().dropped, 8U);
  EXPECT_THAT(of_board(), IsEmpty());
  board.can.others_acknowledge = true;
  // a second of silence, plus the time until the board makes an empty sample
  ASSERT_TRUE(board.run_until([&] { return of_board(0x182).size() == 1; }, 1'100 + 1e3 * patience_s));
  EXPECT_EQ(can::Status::of(of_board(0x182).front()).sample_counter, board.estimates) << "not the frames that waited";
  EXPECT_NE(can::Status::of(of_board(0x182).front()).flags & estimator::current_missing, 0U);
  queue(part_of_the_shift(3));
  board.run_for_ms(350);
  EXPECT_EQ(std::ranges::count_if(
                of_board(0x182),
                [](const can::Frame& f) { return (can::Status::of(f).flags & estimator::current_missing) == 0; }),
            3);
}

TEST(BxcanBoardAlone, WithoutACrystalItStaysOffTheBusAndEstimates) {
  UnicornBoard board(image(), 1, false);
  board.flash.bytes = started_once();
  board.run_for_ms(5'000);
  EXPECT_GE(board.estimates, empty_samples_in(5));
  EXPECT_FALSE(board.can.on_the_bus());
  EXPECT_EQ(board.can_health().state, CanState::starting);
  EXPECT_THAT(board.can.violations, IsEmpty());
}

TEST(BxcanBoardAlone, AtAnotherBitRateNoFrameGetsThrough) {
  UnicornBoard board(image());
  board.flash.bytes = started_once();
  board.can.bits_per_second = 500'000;
  board.run_for_ms(3'000);
  EXPECT_THAT(board.can.seen, IsEmpty());
  EXPECT_GT(board.can.attempts_failed, 30U);
  EXPECT_GE(board.estimates, empty_samples_in(3));
}

/// Compared with the bounds of the analysis, which does not depend on CRC and stuff bits of a certain frame.
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

}  // namespace
}  // namespace bms::firmware
