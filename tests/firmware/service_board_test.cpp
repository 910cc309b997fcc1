// Who may command the flashed image: a device key in the one-time memory of the chip, the client of `bms service` and a
// truck on the bus. The product's image differs from the one for development in one function.
#include <algorithm>
#include <array>
#include <span>

#include "monitor/service_client.hpp"
#include "tests/firmware/bxcan_board.hpp"
#include "tests/firmware/service_fixture.hpp"

namespace bms::firmware {
namespace {

using monitor::ServiceClient;
using State = ServiceClient::State;

constexpr authentication::Key own_key{0x10, 0x32, 0x54, 0x76, 0x98, 0xBA, 0xDC, 0xFE,
                                      0x0F, 0x1E, 0x2D, 0x3C, 0x4B, 0x5A, 0x69, 0x78};

/// Contents of block 0 as boards/stm32f405_forklift/README.md states them: the key and its CRC-32. The two sums are
/// from Python's zlib.crc32.
std::vector<std::uint8_t> block_of(const authentication::Key& key, std::uint32_t crc) {
  std::vector<std::uint8_t> block(key.begin(), key.end());
  for (int k = 0; k < 4; ++k) block.push_back(static_cast<std::uint8_t>(crc >> 8 * k));
  return block;
}
const std::vector<std::uint8_t> own_block = block_of(own_key, 0x7018'CC94),
                                block_for_development = block_of(authentication::development_key, 0x13F8'7E69);

/// A board on the bus with a sample every 100 ms, at rest and without a voltage on the DC link.
class Bench {
 public:
  Bench(const std::filesystem::path& of, std::span<const std::uint8_t> one_time_memory, std::uint32_t seed = 1)
      : board_(of, seed) {
    board_.flash.bytes = started_once();
    board_.write_one_time_memory(one_time_memory);
    run_until_it_listens(board_);
    for (int k = 0; k < 3; ++k) sample();
  }
  ~Bench() {
    EXPECT_THAT(board_.can.violations, IsEmpty());
    EXPECT_THAT(board_.flash.violations, IsEmpty());
  }
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;

  /// Passes 100 ms in which the frames and then a sample are sent. host_hal::sent holds what the board has sent so far.
  void sample(const std::vector<can::Frame>& frames = {}) {
    for (const can::Frame& f : frames) board_.can.others.push_back({wire_frame(f), board_.can.now_bit, true});
    Pack pack;
    pack.time_us = 100'000 * ++samples_;
    pack.current_ua = 0;
    for (std::size_t k = 0; k < Pack::cells; ++k)
      pack.cell_uv[k] = 3'280'000 + static_cast<std::int32_t>(10 * k + samples_ % 3);
    pack.pack_uv = static_cast<std::int32_t>(Pack::cells) * 3'280'075;
    pack.temperature_cdegc.fill(2'500);
    for (const can::Frame& f : hal::frames_of(pack, 0, static_cast<std::uint16_t>(samples_), 0))
      board_.can.others.push_back({wire_frame(f), board_.can.now_bit, true});
    board_.run_for_ms(100);
    host_hal::sent.clear();
    for (const SeenFrame& s : board_.can.seen) {
      if (s.from_board) host_hal::sent.push_back(s.frame);
    }
  }

  /// `bms service`: one command in a session of its own.
  State serve(const authentication::Key& key, std::uint32_t code, std::uint32_t argument) {
    ServiceClient client(key, 42, code, argument);
    std::size_t received = board_.can.seen.size();
    while (client.state() == State::working) {
      sample(client.due(1e-3 * board_.now_ms()));
      for (; received < board_.can.seen.size(); ++received) {
        const SeenFrame& s = board_.can.seen[received];
        if (s.from_board) client.receive(s.frame, 1e-3 * board_.now_ms());
      }
    }
    sample();
    return client.state();
  }

  /// Requests power for a second. Returns true if the board has left *off*: it tests its contactors first.
  template <class Request>
  bool follows(Request&& request) {
    const std::size_t before = host_hal::sent.size();
    for (int k = 0; k < 10; ++k) sample(k % 5 == 0 ? std::vector{request(k)} : std::vector<can::Frame>{});
    const std::span<const can::Frame> now = std::span(host_hal::sent).subspan(before);
    return std::any_of(now.begin(), now.end(), [](const can::Frame& f) {
      return f.id == can::ContactorState::id && can::ContactorState::of(f).state != can::ContactorState::state_off;
    });
  }
  bool follows_plain_requests() {
    return follows([](int k) {
      can::Command c;
      c.code = can::Command::code_request;
      c.argument = 1;
      return c.frame(static_cast<std::uint8_t>(k % can::counters));
    });
  }
  std::uint32_t requests() const {
    const auto m = last<can::RequestChallenge>();
    return m ? m->state : 99;
  }

 private:
  UnicornBoard board_;
  std::uint64_t samples_ = 0;
};

TEST(ServiceBoard, WithAKeyServesAndDrivesOnlyForItsHoldersAlsoInAnImageForDevelopment) {
  std::vector<can::Frame> recorded;
  {
    Bench bench(image(), own_block);
    EXPECT_EQ(bench.requests(), can::RequestChallenge::state_drive_request);
    EXPECT_FALSE(bench.follows_plain_requests());
    EXPECT_EQ(last<can::CommandAnswer>()->result, can::CommandAnswer::result_not_authorised);
    KeyHolder stranger(authentication::development_key), truck(own_key);
    EXPECT_FALSE(bench.follows([&](int) { return stranger.drive(); }));
    EXPECT_EQ(bench.serve(authentication::development_key, can::Command::code_clear_faults, 1), State::wrong_key);
    EXPECT_EQ(bench.serve(own_key, can::Command::code_clear_faults, 1), State::done);
    EXPECT_TRUE(bench.follows([&](int) {
      recorded.push_back(truck.drive());
      return recorded.back();
    }));
  }
  Bench bench(image(), own_block, 2);  // another random number after the next start
  EXPECT_FALSE(bench.follows([&](int k) { return recorded[static_cast<std::size_t>(k / 5)]; }));
}

TEST(ServiceBoard, AnImageForAProductFollowsNobodyWithoutAKeyOfItsOwn) {
  const auto product = images::firmware_image("stm32f405_forklift", table9(), images::Image::remote_product);
  auto torn = own_block;  // the supply failed while the key was written
  torn[7] = 0xFF;
  for (const auto& block : {std::vector<std::uint8_t>{}, block_for_development, torn}) {
    Bench bench(product, block);
    EXPECT_EQ(bench.requests(), can::RequestChallenge::state_no_key);
    KeyHolder truck(authentication::development_key);
    EXPECT_FALSE(bench.follows_plain_requests());
    EXPECT_FALSE(bench.follows([&](int) { return truck.drive(); }));
    EXPECT_EQ(bench.serve(authentication::development_key, can::Command::code_clear_faults, 1), State::no_key);
  }
  Bench bench(product, own_block);
  EXPECT_EQ(bench.requests(), can::RequestChallenge::state_drive_request);
  EXPECT_EQ(bench.serve(own_key, can::Command::code_clear_faults, 1), State::done);
  KeyHolder truck(own_key);
  EXPECT_TRUE(bench.follows([&](int) { return truck.drive(); }));
}

TEST(ServiceBoard, AnImageForDevelopmentFollowsEverybodyWithoutAKey) {
  Bench bench(image(), {});
  EXPECT_EQ(bench.requests(), 99U) << "no RequestChallenge: no test of a line passes such an image";
  EXPECT_TRUE(bench.follows_plain_requests());
}

}  // namespace
}  // namespace bms::firmware
