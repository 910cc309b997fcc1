// The forklift board's own image on a core in Unicorn, its CAN controller and its flash interface register models,
// other nodes on the wire: what is on the wire and in the flash is what the application meant, and whatever the bus
// does, the firmware goes on estimating and feeding its watchdog.
#include <algorithm>
#include <cmath>
#include <map>
#include <regex>
#include <set>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/recording.hpp"
#include "files/text_file.hpp"
#include "firmware/application.hpp"
#include "hal/accepted_frames.hpp"
#include "host_sim/replay.hpp"
#include "images/firmware_image.hpp"
#include "tests/can/response_time.hpp"
#include "tests/firmware/host_board.hpp"
#include "tests/firmware/unicorn_board.hpp"

namespace bms::firmware {
namespace {

using namespace host_hal;
using hal::CanState;
using ::testing::IsEmpty;

const std::filesystem::path& image() {
  static const auto path = images::firmware_image("stm32f405_forklift", table9(), images::Image::remote);
  return path;
}

/// Sixteen of the recording's cell, a millivolt from each to the next, that are the recording's voltage in the mean.
std::vector<Pack> part_of_the_shift(std::size_t count) {
  const auto all = measurement::samples(files::read_recording(BMS_SOURCE_DIR "/recordings/forklift_shift.csv"));
  std::vector<Pack> part(count);
  for (std::size_t k = 0; k < count; ++k) {
    const measurement::Sample& s = all[3000 + k];
    part[k].time_us = s.time_us;
    part[k].current_ua = s.current_ua;
    for (std::size_t cell = 0; cell < Pack::cells; ++cell)
      part[k].cell_uv[cell] = s.voltage_uv - 7'500 + 1'000 * static_cast<std::int32_t>(cell);
    part[k].pack_uv = static_cast<std::int32_t>(Pack::cells) * s.voltage_uv;
    part[k].temperature_cdegc.fill(s.temperature_cdegc);
  }
  return part;
}

/// A flash as it left the works: a chip's is erased, and the firmware's first start has marked it.
const std::vector<std::uint8_t>& started_once() {
  static const auto bytes =
      HostBoard(std::vector<std::uint8_t>(FlashControllerModel::sectors * FlashControllerModel::sector_bytes, 0xFF))
          .flash();
  return bytes;
}

std::vector<can::Frame> meant_of(const std::vector<Pack>& part) {
  HostBoard host(started_once());
  for (const Pack& p : part) host.process_sample({p, 0, {}});
  return sent;
}

double ms_on_the_wire(const std::vector<can::Frame>& frames) {
  unsigned bits = 0;
  for (const can::Frame& f : frames) bits += bits_on_the_wire(wire_frame(f));
  return 1e3 * bits / 250e3;
}

constexpr std::size_t frames_of_a_sample = hal::pack_frames<Pack::cells>;
constexpr double longest_sample_ms = 1e3 * frames_of_a_sample * can_bus::worst_bits(8) / 250e3;
constexpr double patience_s = 0.5, period_s = 0.1;  // after five sample periods without one the board gives itself one
                                                    // that says nothing, and one each period from then on
constexpr unsigned given_in(double s) {
  return static_cast<unsigned>((s - patience_s) / period_s) - 1;
}  // one may be under way

constexpr std::uint64_t bits_between_samples = 25'000;  // ten a second at 250 kbit/s
constexpr double shortest_watchdog_ms = 1'360;          // 2 s by an oscillator at 47 kHz (datasheet, LSI)

bool same(const can::Frame& a, const can::Frame& b) { return a.id == b.id && a.length == b.length && a.data == b.data; }

void queue_for(UnicornBoard& board, const std::vector<Input>& inputs) {
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    const std::uint64_t due = board.can.now_bit + bits_between_samples * (k + 1);
    if (inputs[k].command) board.can.others.push_back({wire_frame(*inputs[k].command), due - bits_between_samples / 2});
    for (const can::Frame& f : hal::frames_of(inputs[k].pack, inputs[k].dc_link_uv, static_cast<std::uint16_t>(k)))
      board.can.others.push_back({wire_frame(f), due, true});
  }
}

/// A start looks at its memories first; what is sent before it listens nobody takes.
void run_until_it_listens(UnicornBoard& board) {
  ASSERT_TRUE(board.run_until([&] { return board.can.on_the_bus(); }, 200));
  board.run_for_ms(5);
}

ImageSize within_the_budgets(const std::filesystem::path& of) {
  const ImageSize size = size_of(of);
  EXPECT_LE(size.text + size.data, 64U * 1024);
  EXPECT_LE(size.data + size.bss, 16U * 1024);
  EXPECT_THAT(forbidden_in(symbols_of(of)), IsEmpty());
  return size;
}

class BxcanBoard : public ::testing::Test {
 protected:
  void SetUp() override { board.flash.bytes = started_once(); }
  void TearDown() override {
    if (IsSkipped()) return;
    EXPECT_THAT(board.can.violations, IsEmpty());
    EXPECT_THAT(board.flash.violations, IsEmpty());
    EXPECT_LT(board.longest_unfed_ms, shortest_watchdog_ms);
  }

