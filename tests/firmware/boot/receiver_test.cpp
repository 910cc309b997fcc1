// What is refused, each for its own reason, with nothing changed in the running slot.
#include "tests/firmware/boot/bench.hpp"

namespace bms::boot {
namespace {

class ReceiverTest : public ::testing::Test {
 protected:
  void SetUp() override {
    bench_.produce({.version = 0x000200, .security_version = 5, .seed = 7});
    before_ = bench_.flash().bytes(0);
  }
  /// Transfers it to slot B while slot A runs, and resets.
  Refusal offer(const std::string& container) {
    const Refusal refusal = bench_.transfer(container, 0);
    EXPECT_EQ(bench_.flash().bytes(0), before_) << "the running slot has changed";
    if (refusal != Refusal::none) {
      const Start start = bench_.reset();
      EXPECT_TRUE(start.found);
      EXPECT_EQ(start.slot, 0);
      EXPECT_FALSE(start.trial);
    }
    return refusal;
  }
  /// A word of the target that a refused transfer has written, besides the mark of the erased slot.
  bool target_erased() {
    auto bytes = bench_.flash().bytes(1);
    bytes.resize(bytes.size() - trailer_bytes);
    return std::ranges::all_of(bytes, [](std::uint8_t b) { return b == 0xFF; });
  }
  static ImageWish update() { return {.slot = 1, .version = 0x000300, .security_version = 5, .seed = 8}; }

