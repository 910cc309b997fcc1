// Any frames to ISO-TP and the update services, 10 bytes each: time, length, data. Whatever arrives, the running slot
// and the one-time words stay as they are, and no image becomes complete: the input cannot sign.
#include <algorithm>
#include <array>
#include <vector>

#include "boot/update_server.hpp"
#include "tests/fuzz/require.hpp"

namespace bms::boot {
namespace {

/// Slots in memory.
class Memory final : public SlotFlash {
 public:
  static constexpr std::uint32_t bytes = 8 * 1024;
  Memory() {
    for (auto& slot : slots) slot.assign(bytes, 0xFF);
  }
  std::uint32_t slot_bytes() const override { return bytes; }
  bool erase(std::uint8_t slot) override {
    require(slot == 1);
    slots[slot].assign(bytes, 0xFF);
    return true;
  }
  bool program(std::uint8_t slot, std::uint32_t at, std::uint32_t word) override {
    require(slot == 1 || at >= bytes - trailer_bytes);
    require(at % 4 == 0 && at + 4 <= bytes);
    for (std::size_t k = 0; k < 4; ++k) slots[slot][at + k] &= static_cast<std::uint8_t>(word >> 8 * k);
    return true;
  }
  void read(std::uint8_t slot, std::uint32_t at, std::span<std::uint8_t> into) override {
    require(at + into.size() <= bytes);
    std::copy_n(slots[slot].begin() + at, into.size(), into.begin());
  }
  std::uint32_t one_time(std::uint32_t) override { return ~0U; }
  bool program_one_time(std::uint32_t, std::uint32_t) override {
    require(false);
    return false;
  }
  std::array<std::vector<std::uint8_t>, 2> slots;
};

class Bench final : public UpdateSurroundings {
 public:
  explicit Bench(bool has_key) {
    started_.found = true;
    complete(memory_, 0);
    confirm(memory_, 0, 0);
    before_ = memory_.slots[0];
    if (has_key) key_ = authentication::Key{1, 2, 3};
    server_.emplace(memory_, battery_, started_, key_, *this);
    node_.emplace(*server_, *this);
  }
  void step(const std::uint8_t* data) {
    now_us_ += static_cast<std::uint64_t>(data[0]) * data[0] * 100;
    can::Frame frame{update_request_id, static_cast<std::uint8_t>(data[1] % 9), {}};
    std::copy_n(data + 2, 8, frame.data.begin());
    node_->receive(frame, now_us_);
    can::Frame answer;
    for (int k = 0; node_->next_frame(answer, now_us_); ++k) require(k < 200 && answer.length <= 8);
  }
  void check() {
    require(memory_.slots[0] == before_);
    require(!read_marks(memory_, 1).complete);
  }
  bool at_rest() override { return now_us_ % 3 != 0; }
  std::uint64_t challenge() override { return ++challenge_; }
  void restart() override { restarted_ = true; }

 private:
  Memory memory_;
  std::array<TrustedKey, 1> keys_{};
  Battery battery_{"b", keys_, 0, 0, Memory::bytes - trailer_bytes, true, Kind::application};
  Start started_;
  std::optional<authentication::Key> key_;
  std::optional<UpdateServer> server_;
  std::optional<UpdateNode> node_;
  std::vector<std::uint8_t> before_;
  std::uint64_t now_us_ = 1, challenge_ = 7;
  bool restarted_ = false;
};

}  // namespace
}  // namespace bms::boot

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  bms::boot::Bench bench(size % 2 == 1);
  for (; size >= 10; data += 10, size -= 10) bench.step(data);
  bench.check();
  return 0;
}
