// Any bytes in flash, then any sequence of operations. Nothing crashes or loops, no word is programmed twice in sectors
// that the log erased, and a stored record is found again.
//
//   input   3 sectors, each a byte that selects how it is filled, then its records or raw bytes; then the operations
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "hal/watchdog.hpp"
#include "storage/persistence.hpp"
#include "tests/firmware/storage/flash_model.hpp"
#include "tests/firmware/storage/record_bytes.hpp"
#include "tests/fuzz/require.hpp"

namespace bms::hal {
void watchdog_feed() {}
}  // namespace bms::hal

namespace {

using namespace bms;

class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  std::uint8_t byte() { return at_ < size_ ? data_[at_++] : 0; }
  std::uint32_t word() {
    std::uint32_t value = 0;
    for (int k = 0; k < 4; ++k) value = value << 8 | byte();
    return value;
  }
  std::vector<std::uint8_t> bytes(std::size_t n) {
    std::vector<std::uint8_t> all(n);
    for (auto& b : all) b = byte();
    return all;
  }
  bool empty() const { return at_ >= size_; }

 private:
  const std::uint8_t* data_;
  std::size_t size_, at_ = 0;
};

constexpr std::size_t sector_bytes = 1024;

std::vector<std::uint8_t> sector(Input& input) {
  const std::uint8_t how = input.byte();
  std::vector<std::uint8_t> bytes(16, how);
  if (how < 0x40) return std::vector<std::uint8_t>(sector_bytes, how < 0x20 ? 0xFF : 0x00);
  if (how < 0x80) {
    bytes = input.bytes(4 * (how & 0x3FU));
    bytes.resize(sector_bytes, 0xFF);
    return bytes;
  }
  // records with valid checksums and any content
  const std::uint32_t base = how < 0xC0 ? 64U * (how & 7U) : input.word();
  for (std::uint8_t records = input.byte() % 20; records > 0 && bytes.size() < sector_bytes; --records) {
    const auto line = static_cast<std::uint32_t>(bytes.size() / 16);
    const std::uint8_t type = input.byte(), layout = input.byte(), length = input.byte();
    const auto record = record_bytes(base + line, type, layout, input.bytes(length));
    bytes.insert(bytes.end(), record.begin(), record.end());
  }
  bytes.resize(sector_bytes, 0xFF);
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  FlashModel flash({3, sector_bytes}, 1);
  for (std::uint32_t s = 0; s < 3; ++s) flash.fill(s, sector(input));
  plug_in(&flash);
  storage::Log log;
  log.open();
  int steps = 0;
  while (!input.empty() && ++steps < 60) {
    const std::uint8_t what = input.byte();
    try {
      if ((what & 0x40) != 0) flash.cut_in(input.byte() % 32);
      switch (what % 6) {
        case 0:
          log.erase_next_sector();
          break;
        case 1: {
          storage::Persistence p;
          p.start(static_cast<hal::ResetCause>(what >> 4 & 7), std::nullopt, input.word());
          const auto start = p.starting_point();
          require(!start || (start->soc_ppb >= 0 && start->soc_ppb <= 1'000'000'000 && start->soc_sigma_ppb > 0));
          p.fault(what);
          p.set(what, what);
          p.power_failing({estimator::StoredEstimate{static_cast<std::int32_t>(input.word()),
                                                     static_cast<std::int32_t>(input.word())},
                           {},
                           {}},
                          input.word());
          log.open();
          break;
        }
        case 2:
          log.open();
          break;
        default: {
          const storage::Kind kind{static_cast<std::uint8_t>(what & 15), input.byte()};
          const auto payload = input.bytes(input.byte());
          if (log.store(kind, payload) != storage::StoreResult::stored) break;
          flash.no_cut();
          std::array<std::uint8_t, storage::max_payload_bytes> into;
          const auto found = log.load(kind.type, kind.layout, into);
          require(found && std::equal(found->payload.begin(), found->payload.end(), payload.begin(), payload.end()));
        }
      }
    } catch (const PowerCut&) {
      log.open();
    }
    flash.no_cut();
  }
  return 0;
}
