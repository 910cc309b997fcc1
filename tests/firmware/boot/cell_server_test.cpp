// Cell constants between the tool's client and the battery's server, on a bus in memory.
#include <chrono>

#include "boot/flash_map.hpp"
#include "boot/update_server.hpp"
#include "tests/firmware/boot/cell_bench.hpp"
#include "update/update_run.hpp"

namespace bms::boot {
namespace {

/// A battery with a confirmed application that confirms healthy constants at its next answer.
class BatteryWithCells final : public monitor::FrameSource, public UpdateSurroundings {
 public:
  BatteryWithCells() {
    bench.produce({.version = 0x000200, .security_version = 5, .seed = 7});
    start(true);
  }

  bool rest = true, healthy = true, usable = true, knows_cells = true, application_on_trial = false;
  bool confirms = true;         ///< constants on trial at once
  int restarts_when_asked = 0;  ///< constants on trial that cannot be used: at which request the battery restarts
  bool answers_late = false;    ///< after a restart: no sooner than its last start was ago
  CellBench bench;
  Start cell;
  std::vector<std::uint8_t> kinds_erased;

  void start(bool power_on) {
    started_ = bench.reset(power_on);
    started_.trial = application_on_trial;
    cell = bench.reset_cell(power_on, started_.trial);
    if (cell.trial && !healthy) cell = bench.reset_cell(false);
    std::optional<CellSlots> slots;
    if (knows_cells) slots.emplace(CellSlots{bench.cells(), bench.cell_battery(), cell});
    server_ = std::make_unique<UpdateServer>(bench.slots(), bench.battery(), started_, std::nullopt, *this,
                                             check_header, slots);
    if (cell.found && !usable) server_->cell_refused(Refusal::other_model);
    if (cell.trial && healthy && usable && confirms) {
      confirm(bench.cells(), cell.slot, cell.header.security_version);
      server_->confirmed();
    }
    next_node_ = std::make_unique<UpdateNode>(*server_, *this);
    node_.swap(next_node_);
    started_at_ = Clock::now() - std::chrono::minutes(power_on || answers_late ? ++starts_ : 0);
  }
  std::size_t read(std::span<monitor::BusFrame> room, int) override {
    std::size_t n = 0;
    can::Frame frame;
    while (n < room.size() && node_->next_frame(frame, now_us())) room[n++] = monitor::to_bus_frame(frame, 0);
    return n;
  }
  bool ended() const override { return false; }
  bool live() const override { return true; }
  bool send(const can::Frame& frame) override {
    if (cell.trial && !usable && restarts_when_asked > 0 && --restarts_when_asked == 0) start(false);
    node_->receive(frame, now_us());
    return true;
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::uint64_t now_us() const {
    return static_cast<std::uint64_t>(
        std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - started_at_).count());
  }
  bool at_rest() override { return rest; }
  std::uint64_t challenge() override { return 1; }
  void restart() override { start(false); }

  int starts_ = 0;
  Start started_;
  std::unique_ptr<UpdateServer> server_;
  std::unique_ptr<UpdateNode> node_, next_node_;
  Clock::time_point started_at_{};
};

class CellServerTest : public ::testing::Test {
 protected:
  static update::UpdateWish wish(CellWish w = {}) {
    update::UpdateWish out;
    w.slot = 0;
    const auto a = cell_payload_of(w);
    w.slot = 1;
    out.containers = sign({a, cell_payload_of(w)}, key_of(w.key));
    out.start_wait_s = 2;
    return out;
  }
  update::UpdateResult run(const update::UpdateWish& w) { return run_update(battery_, w); }
  using Outcome = update::UpdateResult::Outcome;
  using Bytes = update::Link::Bytes;

