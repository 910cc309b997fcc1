// What the emulated forklift board refuses: loader and running image are the real ones, the tool's side is that of bms
// update, but it sends whatever it is given. Each has its own reason, and what runs and what is stored stay.
#include <gmock/gmock.h>

#include "can/generated/can_messages.hpp"
#include "tests/firmware/boot/board_bus.hpp"
#include "tests/firmware/boot/stored_years.hpp"
#include "update/update_run.hpp"

namespace bms::boot {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::uint32_t key_memory = 0x1FFF'7800, counter_memory = 0x1FFF'7820, after_power = 7U << 25;
constexpr authentication::Key pack_key{9, 8, 7, 6, 5, 4, 3, 2, 1, 0, 1, 2, 3, 4, 5, 6};
/// zlib.crc32(bytes([9, 8, 7, 6, 5, 4, 3, 2, 1, 0, 1, 2, 3, 4, 5, 6])).to_bytes(4, "little") of Python
constexpr std::array<std::uint8_t, 4> pack_key_crc{0x1F, 0xBD, 0x44, 0x2A};

update::Payload payload(std::uint8_t slot, std::uint32_t version) {
  update::Payload p = update::read_linked_image(image_in(slot));
  std::ranges::copy(std::string("stm32f405_forklift"), p.header.board.begin());
  p.header.version = version;
  p.header.security_version = 1;
  return p;
}

/// The release that runs, for both slots.
const std::vector<update::Container>& running_release() {
  static const auto both = sign({payload(0, 0x000200), payload(1, 0x000200)}, key_of("product"));
  return both;
}

/// The next release for slot B; `change` before it is signed.
update::Container next(const std::function<void(update::Payload&)>& change, const std::string& key = "product") {
  update::Payload p = payload(1, 0x000300);
  change(p);
  return sign({p}, key_of(key)).front();
}
void as_it_is(update::Payload&) {}
/// The next release; `change` what was signed.
update::Container changed(const std::function<void(std::string&)>& change) {
  update::Container c = next(as_it_is);
  change(c.bytes);
  return c;
}

/// The bus, and what the tool has sent.
class RecordedBus final : public monitor::FrameSource {
 public:
  explicit RecordedBus(BoardBus& bus) : bus_(bus) {}
  std::size_t read(std::span<monitor::BusFrame> room, int wait_ms) override { return bus_.read(room, wait_ms); }
  bool ended() const override { return bus_.ended(); }
  bool live() const override { return true; }
  bool send(const can::Frame& frame) override {
    sent.push_back(frame);
    return bus_.send(frame);
  }
  std::vector<can::Frame> sent;

