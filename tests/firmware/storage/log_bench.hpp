// A log on a model of flash, and functions that several tests of the log use.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "storage/log.hpp"
#include "tests/firmware/storage/flash_model.hpp"
#include "tests/firmware/storage/record_bytes.hpp"

namespace bms {

using storage::Kind;
using storage::Log;
using storage::StoreResult;
using Bytes = std::vector<std::uint8_t>;

inline constexpr hal::FlashSize small{3, 1024}, two{2, 1024};

/// Payload of the newest record of a type, up to a layout.
inline std::optional<Bytes> content(Log& log, std::uint8_t type, std::uint8_t layout) {
  std::array<std::uint8_t, storage::max_payload_bytes> into;
  const auto found = log.load(type, layout, into);
  if (!found) return std::nullopt;
  return Bytes(found->payload.begin(), found->payload.end());
}

inline Bytes random_bytes(std::mt19937& random, std::size_t most) {
  Bytes bytes(random() % (most + 1));
  const bool ones = random() % 8 == 0;  // like erased flash
  for (auto& b : bytes) b = ones ? 0xFF : static_cast<std::uint8_t>(random());
  return bytes;
}

/// Stores a record; erases sectors as long as the log requests it.
inline StoreResult store_record(Log& log, Kind kind, const Bytes& bytes) {
  StoreResult done = log.store(kind, bytes);
  for (int k = 0; k < 8 && done == StoreResult::needs_erase; ++k) {
    log.erase_next_sector();
    done = log.store(kind, bytes);
  }
  return done;
}

class LogTest : public ::testing::Test {
 protected:
  explicit LogTest(hal::FlashSize size = small) : flash(size, 1) {
    plug_in(&flash);
    log.open();
  }
  void fill_rounds(int records) {
    for (int k = 0; k < records; ++k) ASSERT_EQ(store_record(log, {1, 1}, number(k)), StoreResult::stored) << k;
  }
  static Bytes number(int k) {
    Bytes bytes;
    put(bytes, static_cast<std::uint32_t>(k));
    return bytes;
  }
  FlashModel flash;
  Log log;
};

}  // namespace bms
