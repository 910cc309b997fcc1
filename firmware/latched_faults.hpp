// Latched faults over a loss of power: those that only service clears. They are stored twice, in a setting
// (storage/persistence.hpp) and in backup registers (hal/calendar.hpp), and a fault that either has is latched at the
// next start. So neither worn-out flash nor an empty backup battery loses a latch.
//
// The backup registers count only if their supply is proven: at a start after the power was off, their content was
// intact. The proof itself is stored with them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/stored_state.hpp"
#include "hal/bytes.hpp"
#include "hal/calendar.hpp"
#include "hal/power.hpp"
#include "storage/crc32.hpp"
#include "storage/persistence.hpp"

namespace bms::firmware {

class LatchedFaults {
 public:
  /// persistence: already started, must outlive this object. cause: of this start.
  LatchedFaults(storage::Persistence& persistence, hal::ResetCause cause)
      : persistence_(persistence), faults_(setting(latched_faults_key)) {
    faults_ |= std::uint64_t{setting(more_latched_faults_key)} << 32;
    const Words stored = backup();
    const bool intact = stored[check] == check_of(stored);
    if (intact) {
      faults_ |= stored[0] | std::uint64_t{stored[1]} << 32;
      const bool power_was_off = cause == hal::ResetCause::power_on || cause == hal::ResetCause::brown_out;
      supply_proven_ = stored[proven] != 0 || power_was_off;
    }
    store_in_backup();
  }

  /// At the start: those of the last run. One bit each.
  std::uint64_t faults() const { return faults_; }

  [[gnu::noinline]] void store(std::uint64_t faults) {
    faults_ = faults;
    persistence_.set(latched_faults_key, static_cast<std::int32_t>(static_cast<std::uint32_t>(faults)));
    // A pack that never had one of these faults does not need the second setting.
    if (const auto high = static_cast<std::uint32_t>(faults >> 32); high != 0 || setting(more_latched_faults_key) != 0)
      persistence_.set(more_latched_faults_key, static_cast<std::int32_t>(high));
    store_in_backup();
  }

  /// Returns true if a loss of power would lose a latched fault: flash that is worn out, and no backup.
  bool endangered() const {
    const storage::Log& log = persistence_.log();
    return faults_ != 0 && !supply_proven_ && log.sectors() > 0 && !log.operational() &&
           !persistence_.settings_stored();
  }

 private:
  static constexpr std::size_t proven = 2, check = 3;
  using Words = std::array<std::uint32_t, hal::backup_words>;

  std::uint32_t setting(std::uint16_t key) const {
    return static_cast<std::uint32_t>(persistence_.settings().get(key).value_or(0));
  }
  static std::uint32_t check_of(const Words& words) {
    std::array<std::uint8_t, 4 * check> bytes;
    for (std::size_t k = 0; k < check; ++k) hal::put_bytes(bytes, 4 * k, words[k]);
    return storage::crc32(bytes);
  }
  static Words backup() {
    Words words;
    for (std::size_t k = 0; k < words.size(); ++k) words[k] = hal::backup_word(k);
    return words;
  }
  void store_in_backup() {
    Words words{static_cast<std::uint32_t>(faults_), static_cast<std::uint32_t>(faults_ >> 32), supply_proven_, 0};
    words[check] = check_of(words);
    for (std::size_t k = 0; k < words.size(); ++k) hal::set_backup_word(k, words[k]);
    supply_proven_ = supply_proven_ && backup() == words;
  }

  storage::Persistence& persistence_;
  std::uint64_t faults_;
  bool supply_proven_ = false;
};

}  // namespace bms::firmware
