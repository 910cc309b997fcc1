// Latched faults over a loss of power: those that only service clears. They are stored twice, in a setting
// (firmware/storage/persistence.hpp) and in backup registers (hal/calendar.hpp), and a fault that either has is latched
// at the next start. So neither worn-out flash nor an empty backup battery loses a latch.
//
// The backup registers count only if their supply is proven: at a start after the power was off, their content was
// intact. The proof itself is stored with them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/stored_state.hpp"
#include "hal/calendar.hpp"
#include "hal/power.hpp"
#include "storage/crc32.hpp"
#include "storage/persistence.hpp"

namespace bms::firmware {

class LatchedFaults {
 public:
  /// persistence: already started, must outlive this object. cause: of this start.
  [[gnu::noinline]] LatchedFaults(storage::Persistence& persistence, hal::ResetCause cause)
      : persistence_(persistence) {
    for (std::size_t k = 0; k < words_.size(); ++k) words_[k] = hal::backup_word(k);
    if (words_[check] != check_word())
      words_ = {};
    else if (cause == hal::ResetCause::power_on || cause == hal::ResetCause::brown_out)
      words_[proven] = 1;
    for (std::size_t k = 0; k < keys.size(); ++k) words_[k] |= setting(k);
    store_in_backup();
  }

  /// One bit each; at the start, those of the last run.
  std::uint64_t faults() const { return words_[0] | std::uint64_t{words_[1]} << 32; }

  /// Returns false if flash has no room for the setting.
  [[gnu::noinline]] bool store(std::uint64_t faults) {
    bool stored = true;
    for (std::size_t k = 0; k < keys.size(); ++k, faults >>= 32) {
      words_[k] = static_cast<std::uint32_t>(faults);
      if (words_[k] != setting(k))
        stored = persistence_.set(keys[k], static_cast<std::int32_t>(words_[k]), storage::Urgency::safety) && stored;
    }
    store_in_backup();
    return stored;
  }

  /// Returns true if a loss of power would lose a latched fault: flash that is worn out, and no backup.
  bool endangered() const {
    return (words_[0] | words_[1]) != 0 && words_[proven] == 0 && !persistence_.settings_stored() &&
           persistence_.log().sectors() > 0 && !persistence_.log().operational();
  }

 private:
  static constexpr std::array keys{latched_faults_key, more_latched_faults_key};
  static constexpr std::size_t proven = 2, check = 3;  ///< words after those of the faults

  std::uint32_t setting(std::size_t k) const {
    return static_cast<std::uint32_t>(persistence_.settings().get(keys[k]).value_or(0));
  }
  std::uint32_t check_word() const {
    return storage::crc32({reinterpret_cast<const std::uint8_t*>(words_.data()), 4 * check});
  }
  void store_in_backup() {
    words_[check] = check_word();
    for (std::size_t k = 0; k < words_.size(); ++k) hal::set_backup_word(k, words_[k]);
  }

  storage::Persistence& persistence_;
  std::array<std::uint32_t, hal::backup_words> words_;
};

}  // namespace bms::firmware
