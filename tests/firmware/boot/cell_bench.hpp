// The battery of bench.hpp with slots of cell constants. Its application accepts constants whose first byte is not 'X'.
#pragma once

#include "boot/handover.hpp"
#include "tests/firmware/boot/bench.hpp"

namespace bms::boot {

inline constexpr std::uint32_t hash_of_build = 0x1111'1111;

inline Refusal not_x(std::span<const std::uint8_t> payload) {
  return payload[0] == 'X' ? Refusal::other_limits : Refusal::none;
}

struct CellWish {
  std::uint8_t slot = 0;
  std::uint32_t security_version = 1, cell_hash = 0x2222'2222, built_for = hash_of_build, bytes = 900, seed = 1;
  std::string board = "board", key = "product", begin = "C";
  std::uint32_t oldest_loader = 0;
};

inline update::Payload cell_payload_of(const CellWish& w) {
  update::Payload p = payload_of(ImageWish{.slot = w.slot,
                                           .version = 0x010000,
                                           .security_version = w.security_version,
                                           .bytes = w.bytes,
                                           .seed = w.seed,
                                           .board = w.board,
                                           .oldest_loader = w.oldest_loader,
                                           .kind = Kind::cell});
  p.header.cell_hash = w.cell_hash;
  p.header.built_for_cell_hash = w.built_for;
  p.bytes.replace(0, w.begin.size(), w.begin);
  return p;
}
inline std::string cell(const CellWish& w) { return sign({cell_payload_of(w)}, key_of(w.key)).front().bytes; }

class CellBench : public Bench {
 public:
  explicit CellBench(std::uint64_t seed = 1) : Bench(seed), cell_flash_({3, sector_bytes}, seed), cells_(cell_flash_) {}

  FlashModel& cell_flash() { return cell_flash_; }
  SlotFlash& cells() { return cells_; }
  const Battery& cell_battery(std::uint32_t built_with = hash_of_build) {
    cell_battery_ = for_cells(battery(), cells_, built_with);
    cell_battery_.content = not_x;
    return cell_battery_;
  }
  /// What the loader decides; application: on trial or not.
  Start reset_cell(bool power_on = false, bool application_on_trial = false, std::uint32_t built_with = hash_of_build) {
    Start application;
    application.found = true;
    application.trial = application_on_trial;
    return choose_cell(cells_, cell_battery(built_with), application, power_on);
  }
  Refusal transfer_cell(const std::string& container, std::uint8_t running = 2) {
    Receiver receiver(cells_, cell_battery(), running);
    if (const Refusal r = receiver.prepare(); r != Refusal::none) return r;
    if (const Refusal r = receiver.begin(static_cast<std::uint32_t>(container.size())); r != Refusal::none) return r;
    if (const Refusal r = receiver.take(bytes_of(container)); r != Refusal::none) return r;
    return receiver.finish();
  }
  /// Confirmed constants in slot A.
  void install(const CellWish& w = {}) {
    ASSERT_EQ(transfer_cell(cell(w)), Refusal::none);
    ASSERT_TRUE(reset_cell(true).trial);
    ASSERT_TRUE(confirm(cells_, 0, w.security_version));
    ASSERT_FALSE(reset_cell(true).trial);
  }

 private:
  FlashModel cell_flash_;
  ModelSlots cells_;
  Battery cell_battery_;
};

}  // namespace bms::boot