 private:
  BoardBus& bus_;
};

class RefusalsOfTheBoard : public ::testing::Test {
 protected:
  /// Slot A runs and the counter is 1.
  void start_battery(bool with_key) {
    battery_.board.longest_sleep_us = 500;
    battery_.board.flash.bytes = years_of_use();
    if (with_key) {
      std::vector<std::uint8_t> key(pack_key.begin(), pack_key.end());
      key.insert(key.end(), pack_key_crc.begin(), pack_key_crc.end());
      battery_.board.write_flash(key_memory, key);
      wish_.device_key = pack_key;
    }
    wish_.start_wait_s = wish_.restart_wait_s = wish_.sample_wait_s = 300;  // the board may be slower than the clock
    bus_.pass(1'500);
    ASSERT_EQ(battery_.running(), 0);
    counter_ = battery_.board.read_flash(counter_memory, 32);
    ASSERT_EQ(counter_[0], 0xFE);
    charges_.before = charge_in(battery_.board.flash.bytes);
  }
  std::vector<std::uint8_t> slot(std::uint8_t which, std::size_t bytes) {
    return battery_.board.read_flash(application_slots[which], bytes);
  }
  void expect_unchanged(const std::string& what) {
    EXPECT_EQ(battery_.running(), 0) << what;
    const std::string& runs = running_release()[0].bytes;
    EXPECT_TRUE(std::ranges::equal(slot(0, runs.size()), bytes_of(runs))) << what;
    EXPECT_EQ(battery_.board.read_flash(counter_memory, 32), counter_) << what;
    charges_.after = charge_in(battery_.board.flash.bytes);
    EXPECT_GE(charges_.after.operating_s, charges_.before.operating_s) << what;
    expect_nothing_lost(battery_.board.flash.bytes, charges_, what);
  }
  bool free_slot_is_erased() {
    return std::ranges::all_of(slot(1, application_slot_bytes - trailer_bytes), [](auto b) { return b == 0xFF; });
  }
  update::UpdateResult offer(const update::Container& container) {
    wish_.containers = {container};
    tool_.sent.clear();
    return run_update(tool_, wish_);
  }
  /// Frames that opened a session once open none, and so they change nothing.
  void replay(const std::vector<can::Frame>& sent) {
    const auto before = slot(1, application_slot_bytes);
    const std::size_t answers = battery_.board.can.seen.size();
    for (const can::Frame& frame : sent) {
      bus_.send(frame);
      bus_.pass(3);
    }
    std::size_t wrong_keys = 0, denied = 0;
    for (std::size_t k = answers; k < battery_.board.can.seen.size(); ++k) {
      const auto& f = battery_.board.can.seen[k];
      if (!f.from_board || f.frame.id != update_response_id || f.frame.data[1] != 0x7F) continue;
      wrong_keys += f.frame.data[2] == 0x27 && (f.frame.data[3] == 0x35 || f.frame.data[3] == 0x36);
      denied += f.frame.data[2] != 0x27 && f.frame.data[3] == 0x33;
    }
    EXPECT_GT(wrong_keys, 0U);
    EXPECT_GT(denied, 0U);
    expect_unchanged("a replayed transfer");
    EXPECT_TRUE(slot(1, application_slot_bytes) == before);
  }
  void restart_by_power() {
    battery_.board.reset(after_power);
    ASSERT_TRUE(battery_.board.run_until([&] { return battery_.running() != 2; }, 6'000));
    bus_.pass(1'500);
  }

  LoaderBoard battery_{1, running_release()[0].bytes};
  BoardBus bus_{battery_.board};
  RecordedBus tool_{bus_};
  update::UpdateWish wish_;
  std::vector<std::uint8_t> counter_;
  Charges charges_;
};

TEST_F(RefusalsOfTheBoard, EachHasItsOwnReasonAndChangesNothing) {
  start_battery(true);
  auto other_slot = sign({payload(0, 0x000300)}, key_of("product")).front();
  other_slot.header.slot = 1;  // the tool takes it for that of slot B
  auto other_board = next([](auto& p) { p.header.board.fill('\0'), p.header.board[0] = 'x'; });
  std::ranges::copy(std::string("stm32f405_forklift"), other_board.header.board.begin());
  const struct {
    const char* what;
    update::Container container;
    Refusal expected;
  } headers[] = {
      {"larger than the slot", changed([](auto& bytes) { bytes.resize(application_slot_bytes - trailer_bytes + 4); }),
       Refusal::too_large},
      {"other key", next(as_it_is, "somebody"), Refusal::unknown_key},
      {"other board", other_board, Refusal::other_board},
      {"older", next([](auto& p) { p.header.security_version = 0; }), Refusal::older_security},
      {"truncated", changed([](auto& bytes) { bytes.resize(bytes.size() - 1); }), Refusal::incomplete},
      {"swapped slots", other_slot, Refusal::other_slot},
      {"the release that runs", running_release()[1], Refusal::already_running},
  };
  std::set<std::string> reasons;
  for (const auto& c : headers) {
    const auto result = offer(c.container);
    EXPECT_EQ(result.outcome, update::UpdateResult::Outcome::refused) << c.what;
    EXPECT_EQ(result.reason, words_for(c.expected)) << c.what;
    EXPECT_TRUE(reasons.insert(result.reason).second) << c.what;
    expect_unchanged(c.what);
    EXPECT_TRUE(free_slot_is_erased()) << c.what;
  }
  const std::vector<can::Frame> recorded = tool_.sent;

  const auto wrong_block = offer(changed([](auto& bytes) { bytes[header_bytes + 2 * block_bytes + 9] ^= 1; }));
  EXPECT_EQ(wrong_block.reason, words_for(Refusal::block_damaged));
  expect_unchanged("wrong hash of a block");
  EXPECT_EQ(slot(1, header_bytes + 2 * block_bytes + 4).back(), 0xFF) << "the block was not written";
  restart_by_power();
  expect_unchanged("after a restart");

  const auto bad_signature = offer(changed([](auto& bytes) { bytes[header_bytes - 1] ^= 1; }));
  EXPECT_EQ(bad_signature.outcome, update::UpdateResult::Outcome::returned);
  EXPECT_THAT(bad_signature.reason, HasSubstr(std::string(words_for(Refusal::bad_signature))));
  expect_unchanged("bad signature");
  EXPECT_EQ(battery_.marks(1).trials, 0U) << "it was not started";
  restart_by_power();
  expect_unchanged("after another restart");
  replay(recorded);
  EXPECT_THAT(battery_.board.flash.violations, IsEmpty());
}

TEST_F(RefusalsOfTheBoard, ATransferInDriveIsRefused) {
  start_battery(false);
  can::Command drive;
  drive.code = can::Command::code_request;
  drive.argument = 1;
  bus_.send(drive.frame(1));
  bus_.pass(300);
  const auto before = slot(1, application_slot_bytes);
  const auto result = offer(next(as_it_is));
  EXPECT_EQ(result.outcome, update::UpdateResult::Outcome::refused);
  EXPECT_EQ(result.reason, words_for(Refusal::not_at_rest));
  expect_unchanged("in drive");
  EXPECT_TRUE(slot(1, application_slot_bytes) == before);
  EXPECT_THAT(battery_.board.resets, IsEmpty());
}

}  // namespace
}  // namespace bms::boot
