// Challenges that never return: each is a code over a pool, fresh random bits and the time. With the chip's generator
// nobody can foresee one. Without it (an emulator, a chip without one) the number of starts and the time in operation
// still make those of each start different.
#pragma once

#include <array>
#include <cstdint>

#include "authentication/codes.hpp"
#include "hal/bytes.hpp"
#include "hal/random.hpp"

namespace bms::firmware {

class ChallengeSource {
 public:
  /// key: of this device. starts, operating_s: from storage.
  ChallengeSource(const authentication::Key& key, std::uint32_t starts, std::uint32_t operating_s) : key_(key) {
    hal::put_bytes(pool_, 0, starts);
    hal::put_bytes(pool_, 4, operating_s);
  }

  /// A challenge of 48 bits, never 0.
  [[gnu::noinline]] std::uint64_t next(std::uint64_t now_us) {
    std::array<std::uint8_t, 36> message{};
    std::copy(pool_.begin(), pool_.end(), message.begin());
    for (std::size_t k = 0; k < 3; ++k) hal::put_bytes(message, 16 + 4 * k, hal::random_word());
    hal::put_bytes(message, 28, now_us);
    pool_ = authentication::Cmac(key_)(message);
    const std::uint64_t challenge = hal::get_bytes<std::uint64_t>(pool_, 0, 6);
    hal::put_bytes(pool_, 0, hal::random_word());  // what was published is not what the next one is made of
    return challenge != 0 ? challenge : 1;
  }

 private:
  authentication::Key key_;
  authentication::Block pool_{};
};

}  // namespace bms::firmware
