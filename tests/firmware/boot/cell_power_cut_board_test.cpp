// Losses of power while the forklift board in Unicorn receives, tries and confirms cell constants: those of the build
// are followed by others, and those by third ones. The operations of the flash are recorded (recorded_flash.hpp). After
// each loss the application runs, with constants that are complete, signed, and never older than what was confirmed.
//
// BMS_CELL_UPDATE_CUTS: number of losses of power, 10 without it; BMS_CELL_UPDATE_FIRST_CUT: number of the first one, 0
// without it.
#include <set>

#include "boot/handover.hpp"
#include "can/generated/can_messages.hpp"
#include "tests/firmware/boot/board_bus.hpp"
#include "tests/firmware/boot/recorded_flash.hpp"
#include "tests/firmware/boot/signed_cell.hpp"
#include "update/update_run.hpp"

namespace bms::boot {
namespace {

/// The slots of cell constants in recorded contents.
class RecordedCells final : public SlotFlash {
 public:
  explicit RecordedCells(Contents& contents) : contents_(contents) {}
  std::uint32_t slot_bytes() const override { return cell_slot_bytes; }
  bool erase(std::uint8_t slot) override {
    std::ranges::fill(place(slot), std::uint8_t{0xFF});
    return true;
  }
  bool program(std::uint8_t slot, std::uint32_t at, std::uint32_t word) override {
    for (std::size_t k = 0; k < 4; ++k) place(slot)[at + k] &= static_cast<std::uint8_t>(word >> 8 * k);
    return true;
  }
  void read(std::uint8_t slot, std::uint32_t at, std::span<std::uint8_t> into) override {
    std::ranges::copy(place(slot).subspan(at, into.size()), into.begin());
  }
  std::uint32_t one_time(std::uint32_t) override { return ~0U; }
  bool program_one_time(std::uint32_t, std::uint32_t) override { return false; }
  std::span<std::uint8_t> place(std::uint8_t slot) {
    return std::span(contents_.slots).subspan(cell_slots[slot] - application_slots[0], cell_slot_bytes);
  }

