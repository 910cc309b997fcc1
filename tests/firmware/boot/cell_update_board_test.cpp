// Cell constants alone, sent to the forklift board in Unicorn by the code of bms update: checked, confirmed, and the
// estimates afterwards are those of the host's replay with their cell file, bit for bit.
#include <gmock/gmock.h>
#include <unicorn/unicorn.h>

#include "estimator/estimate.hpp"
#include "measurement/sample.hpp"
#include "replay/replay.hpp"
#include "storage/persistence.hpp"
#include "tests/firmware/boot/board_bus.hpp"
#include "tests/firmware/boot/recorded_flash.hpp"
#include "tests/firmware/boot/signed_cell.hpp"
#include "tests/firmware/storage/flash_model.hpp"
#include "update/update_run.hpp"

namespace bms::boot {
namespace {

using ::testing::IsEmpty;
using Outcome = update::UpdateResult::Outcome;

constexpr std::uint16_t cell_file_key = 2;  // firmware/stored_state.hpp

/// A truck at rest whose load and cells change; what it measured, and what its battery estimated since its last start.
class MeasuredBattery {
 public:
  MeasuredBattery() : battery(1, container(0, 0x000200)), bus(battery.board) {
    battery.board.longest_sleep_us = 500;
    record_at_ = address_in(0, "bms::hal::record_estimate(");
    battery.board.core().on_entry = [this] { record(); };
    battery.board.core().watch_entry(record_at_);
    bus.change = [this](measurement::PackSample<BoardBus::cells>& pack) {
      ++n_;
      pack.current_ua = load ? -500'000 - static_cast<std::int32_t>(n_ % 40) * 100'000 : 0;
      const std::int32_t uv = 3'290'000 + pack.current_ua / 50 + static_cast<std::int32_t>(n_ % 7) * 1'000;
      pack.cell_uv.fill(uv);
      pack.pack_uv = uv * static_cast<std::int32_t>(BoardBus::cells);
      samples.push_back({pack.time_us, pack.current_ua, uv, 2'500});
      return measures;
    };
  }
  /// Estimates of the host's replay with this cell file from the sample on from which they are those of the board.
  bool estimates_are_those_of(const files::CellFile& cell) const {
    for (std::size_t first = 0; first + estimates.size() <= samples.size(); ++first) {
      std::vector<measurement::Sample> since(samples.begin() + static_cast<long>(first),
                                             samples.begin() + static_cast<long>(first + estimates.size()));
      // the battery starts in the middle of a sample, of which it misses the first frame
      if ((estimates.front().back() & estimator::current_missing) != 0)
        since.front().current_ua = measurement::no_reading;
      const auto track =
          replay::run_on_host(cell, since, std::nullopt, replay::ScalarKind::float32, replay::Timing::none);
      if (track.rows.words() == estimates) return true;
    }
    return false;
  }
  storage::Persistence stored() const {
    using Stored = firmware::FlashControllerModel;
    FlashModel model({Stored::sectors, Stored::sector_bytes}, 1);
    const auto& bytes = battery.board.flash.bytes;
    for (std::uint32_t k = 0; k < Stored::sectors; ++k)
      model.fill(k, {bytes.begin() + k * Stored::sector_bytes, bytes.begin() + (k + 1) * Stored::sector_bytes});
    plug_in(&model);
    storage::Persistence p;
    p.start(hal::ResetCause::power_on, std::nullopt, std::nullopt);
    plug_in(nullptr);
    return p;
  }
  /// A loss of power, and nothing is stored: the battery starts from its voltage, as a replay does.
  void start_from_voltage(double for_ms) {
    std::ranges::fill(battery.board.flash.bytes, std::uint8_t{0xFF});
    battery.board.reset(by_power);
    const double reset_ms = battery.board.now_ms();
    ASSERT_TRUE(battery.board.run_until([&] { return battery.running() == 0; }, 2'000));
    std::printf("reset to application: %.1f ms\n", battery.board.now_ms() - reset_ms);
    bus.pass(for_ms);
  }
  update::UpdateResult send(const std::vector<update::Container>& containers) {
    update::UpdateWish wish;
    wish.containers = containers;
    wish.start_wait_s = wish.restart_wait_s = wish.sample_wait_s = 600;  // the board may be slower than the clock
    wish.pause = [this] { bus.pass(200); };
    return run_update(bus, wish);
  }

  bool measures = true, load = false;
  LoaderBoard battery;
  BoardBus bus;
  std::vector<measurement::Sample> samples;
  std::vector<estimator::EstimateWords> estimates;

 private:
  /// r0, r1: the words as a span.
  void record() {
    if (battery.board.resets.size() != resets_) estimates.clear();
    resets_ = battery.board.resets.size();
    const std::uint32_t at = battery.board.core().reg(UC_ARM_REG_R0);
    estimator::EstimateWords words{};
    for (std::size_t k = 0; k < words.size(); ++k)
      words[k] = battery.board.core().word(at + static_cast<std::uint32_t>(4 * k));
    estimates.push_back(words);
  }

  std::uint32_t record_at_ = 0;
  std::size_t resets_ = 0;
  std::uint64_t n_ = 0;
};

TEST(CellUpdateOfTheBoard, TheEstimatesAreThenThoseOfTheReplayWithTheNewCellFile) {
  const files::CellFile old_cell = files::read_cell("table9"), new_cell = better();
  MeasuredBattery truck;
  truck.bus.pass(3'000);
  ASSERT_GE(truck.estimates.size(), 15U);
  EXPECT_TRUE(truck.estimates_are_those_of(old_cell));
  const auto containers = signed_cell(new_cell);
  const double began_ms = truck.battery.board.now_ms();
  const auto result = truck.send(containers);
  ASSERT_EQ(result.outcome, Outcome::done) << result.reason;
  std::printf("%u bytes, whole update with erase and trial %.1f s\n", result.sent,
              1e-3 * (truck.battery.board.now_ms() - began_ms));
  EXPECT_EQ(result.to, "cell " + fmt::format("{:08x}", new_cell.hash));
  const auto stored = truck.stored();
  EXPECT_EQ(stored.settings().get(cell_file_key), static_cast<std::int32_t>(old_cell.hash))
      << "what is stored belongs to the same cell";
  EXPECT_TRUE(stored.starting_point());

  // After a loss of power they act at once, without a trial.
  truck.load = true;
  truck.start_from_voltage(20'000);
  EXPECT_GE(truck.estimates.size(), 190U);
  EXPECT_TRUE(truck.estimates_are_those_of(new_cell));
  EXPECT_FALSE(truck.estimates_are_those_of(old_cell));
  update::Link link(truck.bus);
  const auto state = update::read_cell_state(link);
  ASSERT_TRUE(state);
  EXPECT_EQ(state->acting_hash, new_cell.hash);
  EXPECT_EQ(state->built_hash, old_cell.hash);
  EXPECT_FALSE(state->trial || state->returned);
  EXPECT_THAT(truck.battery.board.flash.violations, IsEmpty());
  EXPECT_THAT(truck.battery.board.can.violations, IsEmpty());
}

TEST(CellUpdateOfTheBoard, ConstantsThatABatteryDoesNotConfirmReturnWithAStoredFault) {
  MeasuredBattery truck;
  truck.bus.pass(1'500);
  update::UpdateWish wish;
  wish.containers = signed_cell(better());
  wish.progress = [&](std::uint32_t done, std::uint32_t of) { truck.measures = done < of; };
  wish.start_wait_s = wish.restart_wait_s = wish.sample_wait_s = 600;  // the board may be slower than the clock
  wish.pause = [&] { truck.bus.pass(200); };
  const auto result = run_update(truck.bus, wish);
  EXPECT_EQ(result.outcome, Outcome::returned) << result.reason;
  const auto stored = truck.stored();
  bool says_so = false;  // others follow, because the truck measures nothing
  for (std::uint32_t k = 0; k < 4; ++k) says_so = says_so || stored.events().last(k).code == 127;
  EXPECT_TRUE(says_so);
  truck.measures = true;
  truck.start_from_voltage(2'000);
  EXPECT_TRUE(truck.estimates_are_those_of(files::read_cell("table9")));
}

TEST(CellUpdateOfTheBoard, OtherLimitsAreRefusedByTheBatteryWhoeverSignedThem) {
  MeasuredBattery truck;
  truck.bus.pass(1'500);
  auto payloads = update::cell_payloads(better(), files::read_cell("table9"));
  for (update::Payload& p : payloads) p.bytes.at(8 + 3 * 8) ^= 1;  // the last bit of limits.voltage_max_v
  const auto result = truck.send(signed_payloads(std::move(payloads)));
  EXPECT_EQ(result.outcome, Outcome::refused);
  EXPECT_EQ(result.reason, words_for(Refusal::other_limits));
  truck.start_from_voltage(2'000);
  EXPECT_TRUE(truck.estimates_are_those_of(files::read_cell("table9")));
}

}  // namespace
}  // namespace bms::boot