  Bench bench_;
  std::vector<std::uint8_t> before_;
};

TEST_F(ReceiverTest, AcceptsAnImageOfTheProductKeyAndStartsItOnTrial) {
  EXPECT_EQ(offer(image(update())), Refusal::none);
  const Start start = bench_.reset();
  EXPECT_TRUE(start.found && start.trial);
  EXPECT_EQ(start.slot, 1);
  EXPECT_EQ(start.header.version, 0x000300U);
}

TEST_F(ReceiverTest, AfterAnImageOfAnyLengthTheLastWordStaysErased) {
  for (const std::uint32_t bytes : {8'997U, 8'998U, 8'999U}) {
    Bench bench;
    bench.produce({.version = 0x000200, .security_version = 5, .seed = 7});
    ImageWish wish = update();
    wish.bytes = bytes;
    const std::string container = image(wish);
    ASSERT_EQ(bench.transfer(container, 0), Refusal::none);
    const auto slot = bench.flash().bytes(1);
    EXPECT_TRUE(std::equal(container.begin(), container.end(), slot.begin(),
                           [](char sent, std::uint8_t stored) { return static_cast<std::uint8_t>(sent) == stored; }));
    for (std::size_t at = container.size(); at < container.size() + 8; ++at) EXPECT_EQ(slot[at], 0xFF) << bytes;
  }
}

TEST_F(ReceiverTest, AcceptsAnImageOfTheSecondKey) {
  auto wish = update();
  wish.key = "next";
  EXPECT_EQ(offer(image(wish)), Refusal::none);
}

TEST_F(ReceiverTest, RefusesEachBadHeaderForItsOwnReasonBeforeAWordIsWritten) {
  const auto with = [](auto change) {
    auto wish = update();
    change(wish);
    return image(wish);
  };
  std::string forged = image(update());
  forged[12] = 9;  // another version under the old signature
  std::string bad_signature = image(update());
  bad_signature[2'000] = static_cast<char>(bad_signature[2'000] ^ 1);
  std::string no_header = image(update());
  no_header[0] = 'X';
  const struct {
    const char* what;
    std::string container;
    Refusal expected;
  } cases[] = {
      {"a field changed", forged, Refusal::bad_signature},
      {"a bit of the signature", bad_signature, Refusal::bad_signature},
      {"another key", with([](auto& w) { w.key = "somebody"; }), Refusal::unknown_key},
      {"a revoked key", with([](auto& w) { w.key = "revoked"; }), Refusal::revoked_key},
      {"another board", with([](auto& w) { w.board = "boarD"; }), Refusal::other_board},
      {"older", with([](auto& w) { w.security_version = 4; }), Refusal::older_security},
      {"linked for the running slot", with([](auto& w) { w.slot = 0; }), Refusal::other_slot},
      {"newer loader", with([](auto& w) { w.oldest_loader = 0x000101; }), Refusal::newer_loader_needed},
      {"development image", with([](auto& w) { w.development = true; }), Refusal::development_image},
      {"development key", with([](auto& w) { w.key = "development"; }), Refusal::development_image},
      {"the image that runs", image({.slot = 1, .security_version = 5, .seed = 7}), Refusal::none},
      {"cell constants in the slot of code", with([](auto& w) { w.kind = Kind::cell; }), Refusal::other_kind},
      {"larger than the slot", with([](auto& w) { w.bytes = 14'000; }), Refusal::too_large},
      {"no container", no_header, Refusal::not_a_header},
  };
  for (const auto& c : cases) {
    if (c.expected == Refusal::none) continue;
    EXPECT_EQ(offer(c.container), c.expected) << c.what << ", but: " << words_for(offer(c.container));
    EXPECT_TRUE(target_erased()) << c.what;
  }
}

/// A leaked development key makes no product's image, not even for a battery that runs development images.
/// The loader reads the header of a slot again at each start, so its length must not reach beyond the slot.
TEST_F(ReceiverTest, AHeaderThatReachesBeyondTheSlotIsTooLargeWhoeverSignedIt) {
  Header header = payload_of(update()).header;
  header.payload_bytes = bench_.battery().slot_bytes - header_bytes;
  EXPECT_EQ(check_fields(header, bench_.battery(), 1), Refusal::none);
  ++header.payload_bytes;
  EXPECT_EQ(check_fields(header, bench_.battery(), 1), Refusal::too_large);
}

TEST_F(ReceiverTest, OfADevelopmentKeyOnlyDevelopmentImagesAreAccepted) {
  bench_.battery().product = false;
  auto wish = update();
  wish.key = "development";
  EXPECT_EQ(offer(image(wish)), Refusal::development_image);
  wish.development = true;
  EXPECT_EQ(offer(image(wish)), Refusal::none);
}

TEST_F(ReceiverTest, RefusesTheReleaseThatRunsAlready) {
  // one file, linked for both slots
  const auto both = sign({payload_of({.slot = 0, .security_version = 6, .seed = 3}),
                          payload_of({.slot = 1, .security_version = 6, .seed = 3})},
                         key_of("product"));
  EXPECT_EQ(offer(both[1].bytes), Refusal::none);
  EXPECT_EQ(bench_.reset().slot, 1);
  ASSERT_TRUE(confirm(bench_.slots(), 1, 6));
  EXPECT_EQ(bench_.reset().slot, 1);
  EXPECT_EQ(bench_.transfer(both[0].bytes, 1), Refusal::already_running);
}

TEST_F(ReceiverTest, RefusesAWrongBlockBeforeItIsWritten) {
  std::string damaged = image(update());
  damaged[header_bytes + block_bytes + 17] ^= 4;  // of the second block
  EXPECT_EQ(offer(damaged), Refusal::block_damaged);
  const auto target = bench_.flash().bytes(1);
  EXPECT_EQ(target[header_bytes + block_bytes], 0xFF);
  EXPECT_NE(target[header_bytes], 0xFF) << "the first block was right";
}

TEST_F(ReceiverTest, RefusesATruncatedTransferAtItsEnd) {
  const std::string all = image(update());
  Receiver receiver(bench_.slots(), bench_.battery(), 0);
  ASSERT_EQ(receiver.prepare(), Refusal::none);
  ASSERT_EQ(receiver.begin(static_cast<std::uint32_t>(all.size())), Refusal::none);
  ASSERT_EQ(receiver.take(bytes_of(all).first(all.size() - 1)), Refusal::none);
  EXPECT_EQ(receiver.finish(), Refusal::incomplete);
  EXPECT_EQ(bench_.reset().slot, 0);
  // announced shorter than it is
  EXPECT_EQ(offer(all.substr(0, all.size() - 1)), Refusal::incomplete);
}

TEST_F(ReceiverTest, RefusesASecondTransferIntoASlotThatIsNotErased) {
  ASSERT_EQ(offer(image(update())), Refusal::none);
  Receiver receiver(bench_.slots(), bench_.battery(), 0);
  EXPECT_EQ(receiver.begin(5'000), Refusal::not_erased);
}

TEST_F(ReceiverTest, ResumesTheTransferOfTheSameContainerOnly) {
  const std::string all = image(update());
  Receiver receiver(bench_.slots(), bench_.battery(), 0);
  ASSERT_EQ(receiver.prepare(), Refusal::none);
  ASSERT_EQ(receiver.begin(static_cast<std::uint32_t>(all.size())), Refusal::none);
  ASSERT_EQ(receiver.take(bytes_of(all).first(5'000)), Refusal::none);
  const Digest digest = sha256(bytes_of(all).first(header_bytes));
  EXPECT_EQ(receiver.resume(sha256(bytes_of(all).first(9))), 0U);
  const std::uint32_t at = receiver.resume(digest);
  ASSERT_EQ(at, 5'000U);
  ASSERT_EQ(receiver.take(bytes_of(all).subspan(at)), Refusal::none);
  EXPECT_EQ(receiver.finish(), Refusal::none);
  EXPECT_EQ(bench_.reset().slot, 1);
}

TEST_F(ReceiverTest, NeverWritesTheRunningSlot) {
  for (const std::uint8_t running : {std::uint8_t{0}, std::uint8_t{1}}) {
    Receiver receiver(bench_.slots(), bench_.battery(), running);
    EXPECT_EQ(receiver.target(), 1 - running);
  }
}

/// Every single bit of the signed header and of the payload counts.
TEST_F(ReceiverTest, RefusesEachFlippedBitOfHeaderAndBlocks) {
  const std::string all = image(update());
  std::mt19937 random(4);
  for (int k = 0; k < 60; ++k) {
    std::string flipped = all;
    const std::size_t at = k < 40 ? random() % header_bytes : random() % all.size();
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << random() % 8));
    EXPECT_NE(offer(flipped), Refusal::none) << "byte " << at;
  }
}

TEST(Battery, WithoutAStatedLoaderOrCounterAcceptsWhatNeedsNone) {
  Bench bench;
  Battery battery = bench.battery();
  battery.loader_version = Battery{}.loader_version;
  battery.security_counter = Battery{}.security_counter;
  Header header;
  const auto check = [&](const ImageWish& w) {
    return check_header(bytes_of(image(w)).first<header_bytes>(), battery, 1, header);
  };
  EXPECT_EQ(check({.slot = 1, .security_version = 0}), Refusal::none);
  EXPECT_EQ(check({.slot = 1, .security_version = 0, .oldest_loader = 1}), Refusal::newer_loader_needed);
}

}  // namespace
}  // namespace bms::boot