  /// From now on a sample every 100 ms of the wire.
  void queue(const std::vector<Pack>& some) {
    std::vector<Input> inputs;
    for (const Pack& p : some) inputs.push_back({p, 0, {}});
    queue_for(board, inputs);
  }
  /// By another way than the bus, as fast as the firmware takes them out of the controller.
  void deliver(const Pack& pack) {
    for (const can::Frame& f : hal::frames_of(pack, 0, 0)) {
      board.can.deliver(f);
      ASSERT_TRUE(board.run_until([&] { return !board.can.receive_interrupt(); }, 1));
    }
  }
  std::vector<can::Frame> of_board(unsigned id = 0) const {
    std::vector<can::Frame> out;
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
    for (const unsigned id : {0x180U, 0x181U, 0x182U, 0x183U, 0x186U, 0x189U, 0x190U, 0x196U, 0x1B8U}) {
      const auto frames = of_board(id);
      for (std::size_t k = 0; k < frames.size(); ++k) {
        ASSERT_TRUE(can::intact(frames[k], static_cast<std::uint16_t>(id)));
        ASSERT_EQ(can::counter_of(frames[k]), k % 15) << fmt::format("{:x}, frame {}", id, k);
      }
    }
  }

  UnicornBoard board{image()};
};

/// Seven seconds of a truck that asks for power; its link follows the contactors of the application on this machine.
std::vector<Input> start_of_a_drive(HostBoard& host) {
  std::vector<Input> inputs;
  double dc_link_v = 0;
  bool driving = false;
  for (const Pack& recorded : part_of_the_shift(70)) {
    const std::size_t k = inputs.size();
    Input in{recorded, static_cast<std::int32_t>(1e6 * dc_link_v), {}};
    in.pack.time_us = 1'000'000 + 100'000 * k;
    if (!driving) in.pack.current_ua = 0;
    if (k % 20 == 3) {
      can::Command command;
      command.code = can::Command::code_request;
      command.argument = static_cast<std::uint32_t>(protection::Request::drive);
      in.command = command.frame(static_cast<std::uint8_t>(k / 20));
    }
    host.process_sample(in);
    inputs.push_back(in);
    const double pack_v = 1e-6 * in.pack.pack_uv;
    driving = switched.main_plus && switched.main_minus;
    if (driving)
      dc_link_v = pack_v;
    else if (switched.precharge && switched.main_minus)
      dc_link_v += (pack_v - dc_link_v) * (1 - std::exp(-0.1 / 0.5));
  }
  EXPECT_TRUE(driving);
  return inputs;
}

TEST_F(BxcanBoard, WhatIsOnTheWireIsBitForBitWhatTheApplicationMeansFromStartToDriving) {
  const measurement::StartingPoint start = host_sim::starting_point(host_sim::SocPrior{0.8, 0.05}).value();
  HostBoard host(started_once(), start);
  const auto inputs = start_of_a_drive(host);
  std::map<unsigned, std::vector<can::Frame>> expected;
  for (const can::Frame& f : sent) expected[f.id].push_back(f);
  EXPECT_GE(expected.size(), 24U);
  const std::size_t commands = expected[can::CommandAnswer::id].size();
  EXPECT_EQ(commands, 4U);

  for (const std::uint32_t seed : {1U, 2U, 3U}) {
    UnicornBoard one(image(), seed);
    one.flash.bytes = started_once();
    run_until_it_listens(one);
    one.can.others.push_back({wire_frame(hal::frame_of(start)), 0});
    queue_for(one, inputs);
    one.run_for_ms(100 * static_cast<double>(inputs.size()) + 50);
    std::map<unsigned, std::vector<can::Frame>> seen;
    for (const SeenFrame& s : one.can.seen) {
      if (s.from_board) seen[s.frame.id].push_back(s.frame);
    }
    ASSERT_EQ(seen.size(), expected.size());
    for (const auto& [id, frames] : expected) {
      ASSERT_EQ(seen[id].size(), frames.size()) << fmt::format("{:x}", id);
      if (id == can::Board::id) continue;  // what the board finds out about itself, this machine does not know
      for (std::size_t k = 0; k < frames.size(); ++k)
        ASSERT_TRUE(same(seen[id][k], frames[k]))
            << fmt::format("{:x}, frame {}, seed {}: {:02x}, not {:02x}", id, k, seed, fmt::join(seen[id][k].data, " "),
                           fmt::join(frames[k].data, " "));
    }
    EXPECT_NEAR(can::PackElectrical::of(seen[0x181].back()).voltage, 1e-6 * inputs.back().pack.pack_uv, 0.0006);
    EXPECT_NEAR(can::CellVoltages4::of(seen[0x193].back()).cell16, 1e-6 * inputs[inputs.size() - 5].pack.cell_uv[15],
                0.01);
    EXPECT_EQ(can::Status::of(seen[0x182].back()).sample_counter, inputs.size());
    EXPECT_EQ(can::ContactorState::of(seen[0x197].back()).state, can::ContactorState::state_drive);
    EXPECT_EQ(can::Faults::of(seen[0x196].back()).first_cause, 0U);
    EXPECT_EQ(can::Storage::of(seen[0x1B8].back()).state, can::Storage::state_works);
    EXPECT_GT(one.interrupts_taken, sent.size());
    EXPECT_THAT(one.can.violations, IsEmpty());
    const hal::CanHealth health = one.can_health();
    EXPECT_EQ(health.state, CanState::active);
    EXPECT_EQ(health.sent, sent.size());
    EXPECT_EQ(health.received, 1 + commands + frames_of_a_sample * inputs.size());
    EXPECT_EQ(health.dropped + health.lost + health.overruns + health.bus_offs + health.failed_starts, 0U);
  }
}

TEST_F(BxcanBoard, AfterAMinuteTheFlashHoldsBitForBitWhatTheApplicationKeepsAndTheNextStartGoesOnFromIt) {
  auto part = part_of_the_shift(130);  // a second from one to the next
  for (std::size_t k = 20; k < part.size(); ++k)
    part[k].temperature_cdegc[3] = measurement::no_temperature;  // the fourth sensor breaks: a fault that is kept
  const measurement::StartingPoint start = host_sim::starting_point(host_sim::SocPrior{0.8, 0.05}).value();
  const auto run = [](UnicornBoard& one, const std::vector<Pack>& some) {
    std::vector<Input> inputs;
    for (const Pack& p : some) inputs.push_back({p, 0, {}});
    queue_for(one, inputs);
    one.run_for_ms(100 * static_cast<double>(some.size()) + 50);
  };
  std::vector<std::uint8_t> kept;
  {
    HostBoard host(started_once(), start);
    for (const Pack& p : part) host.process_sample({p, 0, {}});
    kept = host.flash();
    EXPECT_GE(host.persistence().charge().operating_s, 60U);
    const auto code =
        static_cast<std::uint16_t>(first_fault_code + static_cast<std::uint16_t>(protection::Fault::temperature_lost));
    EXPECT_EQ(std::ranges::count(host.persistence().events().fault, code, &storage::EventsRecord::Fault::code), 1);
  }
  run_until_it_listens(board);
  board.can.others.push_back({wire_frame(hal::frame_of(start)), 0});
  run(board, part);
  EXPECT_GT(board.flash.words_programmed, 20U);
  EXPECT_EQ(board.flash.sectors_erased, 0U) << "there was room";
  EXPECT_NE(board.flash.bytes, started_once());
  ASSERT_EQ(board.flash.bytes, kept);
  // written with the samples 61 and 121; how far soc moved between them is not known of the time after
  const auto states = of_board(0x180);
  const auto minute = can::PackState::of(states[60]), before = can::PackState::of(states[120]);
  const double moved = std::abs(before.soc - minute.soc);

  // nobody knows how long the power was away: a week of 0.2 % a day less, a month of it less sure
  // (estimator/restart.hpp); a reset of the core alone takes no time
  const struct {
    hal::ResetCause cause;
    std::uint32_t csr;
    double lost_percent, doubted_percent;
  } starts[] = {{hal::ResetCause::power_on, 0x0E000000, 1.4, 6}, {hal::ResetCause::pin, 0x04000000, 0, 0}};
  for (const auto& s : starts) {
    UnicornBoard again(image(), 2);
    again.flash.bytes = kept;
    again.reset_flags = s.csr;
    cause = s.cause;
    HostBoard host(kept);
    host.process_sample({part.back(), 0, {}});
    cause = hal::ResetCause::power_on;
    run(again, {part.back()});
    std::map<unsigned, can::Frame> told, expected;
    for (const SeenFrame& f : again.can.seen) {
      if (f.from_board) told.emplace(f.frame.id, f.frame);
    }
    for (const can::Frame& f : sent) expected.emplace(f.id, f);
    ASSERT_EQ(told.size(), expected.size());
    expected.erase(can::Board::id);
    for (const auto& [id, frame] : expected) EXPECT_TRUE(same(told[id], frame)) << fmt::format("{:x}", id);
    EXPECT_EQ(can::StartingSoc::of(told[0x19D]).given, can::StartingSoc::given_yes);
    EXPECT_NEAR(1e-7 * can::StartingSoc::of(told[0x19D]).soc_ppb, before.soc - s.lost_percent, 0.0021)
        << "steps of 0.002 %";
    EXPECT_NEAR(1e-7 * can::StartingSigma::of(told[0x19E]).sigma_ppb, before.soc_sigma + moved + s.doubted_percent,
                0.0061);
    EXPECT_EQ(can::Storage::of(told[0x1B8]).starts, 2U);
    EXPECT_THAT(again.flash.violations, IsEmpty());
  }
}

/// The three sectors are erased and marked in less than a second, during which the watchdog is fed.
TEST(BxcanBoardAlone, OfANewChipTheFirstStartMarksTheFlashAndTheSecondFindsItSo) {
  UnicornBoard board(image());
  board.run_for_ms(1'000);
  EXPECT_LT(board.longest_unfed_ms, 300);
  board.run_for_ms(500);  // with the first sample, the cell file's mark
  EXPECT_EQ(board.flash.sectors_erased, FlashControllerModel::sectors);
  EXPECT_EQ(board.flash.bytes, started_once());
  EXPECT_TRUE(board.can.on_the_bus());
  UnicornBoard again(image());
  again.flash.bytes = board.flash.bytes;
  again.run_for_ms(100);
  EXPECT_TRUE(again.can.on_the_bus());
  EXPECT_EQ(again.flash.sectors_erased, 0U);
  EXPECT_EQ(again.flash.words_programmed, 0U);
  EXPECT_THAT(board.flash.violations, IsEmpty());
}

TEST_F(BxcanBoard, ArbitrationThatIsLostCostsNeitherAFrameNorTheOrder) {
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

/// Once a second two dozen frames are due at once, 0x196 first and 0x182 last. They leave by urgency, but for the one
/// that was under way.
TEST_F(BxcanBoard, AnUrgentFrameOvertakesThoseInTheMailboxes) {
  const auto part = part_of_the_shift(5);
  const std::size_t expected = meant_of(part).size();
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
    EXPECT_TRUE(std::is_sorted(first + 1, end, [](const auto& a, const auto& b) { return a.id < b.id; }))
        << fmt::format("{:x} {:x} {:x} {:x}", first[1].id, first[2].id, first[3].id, first[4].id);
    first = end;
  }
  EXPECT_EQ(bursts, 5U);
  EXPECT_GE(board.can.aborts, 2U * 5U) << "frames in mailboxes made room";
  EXPECT_EQ(board.can_health().dropped, 0U);
}

/// Samples faster than the bus can tell of them, by another way than the bus, so that frames are sent while others end.
TEST_F(BxcanBoard, AtTheLimitOfTheBusNothingIsLostAndBeyondItTheLeastUrgent) {
  const auto part = part_of_the_shift(1'000);
  const auto all = meant_of(part), first = meant_of({part[0]});
  const double sample_ms = ms_on_the_wire(all) / static_cast<double>(part.size());
  const std::uint32_t least_urgent = std::ranges::max(all, {}, &can::Frame::id).id;
  // every sample of this recording is a second after the last: all messages each time
  EXPECT_NEAR(static_cast<double>(all.size()), static_cast<double>((first.size() - 2) * part.size()), 20)
      << "the start is told once, a change of faults at once";
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
  const std::size_t told = of_board(0x180).size();

  feed(500, 0.6 * sample_ms);
  board.run_for_ms(50);
  const hal::CanHealth health = board.can_health();
  EXPECT_GT(health.dropped, 500U);
  EXPECT_EQ(health.sent + health.dropped, all.size());
  EXPECT_EQ(health.sent, of_board().size());
  EXPECT_EQ(of_board(0x180).size(), told + 500) << "the most urgent is never the one that is dropped";
  EXPECT_EQ(of_board(0x181).size(), told + 500);
  EXPECT_LT(of_board(least_urgent).size(), told + 250);
}

TEST_F(BxcanBoard, OfOneIdentifierTheOlderFrameLeavesFirstWhateverMailboxItHas) {
  run_until_it_listens(board);
  std::size_t told = 0;
  for (int time = 0; time < 20; ++time) {
    for (int k = 0; k < 80; ++k) board.can.others.push_back({{0x100, false, false, 8, {}}, 0});  // 39 ms of the wire
    for (const Pack& p : part_of_the_shift(5)) {
      deliver(p);
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

TEST_F(BxcanBoard, NothingButTheAcceptedIdentifiersComesIn) {
  run_until_it_listens(board);
  for (std::uint32_t id = 0; id < 0x800; id += 7) {
    const bool accepted = std::find(hal::accepted_ids.begin(), hal::accepted_ids.end(), id) != hal::accepted_ids.end();
    if (!accepted) board.can.others.push_back({{id, false, false, 8, {}}, 0});
  }
  for (const std::uint32_t id : hal::accepted_ids) {
    board.can.others.push_back({{id, false, true, 8, {}}, 0});  // remote request
    for (std::uint32_t tail : {0U, 1U, 0x3FFFFU})
      board.can.others.push_back({{id << 18 | tail, true, false, 8, {}}, 0});  // 29 bits
    for (std::uint32_t bit = 0; bit < 11; ++bit) {
      const std::uint32_t near = id ^ 1U << bit;
      if (std::find(hal::accepted_ids.begin(), hal::accepted_ids.end(), near) == hal::accepted_ids.end())
        board.can.others.push_back({{near, false, false, 8, {}}, 0});
    }
  }
  ASSERT_TRUE(board.run_until([&] { return board.can.others.empty(); }, 1'000));
  board.run_for_ms(2);
  EXPECT_EQ(board.can_health().received, 0U);
  for (const std::uint32_t id : hal::accepted_ids) board.can.others.push_back({{id, false, false, 8, {}}, 0});
  ASSERT_TRUE(board.run_until([&] { return board.can.others.empty(); }, 100));
  board.run_for_ms(2);
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
  EXPECT_EQ(of_board(can::SampleCurrent::id).size(), 2U)
      << "with the second sample it was heard, the third is not logged";
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
    EXPECT_LE(away_ms, rest_ms + recovery_ms + 7 + longest_sample_ms)
        << "sleeps of a millisecond between the steps, others' frames between the recessive bits";
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
  EXPECT_LE(board.ms_at_bit(board.can.back_at_bit - board.can.off_since_bit),
            100 + board.ms_at_bit(128 * 11) + 7 + longest_sample_ms)
      << "frames got out: the rest is short again";
}

TEST_F(BxcanBoard, AWireThatIsHeldLowAtTheStartStopsNothingButTheBus) {
  board.can.stuck_dominant = true;
  expect_estimates(6'000, given_in(6));
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
    if (in_a_frame)
      ASSERT_TRUE(board.run_until(sending, 50));
    else
      board.run_for_ms(30);
    board.can.stuck_dominant = true;
    expect_estimates(4'000, given_in(4));
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
  expect_estimates(8'000, given_in(8));
  EXPECT_EQ(board.can.transmit_errors(), 128U) << "no acknowledge makes passive, never bus-off";
  EXPECT_EQ(board.can_health().state, CanState::passive);
  EXPECT_EQ(board.can_health().sent, 0U);
  EXPECT_GT(board.can_health().dropped, 8U);
  EXPECT_THAT(of_board(), IsEmpty());
  board.can.others_acknowledge = true;
  // a second of silence, and the samples that the board gives itself
  ASSERT_TRUE(board.run_until([&] { return of_board(0x182).size() == 1; }, 1'100 + 1e3 * patience_s));
  EXPECT_EQ(can::Status::of(of_board(0x182).front()).sample_counter, board.estimates) << "not what waited";
  EXPECT_NE(can::Status::of(of_board(0x182).front()).flags & estimator::current_missing, 0U);
  queue(part_of_the_shift(3));
  board.run_for_ms(350);
  EXPECT_EQ(std::ranges::count_if(
                of_board(0x182),
                [](const can::Frame& f) { return (can::Status::of(f).flags & estimator::current_missing) == 0; }),
            3);
}

TEST(BxcanBoardAlone, WithoutItsCrystalItStaysOffTheBusAndEstimates) {
  UnicornBoard board(image(), 1, false);
  board.flash.bytes = started_once();
  board.run_for_ms(5'000);
  EXPECT_GE(board.estimates, given_in(5));
  EXPECT_FALSE(board.can.on_the_bus());
  EXPECT_EQ(board.can_health().state, CanState::starting);
  EXPECT_THAT(board.can.violations, IsEmpty());
}

TEST(BxcanBoardAlone, AtAnotherBitRateNobodyHearsIt) {
  UnicornBoard board(image());
  board.flash.bytes = started_once();
  board.can.bits_per_second = 500'000;
  board.run_for_ms(3'000);
  EXPECT_THAT(board.can.seen, IsEmpty());
  EXPECT_GT(board.can.attempts_failed, 30U);
  EXPECT_GE(board.estimates, given_in(3));
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
  ASSERT_TRUE(board.run_until([&] { return board.can.on_the_bus(); }, 100));
  EXPECT_EQ(board.register_value(0x40020400) >> 16 & 15, 10U) << "PB8, PB9: alternate function";
  EXPECT_EQ(board.register_value(0x40020424) & 255, 0x99U) << "9: CAN1";
  EXPECT_EQ(board.register_value(0x4002040C) >> 16 & 3, 1U) << "PB8 pulled up";
}

/// What candump shows of a board to which nobody has said anything is listed in its README: id and bytes, in this
/// order; and a sample to send.
TEST_F(BxcanBoard, TellsWhatItsPageListsWhenNobodyMeasuresAndItsSampleIsOne) {
  ASSERT_TRUE(board.run_until([&] { return of_board(0x1B9).size() == 1; }, 700));
  std::string told, joined;
  for (const SeenFrame& s : board.can.seen) {
    if (s.from_board) fmt::print("({:.6f})", 1e-3 * board.ms_at_bit(s.end_bit - board.can.seen.front().end_bit));
    std::string line = fmt::format("can0  {:03X}   [{}] ", s.frame.id, s.frame.length);
    for (const std::uint8_t byte : s.frame.data) line += fmt::format(" {:02X}", byte);
    fmt::print("  {}\n", line);
    if (s.frame.id < 0x199 || s.frame.id > 0x19E) told += line + "\n";
  }
  const std::string page = files::read_file(BMS_SOURCE_DIR "/boards/stm32f405_forklift/README.md");
  static const std::regex frame("can0  [0-9A-F]{3}   \\[8\\]  ([0-9A-F]{2} ){7}[0-9A-F]{2}");
  for (std::sregex_iterator f(page.begin(), page.end(), frame), end; f != end; ++f) joined += f->str() + "\n";
  EXPECT_EQ(joined, told);

  Pack sample;
  sample.current_ua = -5'000'000;
  sample.cell_uv.fill(3'280'000);
  sample.pack_uv = 16 * 3'280'000;
  sample.temperature_cdegc.fill(2'500);
  for (const can::Frame& f : hal::frames_of(sample, 0, 0)) {
    std::string sent = "#";
    for (const std::uint8_t byte : f.data) sent += fmt::format("{:02X}", byte);
    if (f.id == hal::check_frame_id || f.id == hal::dc_link_frame_id) continue;  // optional
    EXPECT_TRUE(
        page.find(fmt::format("{:03X}{}", f.id, sent)) != std::string::npos ||
        (page.find(fmt::format(" {:03X}", f.id)) != std::string::npos && page.find("$id" + sent) != std::string::npos))
        << fmt::format("{:03X}{}", f.id, sent);
  }
}

/// Against the analysis: with the bus full of frames less urgent, the latency of every message from the sample's last
/// bit to its own.
TEST_F(BxcanBoard, EveryFrameComesWithinTheTimeThatTheAnalysisAllows) {
  queue(part_of_the_shift(50));
  for (std::uint64_t k = 0; k < 11'000; ++k)
    board.can.others.push_back({{0x7F0, false, false, 8, {}}, 5'000 + 120 * k});  // 1 stuff bit in 5: longer than that
  board.run_for_ms(5'200);
  const auto messages =
      can_bus::messages_on_the_bus(10, can_bus::sample_to_queue_s, can_bus::Cells::measured_by_another_node);
  std::map<unsigned, double> worst_ms;
  std::uint64_t sample_bit = 0;
  double busy_bits = 0;
  for (const SeenFrame& s : board.can.seen) {
    if (s.frame.id == hal::time_frame_id) sample_bit = s.end_bit;
    if (s.from_board) worst_ms[s.frame.id] = std::max(worst_ms[s.frame.id], board.ms_at_bit(s.end_bit - sample_bit));
    busy_bits += static_cast<double>(s.end_bit - s.begin_bit);
  }
  EXPECT_GT(busy_bits / static_cast<double>(board.can.now_bit), 0.95);
  EXPECT_GE(worst_ms.size(), 23U);
  for (std::size_t k = 0; k < messages.size(); ++k) {
    if (!worst_ms.contains(messages[k].id)) continue;
    const double allowed_ms = 1e3 * can_bus::response_on_the_bus_s(messages, k, 250e3);
    fmt::print("{:#05x} {:20} measured {:5.2f} ms, allowed {:5.2f} ms\n", messages[k].id, messages[k].name,
               worst_ms[messages[k].id], allowed_ms);
    EXPECT_LE(worst_ms[messages[k].id], allowed_ms) << messages[k].name;
  }
}

/// What the analysis takes for granted. An instruction is a cycle here; the chip, with what its flash accelerator
/// misses, is given two.
TEST_F(BxcanBoard, ASampleIsInTheQueueWithinTheTimeThatTheAnalysisTakesForGranted) {
  run_until_it_listens(board);
  double longest_ms = 0, minute_ms = 0;
  std::size_t n = 0;
  for (const Pack& p : part_of_the_shift(125)) {
    const unsigned fed = board.watchdog_feeds, written = board.flash.words_programmed;
    deliver(p);
    const double complete_ms = board.now_ms();
    ASSERT_TRUE(
        board.run_until([&] { return board.watchdog_feeds > fed; }, 50));  // the last that is done with a sample
    double& longest = board.flash.words_programmed > written ? minute_ms : longest_ms;
    longest = std::max(longest, board.now_ms() - complete_ms);
    board.run_for_ms(15);
    EXPECT_EQ(of_board(0x182).size(), ++n);
  }
  EXPECT_GT(longest_ms, 0.02);
  EXPECT_LE(2 * longest_ms, 1e3 * can_bus::sample_to_queue_s);
  EXPECT_GT(minute_ms, longest_ms) << "a record was written, after the frames";
  EXPECT_LE(minute_ms, 20) << "storage/README.md";
  EXPECT_LE(board.stack_used(), 4U * 1024);
  fmt::print("a sample {:.3f} ms, one that writes to flash {:.2f} ms, stack {} bytes over {} samples\n", longest_ms,
             minute_ms, board.stack_used(), n);
}

/// The image with BMS_VEHICLE_PROFILE=j1939.
TEST_F(BxcanBoard, WithTheJ1939ProfileFramesOf29BitsGoOutBehindTheOwnOnesAndTheBudgetsHold) {
  const auto with_profile = images::firmware_image("stm32f405_forklift", table9(), images::Image::remote, "j1939");
  const ImageSize size = within_the_budgets(with_profile);
  UnicornBoard other{with_profile};
  other.flash.bytes = started_once();
  ASSERT_TRUE(other.run_until([&] { return other.can.on_the_bus(); }, 100));
  const auto part = part_of_the_shift(3);
  std::vector<Input> inputs;
  for (const Pack& p : part) inputs.push_back({p, 0, {}});
  queue_for(other, inputs);
  other.run_for_ms(400);
  std::map<std::uint32_t, std::vector<can::Frame>> told;
  for (const SeenFrame& s : other.can.seen) {
    if (s.from_board && s.frame.long_id) told[s.frame.id].push_back(s.frame);
  }
  EXPECT_EQ(told.size(), 6U);
  ASSERT_EQ(told[0x19FFFD80].size(), 3U) << "a second between the samples of this recording";
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& d = told[0x19FFFD80][k].data;
    EXPECT_EQ(d[0], 1);
    EXPECT_EQ(d[1], 120);
    EXPECT_NEAR(0.05 * (d[2] | d[3] << 8), 1e-6 * part[k].pack_uv, 0.0251);
    EXPECT_NEAR(0.001 * static_cast<double>(hal::get_bytes<std::uint32_t>(d, 4)) - 2e6, -1e-6 * part[k].current_ua,
                0.0011);
  }
  bool behind = false;
  for (const SeenFrame& s : other.can.seen) {
    if (!s.from_board) continue;
    if (s.frame.long_id || s.frame.id == can::Faults::id) {
      behind = s.frame.long_id;
    } else {
      EXPECT_FALSE(behind) << fmt::format("{:x} after a frame of 29 bits", s.frame.id);
    }
  }
  EXPECT_EQ(other.can_health().dropped, 0U);
  EXPECT_THAT(other.can.violations, IsEmpty());
  fmt::print("with the J1939 profile: flash {} bytes, RAM {} bytes\n", size.text + size.data, size.data + size.bss);
}

/// The image with BMS_VEHICLE_PROFILE=cia418.
TEST_F(BxcanBoard, WithTheCia418ProfileAChargerHearsItsPdosAndIsAnsweredAndTheBudgetsHold) {
  const auto with_profile = images::firmware_image("stm32f405_forklift", table9(), images::Image::remote, "cia418");
  const ImageSize size = within_the_budgets(with_profile);
  UnicornBoard other{with_profile};
  other.flash.bytes = started_once();
  ASSERT_TRUE(other.run_until([&] { return other.can.on_the_bus(); }, 100));
  other.can.others.push_back({wire_frame({0x601, 8, {0x40, 0x00, 0x10, 0}}), other.can.now_bit});
  queue_for(other, {{part_of_the_shift(1)[0], 0, {}}});
  other.run_for_ms(200);
  std::map<std::uint32_t, can::Frame> told;
  for (const SeenFrame& s : other.can.seen) {
    if (s.from_board) told[s.frame.id] = s.frame;
  }
  ASSERT_TRUE(told.contains(0x701) && told.contains(0x20A) && told.contains(0x30A) && told.contains(0x40A));
  EXPECT_EQ(told[0x20A].length, 3);
  EXPECT_EQ(told[0x30A].length, 7);
  EXPECT_NEAR(hal::get_bytes<std::uint32_t>(told[0x30A].data, 3) / 1'024.0, 1e-6 * part_of_the_shift(1)[0].pack_uv,
              1.0 / 1'024);
  ASSERT_TRUE(told.contains(0x581)) << "the filters let the request in";
  EXPECT_EQ(told[0x581].data[4], 0xA2);
  EXPECT_THAT(other.can.violations, IsEmpty());
  fmt::print("with the CiA 418 profile: flash {} bytes, RAM {} bytes\n", size.text + size.data, size.data + size.bss);
}

TEST_F(BxcanBoard, FitsIntoItsBudgetsOfFlashRamAndStack) {
  const ImageSize size = within_the_budgets(image());
  ASSERT_TRUE(board.run_until([&] { return board.can.on_the_bus(); }, 100));
  const double on_the_bus_ms = board.now_ms();
  queue(part_of_the_shift(20));
  board.run_for_ms(2'100);
  EXPECT_EQ(board.estimates, 20U);
  EXPECT_LE(board.stack_used(), 4U * 1024);
  EXPECT_GT(board.stack_used(), 500U);
  fmt::print("flash {} bytes, RAM {} bytes, stack {} bytes, on the bus {:.1f} ms after the reset\n",
             size.text + size.data, size.data + size.bss, board.stack_used(), on_the_bus_ms);
}

}  // namespace
}  // namespace bms::firmware
