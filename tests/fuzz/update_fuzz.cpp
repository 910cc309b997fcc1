// Any frames to ISO-TP and the update services, 10 bytes each: time, length, data. Some lengths stand for a step of a
// tool that sends an image properly, but for one byte; so the input also comes behind header and hashes. Whatever
// arrives, the running slot and the one-time words stay as they are. No image becomes complete where the signature is
// checked, for the input cannot sign; where the loader does that later, only what has the hashes of its header does.
#include <algorithm>
#include <array>
#include <vector>

#include "boot/flash_map.hpp"
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

/// Two blocks for slot B of the board below, with the signature 0.
std::vector<std::uint8_t> unsigned_image(const TrustedKey& key) {
  std::vector<std::uint8_t> bytes(header_bytes + 5'000);
  for (std::size_t k = header_bytes; k < bytes.size(); ++k) bytes[k] = static_cast<std::uint8_t>(k * 7);
  Header header;
  header.slot = 1;
  header.payload_bytes = 5'000;
  header.board[0] = 'b';
  header.key = key_id(key.point);
  std::vector<Digest> hashes;
  for (std::uint32_t k = 0; k < header.blocks(); ++k)
    hashes.push_back(sha256(std::span(bytes).subspan(header_bytes + k * block_bytes, header.block_size(k))));
  HeaderBytes room{};
  write_header(header, hashes, room);
  std::ranges::copy(room, bytes.begin());
  return bytes;
}

class Bench final : public UpdateSurroundings {
 public:
  Bench(bool has_key, bool loader_checks_later) : loader_checks_later_(loader_checks_later) {
    started_.found = true;
    complete(memory_, 0);
    confirm(memory_, 0, 0);
    before_ = memory_.slots[0];
    if (has_key) key_ = authentication::Key{1, 2, 3};
    server_.emplace(memory_, battery_, started_, key_, *this,
                    loader_checks_later ? check_fields_and_key : check_header);
    node_.emplace(*server_, *this);
  }
  void step(const std::uint8_t* data) {
    now_us_ += static_cast<std::uint64_t>(data[0]) * data[0] * 100;
    if (data[1] >= 0xC0) return tool(data[1] % 8, data + 2);
    can::Frame frame{update_request_id, static_cast<std::uint8_t>(data[1] % 9), {}};
    std::copy_n(data + 2, 8, frame.data.begin());
    node_->receive(frame, now_us_);
    can::Frame answer;
    for (int k = 0; node_->next_frame(answer, now_us_); ++k) require(k < 200 && answer.length <= 8);
  }
  void check() {
    require(memory_.slots[0] == before_);
    if (!read_marks(memory_, 1).complete) return;
    Header header;
    require(loader_checks_later_ && check_slot(memory_, battery_, 1, header, check_fields_and_key) == Refusal::none);
    require(check_slot(memory_, battery_, 1, header, check_header) == Refusal::bad_signature);
  }
  bool at_rest() override { return now_us_ % 3 != 0; }
  std::uint64_t challenge() override { return ++challenge_; }
  void restart() override { restarted_ = true; }

 private:
  /// One step of a tool. For a piece of the image: which byte is changed (2), how (1), size (1).
  void tool(int which, const std::uint8_t* data) {
    const std::uint32_t received = server_->receiver().active() ? server_->receiver().received() : 0;
    std::vector<std::uint8_t> request;
    const auto put = [&](std::uint32_t value) {
      for (int shift = 24; shift >= 0; shift -= 8) request.push_back(static_cast<std::uint8_t>(value >> shift));
    };
    switch (which) {
      case 0:
        request = {0x10, 2};
        break;
      case 1:
        request = {0x31, 1, 0xFF, 0};
        break;
      case 2:
        request = {0x34, 0, 0x44};
        put(application_slots[1] + received);
        put(static_cast<std::uint32_t>(image_.size()));
        sequence_ = 0;
        break;
      case 3: {
        if (received >= image_.size()) return;
        request = {0x36, ++sequence_};
        const auto bytes = std::min<std::size_t>(image_.size() - received, 1'024U - data[3]);
        request.insert(request.end(), image_.begin() + received, image_.begin() + received + static_cast<long>(bytes));
        const std::size_t changed = static_cast<std::size_t>(data[0] | data[1] << 8) % 4'096;
        if (changed < bytes) request[2 + changed] ^= data[2];
        break;
      }
      case 4:
        request = {0x37};
        break;
      case 5:
        request = {0x31, 1, 0xFF, 1};
        break;
      case 6: {
        request = {0x31, 1, 2, 3};
        for (const std::uint8_t byte : sha256(std::span(image_).first(header_bytes))) request.push_back(byte);
        break;
      }
      default:
        request = {0x11, 1};
    }
    exchange(request);
  }
  void exchange(const std::vector<std::uint8_t>& request) {
    IsoTp client(update_request_id, update_response_id);
    client.send(request);
    can::Frame frame;
    for (int k = 0; k < 400; ++k) {
      bool any = false;
      while (client.next_frame(frame, now_us_)) {
        node_->receive(frame, now_us_);
        any = true;
      }
      while (node_->next_frame(frame, now_us_)) {
        require(frame.length <= 8);
        client.receive(frame, now_us_);
        client.taken();
        any = true;
      }
      if (!any) return;
    }
    require(false);
  }

  Memory memory_;
  const bool loader_checks_later_;
  std::array<TrustedKey, 1> keys_{};
  const std::vector<std::uint8_t> image_ = unsigned_image(keys_[0]);
  std::uint8_t sequence_ = 0;
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
  bms::boot::Bench bench(size % 2 == 1, size % 4 >= 2);
  for (; size >= 10; data += 10, size -= 10) bench.step(data);
  bench.check();
  return 0;
}