  BatteryWithCells battery_;
};

TEST_F(CellServerTest, TheirStateIsThatOfTheHeaderFile) {
  battery_.start(true);
  update::Link link(battery_);
  EXPECT_EQ(
      link.request({0x22, 0xF1, 0xA2}).value_or(Bytes{}),
      (Bytes{0x62, 0xF1, 0xA2, 0xFF, 0, 0, 0, 0, 0, 0, 0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0, 0, 0, 0, 0}))
      << "the constants of the build act";
}

TEST_F(CellServerTest, ConstantsAloneAreSentStartedAndConfirmed) {
  const auto result = run(wish());
  EXPECT_EQ(result.outcome, Outcome::done) << result.reason;
  EXPECT_EQ(result.from, "cell 11111111");
  EXPECT_EQ(result.to, "cell 22222222");
  EXPECT_LT(result.sent, 3'000U) << "no application was sent";
  const auto next = run(wish({.cell_hash = 0x4444'4444, .seed = 2}));
  EXPECT_EQ(next.outcome, Outcome::done) << next.reason;
  EXPECT_EQ(battery_.cell.slot, 1) << "the next ones go to the other slot";
  const auto again = run(wish({.cell_hash = 0x4444'4444, .seed = 2}));
  EXPECT_EQ(again.reason, "the battery uses these cell constants already");
}

TEST_F(CellServerTest, AnEraseForAnImageSparesTheConstants) {
  ASSERT_EQ(run(wish()).outcome, Outcome::done);
  update::Link link(battery_);
  ASSERT_EQ(link.request({0x10, 0x02})->at(0), 0x50);
  ASSERT_EQ(link.request({0x31, 0x01, 0xFF, 0x00}, 10'000)->at(4), 0);
  EXPECT_TRUE(read_marks(battery_.bench.slots(), 1).erased);
  EXPECT_TRUE(read_marks(battery_.bench.cells(), 0).confirmed) << "the constants that act are not erased";
}

TEST_F(CellServerTest, ARestartIsSeenAlsoIfTheTimeSinceItIsNotLess) {
  battery_.answers_late = true;
  EXPECT_EQ(run(wish()).outcome, Outcome::done);
  battery_.healthy = false;
  EXPECT_EQ(run(wish({.cell_hash = 0x4444'4444, .seed = 2})).outcome, Outcome::returned);
}

TEST_F(CellServerTest, ThoseThatAreNotConfirmedReturn) {
  battery_.healthy = false;
  const auto result = run(wish());
  EXPECT_EQ(result.outcome, Outcome::returned);
  EXPECT_EQ(result.reason,
            "the battery did not confirm itself with the new cell constants; those of the firmware act again");
}

TEST_F(CellServerTest, ThoseThatTheApplicationCannotUseAreReportedWithItsReason) {
  ASSERT_EQ(run(wish()).outcome, Outcome::done);
  battery_.usable = false;  // as after a new image with another model
  battery_.start(true);
  update::Link link(battery_);
  const auto state = update::read_cell_state(link);
  ASSERT_TRUE(state);
  EXPECT_EQ(state->refusal, Refusal::other_model);
  EXPECT_EQ(state->acting_hash, hash_of_build);
  EXPECT_FALSE(state->trial);
}

TEST_F(CellServerTest, ThoseThatTheApplicationCannotUseStayOnTrialUntilItsRestart) {
  battery_.usable = false;
  battery_.restarts_when_asked = 8;
  const auto result = run(wish());
  EXPECT_EQ(result.outcome, Outcome::returned);
  EXPECT_EQ(battery_.restarts_when_asked, 0) << "the tool has waited for the restart that ends the trial";
  EXPECT_NE(result.reason.find("; those of the firmware act again"), std::string::npos) << result.reason;
  EXPECT_TRUE(read_marks(battery_.bench.cells(), 0).rejected);
}

TEST_F(CellServerTest, EachRefusalArrivesInWords) {
  EXPECT_NE(run(wish({.built_for = 0x5555'5555})).reason.find("built with another cell file: 55555555"),
            std::string::npos);
  EXPECT_EQ(run(wish({.begin = "X"})).reason, words_for(Refusal::other_limits));
  EXPECT_EQ(run(wish({.key = "stranger"})).reason, words_for(Refusal::unknown_key));
  battery_.rest = false;
  EXPECT_EQ(run(wish()).reason, words_for(Refusal::not_at_rest));
  battery_.rest = true;
  battery_.knows_cells = false;
  battery_.start(true);
  EXPECT_EQ(run(wish()).reason,
            "the firmware or the boot loader of this battery takes no cell constants by themselves");
  EXPECT_FALSE(battery_.cell.found);
}

TEST_F(CellServerTest, NothingIsSentBeforeTheGateHasSeenWhatActs) {
  auto w = wish();
  std::uint32_t asked = 0;
  w.gate = [&](std::uint32_t acting) {
    asked = acting;
    return std::string("not yet");
  };
  const auto result = run(w);
  EXPECT_EQ(result.reason, "not yet");
  EXPECT_EQ(result.sent, 0U);
  EXPECT_EQ(asked, hash_of_build);
}

TEST_F(CellServerTest, AServerWithoutCellsRefusesTheirSlotsAndTheirKind) {
  battery_.knows_cells = false;
  battery_.start(true);
  update::Link link(battery_);
  ASSERT_EQ(link.request({0x10, 0x02})->at(0), 0x50);
  EXPECT_EQ(*link.request({0x31, 0x01, 0xFF, 0x00, 2}), (Bytes{0x7F, 0x31, 0x70}));
  EXPECT_EQ(link.request({0x22, 0xF1, 0xA4})->at(3), static_cast<std::uint8_t>(Refusal::other_kind));
  EXPECT_EQ(*link.request({0x34, 0x00, 0x44, 0x08, 0x0A, 0, 0, 0, 0, 0x10, 0}), (Bytes{0x7F, 0x34, 0x70}));
  EXPECT_EQ(*link.request({0x31, 0x01, 0xFF, 0x00, 1, 1}), (Bytes{0x7F, 0x31, 0x13}));
}

TEST_F(CellServerTest, NeitherKindIsReceivedWhileOneIsOnTrial) {
  battery_.application_on_trial = true;
  battery_.start(true);
  update::Link link(battery_);
  ASSERT_EQ(link.request({0x10, 0x02})->at(0), 0x50);
  for (const std::uint8_t kind : {std::uint8_t{1}, std::uint8_t{2}}) {
    EXPECT_EQ((*link.request({0x31, 0x01, 0xFF, 0x00, kind}))[2], 0x22);
    EXPECT_EQ(link.request({0x22, 0xF1, 0xA4})->at(3), static_cast<std::uint8_t>(Refusal::not_confirmed));
  }
  ASSERT_TRUE(prepare(battery_.bench.cells(), 0));
  EXPECT_EQ((*link.request({0x34, 0x00, 0x44, 0x08, 0x0A, 0, 0, 0, 0, 0x10, 0}))[2], 0x22)
      << "nor into a slot that was erased before";
}

TEST_F(CellServerTest, NeitherKindIsReceivedWhileConstantsAreOnTrial) {
  battery_.confirms = false;
  ASSERT_EQ(battery_.bench.transfer_cell(cell({})), Refusal::none);
  battery_.start(false);
  ASSERT_TRUE(battery_.cell.trial);
  update::Link link(battery_);
  ASSERT_EQ(link.request({0x10, 0x02})->at(0), 0x50);
  for (const std::uint8_t kind : {std::uint8_t{1}, std::uint8_t{2}}) {
    EXPECT_EQ((*link.request({0x31, 0x01, 0xFF, 0x00, kind}))[2], 0x22);
    EXPECT_EQ(link.request({0x22, 0xF1, 0xA4})->at(3), static_cast<std::uint8_t>(Refusal::not_confirmed));
  }
}

TEST_F(CellServerTest, NothingOfTheOtherKindBeginsBeforeWhatIsCompleteWasStarted) {
  update::Link link(battery_);
  const auto accepted = [&](Bytes message) {
    const auto answer = link.request(message, 10'000);
    return answer && answer->at(0) == (message[0] | 0x40);
  };
  const std::string container = cell({});
  const auto bytes = static_cast<std::uint32_t>(container.size());
  Bytes download{0x34, 0x00, 0x44};
  for (const std::uint32_t number : {slot_begin(Kind::cell, 0), bytes}) {
    for (int shift = 24; shift >= 0; shift -= 8) download.push_back(static_cast<std::uint8_t>(number >> shift));
  }
  const auto send = [&] {
    EXPECT_TRUE(accepted({0x31, 0x01, 0xFF, 0x00, 2}) && accepted(download));
    for (std::uint32_t at = 0, sequence = 1; at < bytes; at += 1'000, ++sequence) {
      Bytes piece{0x36, static_cast<std::uint8_t>(sequence)};
      for (const char c : container.substr(at, 1'000)) piece.push_back(static_cast<std::uint8_t>(c));
      EXPECT_TRUE(accepted(piece));
    }
    EXPECT_TRUE(accepted({0x37}));
  };
  ASSERT_TRUE(accepted({0x10, 0x02}));
  send();
  EXPECT_TRUE(accepted({0x31, 0x01, 0xFF, 0x00, 1})) << "not yet complete";
  send();
  ASSERT_TRUE(accepted({0x31, 0x01, 0xFF, 0x01}));
  EXPECT_FALSE(accepted({0x31, 0x01, 0xFF, 0x00, 1}));
  EXPECT_EQ(link.request({0x22, 0xF1, 0xA4})->at(3), static_cast<std::uint8_t>(Refusal::not_confirmed));
  EXPECT_TRUE(read_marks(battery_.bench.cells(), 0).complete);
  battery_.start(false);
  ASSERT_TRUE(accepted({0x10, 0x02}));
  EXPECT_TRUE(accepted({0x31, 0x01, 0xFF, 0x00, 1})) << "started and confirmed";
}

TEST(CellHandover, OfALoaderWithoutCellsSaysNothing) {
  CellHandover h;
  EXPECT_FALSE(start_of(h));
  Start s;
  s.found = true;
  s.slot = 1;
  s.trial = true;
  s.header.version = 3;
  s.header.cell_hash = 4;
  s.header.security_version = 5;
  h = cell_handover_of(s, Battery{});
  const auto back = start_of(h);
  ASSERT_TRUE(back && back->found && back->trial && !back->returned);
  EXPECT_EQ(back->slot, 1);
  EXPECT_EQ(back->header.version, 3U);
  EXPECT_EQ(back->header.cell_hash, 4U);
  EXPECT_EQ(back->header.security_version, 5U);
  for (std::size_t k = 0; k < sizeof h; ++k) {
    CellHandover other = h;
    reinterpret_cast<unsigned char*>(&other)[k] ^= 1;
    EXPECT_FALSE(start_of(other)) << k;
  }
}

}  // namespace
}  // namespace bms::boot
