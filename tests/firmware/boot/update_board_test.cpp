// A whole update of the forklift board in Unicorn: loader, running image and new image are the real ones, the tool's
// side is that of bms update, on a bus of 250 kbit/s. Its operations of the flash are recorded. The losses of power
// begin from them: the flash as it was after so many operations, with the next one torn, and a start of the chip.
//
// BMS_UPDATE_CUTS: number of losses of power, 40 without it; BMS_UPDATE_FIRST_CUT: number of the first one, 0 without
// it. Each loss follows from its number alone, so several processes can share them.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "can/generated/can_messages.hpp"
#include "tests/firmware/boot/board_bus.hpp"
#include "tests/firmware/boot/recorded_flash.hpp"
#include "tests/firmware/boot/stored_years.hpp"
#include "update/update_run.hpp"

namespace bms::boot {
namespace {

using ::testing::IsEmpty;

// ---- one update without a disturbance ----

struct Update {
  std::vector<update::Container> images;  ///< 0.2.0 in slot A, 0.3.0 in slot B
  Contents before;
  std::vector<Operation> operations;
  std::size_t confirmed_at = 0;  ///< operations until the new image has confirmed itself
  update::UpdateResult result;
  double seconds = 0, sending_s = 0, load = 0;  ///< load: of the bus, while the container is sent
  std::vector<firmware::SeenFrame> sent;        ///< by the board meanwhile
};

/// The last 1,024 bytes of a slot are its marks.
std::size_t operations_until_confirmed(const Update& u) {
  Contents c = u.before;
  SlotBytes slots;
  constexpr std::uint32_t end = application_slots[1] + application_slot_bytes;
  for (std::size_t k = 0; k < u.operations.size(); ++k) {
    const Operation& o = u.operations[k];
    c.apply(o);
    if (o.bytes != 4 || o.address >= end || o.address < end - trailer_bytes) continue;
    std::ranges::copy(c.slot(Kind::application, 1), slots.slots[1].begin());
    if (read_marks(slots, 1).confirmed) return k + 1;
  }
  return 0;
}

const Update& the_update() {
  static const Update update = [] {
    Update u;
    u.images = {signed_image(0, 0x000200), signed_image(1, 0x000300)};
    LoaderBoard battery(1, u.images[0].bytes);
    battery.board.longest_sleep_us = 500;
    battery.board.flash.bytes = years_of_use();
    u.before = contents_of(battery.board);
    battery.board.flash.on_operation = [&](const Operation& o) { u.operations.push_back(o); };
    BoardBus bus(battery.board);
    bus.pass(1'000);
    bus.load_bus(0.5);
    std::uint64_t first_bit = 0, last_bit = 0;
    update::UpdateWish wish;
    wish.progress = [&](std::uint32_t, std::uint32_t) {
      last_bit = battery.board.can.now_bit;
      if (first_bit == 0) first_bit = last_bit;
    };
    wish.containers = u.images;
    wish.start_wait_s = wish.restart_wait_s = wish.sample_wait_s = 300;  // the board may be slower than the clock
    const double began_ms = battery.board.now_ms();
    u.result = run_update(bus, wish);
    u.seconds = 1e-3 * (battery.board.now_ms() - began_ms);
    u.sending_s = static_cast<double>(last_bit - first_bit) / battery.board.can.bits_per_second;
    std::uint64_t busy = 0;
    for (const auto& f : battery.board.can.seen) {
      if (f.begin_bit < first_bit || f.end_bit > last_bit) continue;
      busy += f.end_bit - f.begin_bit;
      if (f.from_board) u.sent.push_back(f);
    }
    u.load = static_cast<double>(busy) / static_cast<double>(last_bit - first_bit);
    u.confirmed_at = operations_until_confirmed(u);
    EXPECT_THAT(battery.board.flash.violations, IsEmpty());
    EXPECT_THAT(battery.board.can.violations, IsEmpty());
    return u;
  }();
  return update;
}

TEST(UpdateOfTheBoard, WhatTheTestTakesForStoredIsThere) {
  const auto charge = charge_in(years_of_use());
  EXPECT_GE(charge.charged_uah, 500'000U);
  EXPECT_GE(charge.operating_s, 180U);
  EXPECT_EQ(charge.pack.soc_ppb, 612'000'000);
}

TEST(UpdateOfTheBoard, TheRealImageIsSentStartedAndConfirmed) {
  const Update& u = the_update();
  EXPECT_EQ(u.result.outcome, update::UpdateResult::Outcome::done) << u.result.reason;
  EXPECT_EQ(u.result.from, "0.2.0");
  std::printf("%zu bytes: sent in %.1f s, whole update %.1f s, %zu operations of the flash\n", u.images[1].bytes.size(),
              u.sending_s, u.seconds, u.operations.size());
  EXPECT_GT(u.confirmed_at, 0U);
}

/// Cycles of the DBC file.
template <class... Messages>
std::map<std::uint32_t, double> cycles_ms() {
  return {{std::uint32_t{Messages::id}, 1e-3 * Messages::cycle_us}...};
}

TEST(UpdateOfTheBoard, NoCyclicMessageIsLateByTheTransfer) {
  const Update& u = the_update();
  const auto cycles = cycles_ms<can::Identity, can::CurrentLimits, can::Health, can::CellVoltages1, can::CellVoltages4,
                                can::CellExtremes, can::Temperatures, can::Faults, can::MoreFaults, can::ContactorState,
                                can::AllowedCurrent, can::Storage, can::Board>();
  EXPECT_GT(u.load, 0.5);
  double worst = 0;
  for (const auto& [id, cycle_ms] : cycles) {
    ASSERT_GT(cycle_ms, 0) << id;
    double last_ms = 0, longest_ms = 0;
    int n = 0;
    for (const auto& f : u.sent) {
      if (f.frame.id != id) continue;
      const double ms = 1e3 * static_cast<double>(f.end_bit) / 250e3;
      if (n++ > 0) longest_ms = std::max(longest_ms, ms - last_ms);
      last_ms = ms;
    }
    EXPECT_GE(n, u.sending_s * 1e3 / cycle_ms - 1) << fmt::format("{:03x}", id);
    EXPECT_LT(longest_ms, 1.5 * cycle_ms) << fmt::format("{:03x}", id);
    worst = std::max(worst, longest_ms / cycle_ms);
  }
  std::printf("%zu cyclic messages at %.0f %% load of the bus: at most %.2f cycles apart\n", cycles.size(),
              100 * u.load, worst);
}

// ---- losses of power ----

std::string part_of(const Operation& o) {
  if (o.address >= one_time_begin) return "counter";
  if (o.address < application_slots[0]) return "stored data";
  if (o.bytes > 4) return "erase";
  return (o.address - application_slots[0]) % application_slot_bytes < application_slot_bytes - trailer_bytes
             ? "transfer"
             : "marks";
}

class Cuts {
  static constexpr unsigned works_on_every = 21;  // coprime to the number of parts, so that each part has its turn

 public:
  Cuts() : battery_(1, the_update().images[0].bytes), bus_(battery_.board) { battery_.board.longest_sleep_us = 500; }

  void one(unsigned number) {
    const Cut cut = plan_.cut(number);
    in_starts_ += start_after(cut, battery_);
    const std::uint8_t runs = check_image(cut);
    if (number % works_on_every != 0 || ::testing::Test::HasFailure()) return;
    // The image works on: it opens the stored data and sends.
    bus_.pass(1'500);
    EXPECT_EQ(battery_.running(), runs) << cut.name;
    EXPECT_TRUE(std::ranges::any_of(battery_.board.can.seen, [](const auto& f) {
      return f.from_board && f.frame.id == can::PackState::id;
    })) << cut.name;
    expect_nothing_lost(battery_.board.flash.bytes, cut.charges, cut.name);
  }
  const std::map<std::string, unsigned>& by_part() const { return plan_.by_part(); }
  unsigned in_starts() const { return in_starts_; }

 private:
  /// What runs is what was signed, complete; after the new image has confirmed itself, it is that one.
  std::uint8_t check_image(const Cut& cut) {
    const std::uint8_t runs = battery_.running();
    if (runs > 1) return runs;
    const std::string& signed_bytes = the_update().images[runs].bytes;
    EXPECT_TRUE(std::ranges::equal(battery_.board.read_flash(application_slots[runs], signed_bytes.size()),
                                   bytes_of(signed_bytes)))
        << cut.name;
    const bool confirmed = cut.operation >= the_update().confirmed_at;
    EXPECT_TRUE(runs == 1 || !confirmed) << cut.name << ": older than what was confirmed";
    expect_nothing_lost(battery_.board.flash.bytes, cut.charges, cut.name);
    // Both images have the security version 1, and the first one has confirmed itself before the update.
    EXPECT_EQ(battery_.board.read_flash(one_time_begin, 4), (std::vector<std::uint8_t>{0xFE, 0xFF, 0xFF, 0xFF}))
        << cut.name;
    return runs;
  }

  LoaderBoard battery_;
  BoardBus bus_;
  CutPlan plan_{the_update().before, the_update().operations, part_of};
  unsigned in_starts_ = 0;
};

TEST(UpdateOfTheBoard, AfterEveryLossOfPowerOneOfTheImagesRunsAndNoRecordIsLost) {
  const int cuts = of_environment("BMS_UPDATE_CUTS", 40), first = of_environment("BMS_UPDATE_FIRST_CUT", 0);
  ASSERT_GT(the_update().confirmed_at, 0U) << "the update did not come to its end: there is nothing to cut";
  Cuts all;
  for (int k = 0; k < cuts && !HasFailure(); ++k) {
    all.one(static_cast<unsigned>(first + k));
    if (k % 100 == 99) std::fprintf(stderr, "%d cuts, %u in the start after one\n", k + 1, all.in_starts());
  }
  for (const auto& [part, n] : all.by_part()) {
    std::printf("%6u cuts: %s\n", n, part.c_str());
    EXPECT_GT(n, 0U);
  }
  std::printf("%6u cuts in the start after one\n", all.in_starts());
  EXPECT_EQ(all.by_part().size(), 5U);
  EXPECT_GT(all.in_starts(), 0U);
}

}  // namespace
}  // namespace bms::boot
