// The loader's image of the forklift board in Unicorn: times, images that are bad in ten ways, losses of power.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "hal/sample_frames.hpp"
#include "storage/persistence.hpp"
#include "tests/firmware/boot/loader_board.hpp"
#include "tests/firmware/storage/flash_model.hpp"

namespace bms::boot {
namespace {

using ::testing::IsEmpty;

constexpr std::uint32_t by_software = 1U << 28 | 1U << 26;
constexpr std::size_t cells = 16;  // of the forklift board

/// Samples of another node on the bus: ten a second, as long as the test wants.
void send_samples(firmware::UnicornBoard& board, double for_ms) {
  measurement::PackSample<cells> pack;
  static std::uint64_t time_us = 1'000'000;
  for (double ms = 0; ms < for_ms; ms += 100) {
    pack.time_us = time_us += 100'000;
    pack.current_ua = 0;
    pack.cell_uv.fill(3'290'000);
    pack.pack_uv = 3'290'000 * static_cast<std::int32_t>(cells);
    pack.temperature_cdegc.fill(2'500);
    static std::uint16_t number = 0;
    for (const can::Frame& f : hal::frames_of(pack, 0, ++number, 0))
      board.can.others.push_back(
          {firmware::wire_frame(f), board.can.now_bit + static_cast<std::uint64_t>(250 * ms), true});
  }
}

TEST(LoaderBoard, StartsTheConfirmedImageWithin300Ms) {
  LoaderBoard battery;
  ASSERT_TRUE(battery.board.run_until([&] { return battery.running() != 2; }, 2'000));
  EXPECT_EQ(battery.running(), 0);
  std::printf("reset to application: %.1f ms, %.1f M instructions\n", battery.board.now_ms(),
              1e-6 * static_cast<double>(battery.board.instructions));
  EXPECT_LT(battery.board.now_ms(), 300);
  EXPECT_EQ(battery.board.flash.slot_sectors, 0U);
  EXPECT_THAT(battery.board.flash.violations, IsEmpty());
  EXPECT_THAT(battery.board.rcc.violations, IsEmpty());
}

std::uint64_t instructions_to_start(std::size_t payload_bytes) {
  LoaderBoard battery(1, container(0, 0x000200, [&](std::string& payload, auto) { payload.resize(payload_bytes); }));
  EXPECT_TRUE(battery.board.run_until([&] { return battery.running() != 2; }, 2'000));
  return battery.board.instructions;
}

/// A start without a payload is the signature and little else; the hashes add a part in proportion to the image, of
/// which a slot has room for 222 KiB.
TEST(LoaderBoard, AlsoTheLargestImageWouldStartWithin300Ms) {
  const std::uint64_t small = instructions_to_start(8'192), large = instructions_to_start(73'728);
  const double each_kib = static_cast<double>(large - small) / 64, without = static_cast<double>(small) - 8 * each_kib;
  std::printf("a start: %.1f M instructions for the signature and the rest, %.0f for each KiB of the image\n",
              1e-6 * without, each_kib);
  EXPECT_LT(without + 222 * each_kib, 0.3 * 168e6);
  EXPECT_GT(each_kib, 1'024) << "no byte is hashed in less than an instruction";
}

TEST(LoaderBoard, AHealthyImageConfirmsItselfAndStays) {
  LoaderBoard battery;
  battery.board.longest_sleep_us = 500;
  battery.put_on_trial(container(1, 0x000300));
  send_samples(battery.board, 12'000);
  ASSERT_TRUE(battery.run_until([&] { return battery.marks(1).confirmed; }, 12'000));
  battery.board.reset(by_software);
  ASSERT_TRUE(battery.board.run_until([&] { return battery.running() == 1; }, 2'000));
  EXPECT_FALSE(battery.marks(1).rejected);
  EXPECT_THAT(battery.board.flash.violations, IsEmpty());
}

struct Bad {
  const char* what;
  Change change;
  double within_s;
};
void wrong_stack(std::string& payload, std::uint8_t) { payload.replace(0, 4, std::string(4, '\0')); }
void wrong_entry(std::string& payload, std::uint8_t) { payload.replace(4, 4, std::string("\x01\x00\x00\x60", 4)); }
void no_code(std::string& payload, std::uint8_t) {
  payload.replace(4'096, payload.size() - 4'096, std::string(payload.size() - 4'096, '\0'));
}

using Board = firmware::UnicornBoard;
constexpr Board::Instructions spins{0xE7FE, 0xE7FE};  // b to itself
const Bad bad_images[] = {
    {"hangs at its first instruction", patched("reset_handler", spins), 16},
    {"faults at its first instruction", patched("reset_handler", Board::undefined), 16},
    {"has no stack", wrong_stack, 16},
    {"begins where no code is", wrong_entry, 16},
    {"has only zeros behind its first block", no_code, 16},
    {"hangs in main()", patched("bms::hal::clock_start()", spins), 16},
    {"faults when it starts the bus", patched("bms::hal::can_start(", Board::undefined), 16},
    {"faults with its first sample", patched("bms::firmware::estimator_step(", Board::undefined), 16},
    {"estimates nothing", patched("bms::firmware::estimator_step(", Board::returns), 16},
    {"never sends", patched("bms::hal::can_listening()", Board::returns), 75},
    {"does not see what it measures", patched("bms::hal::can_receive(", Board::returns), 75},
};

/// 127 in the DBC file.
constexpr std::uint16_t not_confirmed = 127;
std::uint16_t newest_stored_fault(const firmware::UnicornBoard& board) {
  using Stored = firmware::FlashControllerModel;
  FlashModel model({Stored::sectors, Stored::sector_bytes}, 1);
  for (std::uint32_t k = 0; k < Stored::sectors; ++k)
    model.fill(k, {board.flash.bytes.begin() + k * Stored::sector_bytes,
                   board.flash.bytes.begin() + (k + 1) * Stored::sector_bytes});
  plug_in(&model);
  storage::Persistence p;
  p.start(hal::ResetCause::power_on, std::nullopt, std::nullopt);
  plug_in(nullptr);
  return p.events().last(0).code;
}

class BadImage : public ::testing::TestWithParam<int> {};

/// The longest time of the watchdog that the loader starts is 8 s at 17 kHz: 15 s.
TEST_P(BadImage, IsReplacedByTheOldOne) {
  const Bad& bad = bad_images[GetParam()];
  LoaderBoard battery;
  battery.board.longest_sleep_us = 500;
  battery.put_on_trial(container(1, 0x000300, bad.change));
  ASSERT_TRUE(battery.run_until([&] { return battery.marks(1).trials == 1; }, 2'000));
  const double began_ms = battery.board.now_ms();
  const auto measured_until = [&](const std::function<bool()>& becomes) {
    return [&battery, becomes] {
      send_samples(battery.board, 100);
      return becomes();
    };
  };
  ASSERT_TRUE(battery.run_until(measured_until([&] { return battery.running() == 0; }), 1e3 * bad.within_s));
  std::printf("%s: the old one after %.2f s\n", bad.what, 1e-3 * (battery.board.now_ms() - began_ms));
  EXPECT_TRUE(battery.marks(1).rejected);
  EXPECT_FALSE(battery.marks(1).confirmed);
  EXPECT_TRUE(battery.run_until([&] { return newest_stored_fault(battery.board) == not_confirmed; }, 2'000))
      << "the stored faults do not say so";
  battery.board.reset(by_software);
  ASSERT_TRUE(battery.board.run_until([&] { return battery.running() != 2; }, 2'000));
  EXPECT_EQ(battery.running(), 0) << "and it stays";
}

INSTANTIATE_TEST_SUITE_P(InElevenWays, BadImage, ::testing::Range(0, static_cast<int>(std::size(bad_images))));

TEST(LoaderBoard, OfLossesOfPowerInEveryPartOfAStartOneImageAlwaysRuns) {
  std::mt19937 random(7);
  int cuts = 0;
  for (std::uint32_t seed = 1; seed <= 3; ++seed) {
    LoaderBoard battery(seed);
    battery.board.longest_sleep_us = 500;
    battery.put_on_trial(container(1, 0x000300));
    for (int k = 0; k < 6; ++k, ++cuts) {
      battery.board.flash.operations_to_power_loss = random() % 2 == 0 ? static_cast<int>(random() % 4) : -1;
      battery.board.run_for_ms(static_cast<double>(random() % 400));
      battery.board.reset(1U << 27 | 1U << 26 | 1U << 25);
      battery.board.flash.operations_to_power_loss = -1;
      battery.board.flash.power_failed = false;
      ASSERT_TRUE(battery.board.run_until([&] { return battery.running() != 2; }, 2'000)) << "cut " << cuts;
    }
    EXPECT_THAT(battery.board.flash.violations, IsEmpty());
  }
}

}  // namespace
}  // namespace bms::boot