 private:
  Contents& contents_;
};

/// Constants that were sent, in the slot of the same number.
struct Sent {
  std::uint32_t hash = 0;
  std::string bytes;
  std::size_t complete_at = 0, confirmed_at = 0;  ///< the operation that sets the mark
};

struct Updates {
  Contents before;
  std::vector<Operation> operations;
  std::array<Sent, 2> sent;
  std::vector<update::UpdateResult> results;
};

void find_marks(Updates& u) {
  Contents c = u.before;
  RecordedCells cells(c);
  for (std::size_t k = 0; k < u.operations.size(); ++k) {
    c.apply(u.operations[k]);
    if (u.operations[k].address < cell_slots[0] || u.operations[k].address >= one_time_begin) continue;
    for (const std::uint8_t slot : {std::uint8_t{0}, std::uint8_t{1}}) {
      const Marks m = read_marks(cells, slot);
      if (m.complete && u.sent[slot].complete_at == 0) u.sent[slot].complete_at = k;
      if (m.confirmed && u.sent[slot].confirmed_at == 0) u.sent[slot].confirmed_at = k;
    }
  }
}

const Updates& the_updates() {
  static const Updates updates = [] {
    Updates u;
    LoaderBoard battery;
    battery.board.longest_sleep_us = 500;
    battery.board.flash.bytes = years_of_use();
    u.before = contents_of(battery.board);
    battery.board.flash.on_operation = [&](const Operation& o) { u.operations.push_back(o); };
    BoardBus bus(battery.board);
    bus.pass(1'000);
    for (const std::size_t slot : {std::size_t{0}, std::size_t{1}}) {
      const files::CellFile cell = better(slot == 0 ? 1.1 : 1.2);
      update::UpdateWish wish;
      wish.containers = signed_cell(cell, static_cast<std::uint32_t>(slot + 1));
      wish.start_wait_s = wish.restart_wait_s = wish.sample_wait_s = 600;  // the board may be slower than the clock
      wish.pause = [&] { bus.pass(200); };
      u.results.push_back(run_update(bus, wish));
      u.sent[slot] = {cell.hash, wish.containers[slot].bytes};
    }
    find_marks(u);
    return u;
  }();
  return updates;
}

std::string part_of(const Operation& o) {
  if (o.address >= one_time_begin) return "counter";
  if (o.address < application_slots[0]) return "stored data";
  if (o.address < cell_slots[0]) return "marks of the application";  // the loader sets them again at each start
  if (o.bytes > 4) return "erase";
  return (o.address - cell_slots[0]) % cell_slot_bytes < cell_slot_bytes - trailer_bytes ? "transfer" : "marks";
}

/// Asks again: an answer is waited for by the host's clock, and the board may be slower.
std::optional<update::CellState> state_of(BoardBus& bus) {
  std::optional<update::CellState> state;
  for (int k = 0; k < 20 && !state; ++k) {
    update::Link link(bus);
    state = update::read_cell_state(link);
  }
  return state;
}

class CellCuts {
  static constexpr unsigned works_on_every = 7;  // coprime to the number of parts, so that each part has its turn

 public:
  CellCuts() : bus_(battery_.board) { battery_.board.longest_sleep_us = 500; }

  void one(unsigned number) {
    const Cut cut = plan_.cut(number);
    in_starts += start_after(cut, battery_);
    if (::testing::Test::HasFailure()) return;
    const std::uint32_t acts = check_constants(cut);
    acted.insert(acts);
    expect_nothing_lost(battery_.board.flash.bytes, cut.charges, cut.name);
    if (number % works_on_every != 0 || ::testing::Test::HasFailure()) return;
    bus_.pass(1'500);
    const auto state = state_of(bus_);
    ASSERT_TRUE(state) << cut.name;
    EXPECT_EQ(state->acting_hash, acts) << cut.name;
    EXPECT_TRUE(state->refusal == Refusal::none || state->refusal == Refusal::trial_failed) << cut.name;
    EXPECT_EQ(battery_.running(), 0) << cut.name;
    expect_nothing_lost(battery_.board.flash.bytes, cut.charges, cut.name);
  }
  const std::map<std::string, unsigned>& by_part() const { return plan_.by_part(); }
  unsigned in_starts = 0;
  std::set<std::uint32_t> acted;

 private:
  /// Hash of the constants with which the loader has started the application.
  std::uint32_t check_constants(const Cut& cut) {
    const auto& [first, second] = the_updates().sent;
    const std::uint32_t of_build = files::read_cell("table9").hash;
    CellHandover message;
    const auto bytes = battery_.board.read_flash(cell_handover_address, sizeof message);
    std::memcpy(&message, bytes.data(), sizeof message);
    const auto start = start_of(message);
    EXPECT_TRUE(start) << cut.name;
    if (!start) return 0;
    const std::uint32_t acts = message.cell_hash;
    std::set<std::uint32_t> possible;
    if (cut.operation <= first.confirmed_at) possible.insert(of_build);
    if (cut.operation >= first.complete_at && cut.operation <= second.confirmed_at) possible.insert(first.hash);
    if (cut.operation >= second.complete_at) possible.insert(second.hash);
    EXPECT_TRUE(possible.contains(acts)) << cut.name << fmt::format(": {:08x}", acts);
    EXPECT_EQ(start->found, acts != of_build) << cut.name;
    if (!start->found) return acts;
    const Sent& sent = the_updates().sent[start->slot];
    EXPECT_EQ(acts, sent.hash) << cut.name;
    EXPECT_TRUE(
        std::ranges::equal(battery_.board.read_flash(cell_slots[start->slot], sent.bytes.size()), bytes_of(sent.bytes)))
        << cut.name;
    return acts;
  }

  LoaderBoard battery_;
  BoardBus bus_;
  CutPlan plan_{the_updates().before, the_updates().operations, part_of};
};

TEST(CellUpdateOfTheBoard, AfterEveryLossOfPowerTheConstantsAreOldNewOrThoseOfTheBuild) {
  const Updates& u = the_updates();
  for (const auto& result : u.results) ASSERT_EQ(result.outcome, update::UpdateResult::Outcome::done) << result.reason;
  for (const Sent& sent : u.sent) {
    ASSERT_GT(sent.complete_at, 0U);
    ASSERT_GT(sent.confirmed_at, sent.complete_at);
  }
  const int cuts = of_environment("BMS_CELL_UPDATE_CUTS", 10), first = of_environment("BMS_CELL_UPDATE_FIRST_CUT", 0);
  CellCuts all;
  for (int k = 0; k < cuts && !HasFailure(); ++k) {
    all.one(static_cast<unsigned>(first + k));
    if (k % 20 == 19) std::fprintf(stderr, "%d cuts, %u in the start after one\n", k + 1, all.in_starts);
  }
  for (const auto& [part, n] : all.by_part()) std::printf("%6u cuts: %s\n", n, part.c_str());
  std::printf("%6u cuts in the start after one; constants that acted: %zu of 3\n", all.in_starts, all.acted.size());
  EXPECT_EQ(all.by_part().size(), 6U);
  EXPECT_GE(all.acted.size(), 2U);
}

unsigned storage_faults(const std::vector<std::uint8_t>& stored) {
  FlashModel model({Stored::sectors, Stored::sector_bytes}, 1);
  storage::Persistence p;
  start_stored(p, model, stored);
  plug_in(nullptr);
  unsigned n = 0;
  for (std::uint32_t k = 0; k < storage::EventsRecord::max_faults; ++k)
    n += p.events().last(k).code == can::Faults::first_cause_storage_fault ? 1U : 0U;
  return n;
}

TEST(CellUpdateOfTheBoard, ConfirmedConstantsThatAreDamagedLaterFallBackWithOneStoredFault) {
  const Updates& u = the_updates();
  Cut end;
  end.name = "damaged";
  end.contents = u.before;
  for (const Operation& o : u.operations) end.contents.apply(o);
  LoaderBoard battery;
  battery.board.longest_sleep_us = 500;
  BoardBus bus(battery.board);
  const auto acts_after_start = [&] {
    start_after(end, battery);
    bus.pass(1'500);
    end.contents = contents_of(battery.board);
    const auto state = state_of(bus);
    return state ? state->acting_hash : 0;
  };
  EXPECT_EQ(acts_after_start(), u.sent[1].hash);
  EXPECT_EQ(storage_faults(end.contents.stored), 0U);
  end.contents.slots[cell_slots[1] - application_slots[0] + header_bytes + 100] ^= 0x20;
  const std::uint32_t of_build = files::read_cell("table9").hash;
  EXPECT_EQ(acts_after_start(), of_build) << "the other ones are older than the counter allows";
  EXPECT_EQ(storage_faults(end.contents.stored), 1U);
  EXPECT_EQ(acts_after_start(), of_build);
  EXPECT_EQ(storage_faults(end.contents.stored), 1U) << "said once";
  RecordedCells cells(end.contents);
  EXPECT_TRUE(read_marks(cells, 1).erased);
  EXPECT_TRUE(read_marks(cells, 0).confirmed);
  EXPECT_TRUE(battery.board.flash.violations.empty());
}

TEST(CellUpdateOfTheBoard, ConstantsOnTrialThatCannotBeUsedGiveWayToTheConfirmedOnes) {
  const Updates& u = the_updates();
  Cut planted;
  planted.contents = u.before;
  for (std::size_t k = 0; k < u.sent[1].complete_at; ++k) planted.contents.apply(u.operations[k]);
  RecordedCells cells(planted.contents);
  ASSERT_TRUE(read_marks(cells, 0).confirmed && !read_marks(cells, 1).complete);
  auto payloads = update::cell_payloads(better(1.2), files::read_cell("table9"));
  for (update::Payload& p : payloads) p.bytes.at(8 + 3 * 8) ^= 1;  // the last bit of limits.voltage_max_v
  const std::string refused = signed_payloads(std::move(payloads), 2).at(1).bytes;
  ASSERT_TRUE(prepare(cells, 1));
  std::ranges::copy(bytes_of(refused), cells.place(1).begin());
  ASSERT_TRUE(complete(cells, 1));

  LoaderBoard battery;
  BoardBus bus(battery.board);
  start_after(planted, battery);
  const std::size_t resets = battery.board.resets.size();
  bus.pass(3'000);
  EXPECT_EQ(battery.board.resets.size(), resets + 1) << "one restart, asked for by the application";
  const auto state = state_of(bus);
  ASSERT_TRUE(state);
  EXPECT_EQ(state->acting_hash, u.sent[0].hash);
  EXPECT_TRUE(state->returned);
  planted.contents = contents_of(battery.board);
  EXPECT_TRUE(read_marks(cells, 1).rejected);
  EXPECT_TRUE(battery.board.flash.violations.empty());
}

}  // namespace
}  // namespace bms::boot
