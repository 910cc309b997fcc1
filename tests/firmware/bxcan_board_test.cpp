// The forklift board's own image on a model of its CAN controller: bus and flash hold bit for bit what the application
// on this machine sends and stores.
#include <cmath>
#include <map>
#include <regex>

#include "files/text_file.hpp"
#include "replay/replay.hpp"
#include "tests/firmware/bxcan_board.hpp"

namespace bms::firmware {
namespace {

/// Seven seconds of a truck that requests power. Its DC link follows the contactors of the application on this machine.
std::vector<Input> start_of_a_drive(HostBoard& host) {
  std::vector<Input> inputs;
  double dc_link_v = 0;
  bool driving = false;
  for (const Pack& recorded : part_of_the_shift(70)) {
    const std::size_t k = inputs.size();
    host_hal::set_link(1e-6 * recorded.pack_uv, dc_link_v);
    Input in{recorded, host_hal::link_readings, {}};
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

TEST_F(BxcanBoard, BusHasTheFramesOfTheApplicationBitForBitFromStartToDriving) {
  const measurement::StartingPoint start = replay::starting_point(replay::SocPrior{0.8, 0.05}).value();
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
      if (id == can::Board::id) continue;  // this machine does not have the self-diagnosis of the board
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

/// Sends samples to a board and lets it process them.
void run(UnicornBoard& board, const std::vector<Pack>& some) {
  std::vector<Input> inputs;
  for (const Pack& p : some) inputs.push_back({p, {0, 0}});
  queue_for(board, inputs);
  board.run_for_ms(100 * static_cast<double>(some.size()) + 50);
}

/// Flash content of the application on this machine after these samples.
std::vector<std::uint8_t> flash_after(const std::vector<Pack>& part, const measurement::StartingPoint& start) {
  HostBoard host(started_once(), start);
  for (const Pack& p : part) host.process_sample({p, {0, 0}});
  EXPECT_GE(host.persistence().charge().operating_s, 60U);
  const auto code =
      static_cast<std::uint16_t>(first_fault_code + static_cast<std::uint16_t>(protection::Fault::temperature_lost));
  EXPECT_EQ(std::ranges::count(host.persistence().events().fault, code, &storage::EventsRecord::Fault::code), 1);
  return host.flash();
}

struct Restart {
  hal::ResetCause cause;
  std::uint32_t csr;
  double soc_percent, sigma_percent;  ///< expected starting point
};

/// Starts the board and the application on this machine from the same flash. Both send the same frames.
void expect_restart(const std::vector<std::uint8_t>& flash, const Pack& sample, const Restart& expected_start) {
  UnicornBoard again(image(), 2);
  again.flash.bytes = flash;
  again.reset_flags = expected_start.csr;
  cause = expected_start.cause;
  HostBoard host(flash);
  host.process_sample({sample, {0, 0}});
  cause = hal::ResetCause::power_on;
  run(again, {sample});
  std::map<unsigned, can::Frame> seen, expected;
  for (const SeenFrame& f : again.can.seen) {
    if (f.from_board) seen.emplace(f.frame.id, f.frame);
  }
  for (const can::Frame& f : sent) expected.emplace(f.id, f);
  ASSERT_EQ(seen.size(), expected.size());
  expected.erase(can::Board::id);
  for (const auto& [id, frame] : expected) EXPECT_TRUE(same(seen[id], frame)) << fmt::format("{:x}", id);
  EXPECT_EQ(can::StartingSoc::of(seen[0x19D]).given, can::StartingSoc::given_yes);
  EXPECT_NEAR(1e-7 * can::StartingSoc::of(seen[0x19D]).soc_ppb, expected_start.soc_percent, 0.0021)
      << "steps of 0.002 %";
  EXPECT_NEAR(1e-7 * can::StartingSigma::of(seen[0x19E]).sigma_ppb, expected_start.sigma_percent, 0.0061);
  EXPECT_EQ(can::Storage::of(seen[0x1B8]).starts, 2U);
  EXPECT_THAT(again.flash.violations, IsEmpty());
}

TEST_F(BxcanBoard, AfterAMinuteTheFlashIsThatOfTheApplicationBitForBitAndTheNextStartUsesIt) {
  auto part = part_of_the_shift(130);  // one second apart
  for (std::size_t k = 20; k < part.size(); ++k)
    part[k].temperature_cdegc[3] = measurement::no_temperature;  // the fourth sensor breaks: a stored fault
  const measurement::StartingPoint start = replay::starting_point(replay::SocPrior{0.8, 0.05}).value();
  const std::vector<std::uint8_t> stored = flash_after(part, start);
  run_until_it_listens(board);
  board.can.others.push_back({wire_frame(hal::frame_of(start)), 0});
  run(board, part);
  EXPECT_GT(board.flash.words_programmed, 20U);
  EXPECT_EQ(board.flash.sectors_erased, 0U) << "there was space";
  EXPECT_NE(board.flash.bytes, started_once());
  ASSERT_EQ(board.flash.bytes, stored);
  // Records are written with the samples 61 and 121. The change of soc since the last one is not known.
  const auto states = of_board(0x180);
  const auto minute = can::PackState::of(states[60]), before = can::PackState::of(states[120]);
  const double sigma = before.soc_sigma + std::abs(before.soc - minute.soc);

  // After a power-on the length of the pause is not known: a week of 0.2 % per day lower, a month of it less certain
  // (estimator/restart.hpp). A reset of the core takes no time.
  expect_restart(stored, part.back(), {hal::ResetCause::power_on, 0x0E000000, before.soc - 1.4, sigma + 6});
  expect_restart(stored, part.back(), {hal::ResetCause::pin, 0x04000000, before.soc, sigma});
}

/// The three sectors are erased and marked in less than a second. The watchdog is fed meanwhile.
TEST(BxcanBoardAlone, FirstStartOfANewChipMarksTheFlashAndTheSecondChangesNothing) {
  UnicornBoard board(image());
  board.run_for_ms(1'000);
  EXPECT_LT(board.longest_unfed_ms, 300);
  board.run_for_ms(500);  // the first sample stores the hash of the cell file
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

TEST_F(BxcanBoard, ACommandIsReceivedAndAnswered) {
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
      << "the command came with the second sample; the third is not logged";
}

TEST_F(BxcanBoard, PinsAreThoseOfTheReadme) {
  ASSERT_TRUE(board.run_until([&] { return board.can.on_the_bus(); }, 100));
  EXPECT_EQ(board.register_value(0x40020400) >> 16 & 15, 10U) << "PB8, PB9: alternate function";
  EXPECT_EQ(board.register_value(0x40020424) & 255, 0x99U) << "9: CAN1";
  EXPECT_EQ(board.register_value(0x4002040C) >> 16 & 3, 1U) << "PB8 pulled up";
}

/// The README lists the frames of a board without any input, as candump shows them, and a sample to send.
TEST_F(BxcanBoard, SendsTheFramesThatItsPageListsAndThePagesSampleIsValid) {
  ASSERT_TRUE(board.run_until([&] { return of_board(0x1B9).size() == 1; }, 700));
  std::string sent_lines, listed_lines;
  for (const SeenFrame& s : board.can.seen) {
    if (s.from_board) fmt::print("({:.6f})", 1e-3 * board.ms_at_bit(s.end_bit - board.can.seen.front().end_bit));
    std::string line = fmt::format("can0  {:03X}   [{}] ", s.frame.id, s.frame.length);
    for (const std::uint8_t byte : s.frame.data) line += fmt::format(" {:02X}", byte);
    fmt::print("  {}\n", line);
    if (s.frame.id < 0x199 || s.frame.id > 0x19E) sent_lines += line + "\n";
  }
  const std::string page = files::read_file(BMS_SOURCE_DIR "/boards/stm32f405_forklift/README.md");
  static const std::regex frame("can0  [0-9A-F]{3}   \\[8\\]  ([0-9A-F]{2} ){7}[0-9A-F]{2}");
  for (std::sregex_iterator f(page.begin(), page.end(), frame), end; f != end; ++f) listed_lines += f->str() + "\n";
  EXPECT_EQ(listed_lines, sent_lines);

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

}  // namespace
}  // namespace bms::firmware
